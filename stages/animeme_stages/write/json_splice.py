"""Adding to JSON text without touching what is there, and taking it away again.

Parsing and dumping would change number formats, escapes, white space and repeated keys. So the text
is edited in place: arrays get elements before their closing bracket, single values are replaced,
and everything else keeps its bytes.
"""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

from animeme_stages.ingest.glb import by_content

_SCAN = json.JSONDecoder().raw_decode
_SPACE = " \t\r\n"


@dataclass
class Splice:
    """Edits of one JSON object, applied together by `apply`.

    Attributes:
        text: the JSON text of an object.
    """

    text: str
    _replaced: dict[tuple[int, int], str] = field(default_factory=dict)
    _appended: dict[str, list[str]] = field(default_factory=dict)  # top-level array → elements
    _added: dict[int, dict[str, str]] = field(default_factory=dict)  # object → new members
    _members: dict[int, dict[str, tuple[int, int]]] = field(default_factory=dict)
    _removed: list[str] = field(default_factory=list)  # top-level members

    def members(self, start: int = 0) -> dict[str, tuple[int, int]]:
        """Span [from, to) of each member's value in the object at `start`; of twins, the last."""
        if start not in self._members:
            made = _members(self.text, start) if start else _root_members(self.text)
            self._members[start] = made
        return self._members[start]

    def elements(self, start: int) -> list[tuple[int, int]]:
        """Span of each element of the array at `start`."""
        found: list[tuple[int, int]] = []
        at = _skip(self.text, start + 1)
        while self.text[at] != "]":
            _, end = _SCAN(self.text, at)
            found.append((at, end))
            at = _next(self.text, end)
        return found

    def replace(self, span: tuple[int, int], value: Any) -> None:
        """Put `value` in the place of a value's span."""
        self.replace_text(span, dumps(value))

    def replace_text(self, span: tuple[int, int], text: str) -> None:
        """Put JSON text in the place of a span."""
        self._replaced[span] = text

    def length(self, key: str) -> int:
        """Characters of the top-level array `key`, up to its closing bracket."""
        start, end = self.members()[key]
        return end - 1 - start

    def truncate(self, key: str, length: int) -> None:
        """Take back what `append` added to the top-level array `key`, whose `length` this was."""
        start, end = self.members()[key]
        if not 0 < length <= self.length(key):
            raise ValueError(f"{key} is shorter than it was")
        if length < self.length(key):
            self.replace_text((start + length, end - 1), "")

    def remove(self, key: str) -> None:
        """Take back the top-level array `key`, which `append` made, if it is there."""
        if key in self.members():
            self._removed.append(key)

    def append(self, key: str, values: Sequence[Any]) -> None:
        """Append `values` to the top-level array `key`, which is made where there is none."""
        if not values:
            return
        self._appended.setdefault(key, []).extend(dumps(value) for value in values)
        if key not in self.members():
            self._added.setdefault(0, {})[key] = f"[{','.join(self._appended[key])}]"

    def set(self, start: int, key: str, value: Any) -> None:
        """Give the object at `start` a member, in the place of an older one of that key."""
        span = self.members(start).get(key)
        if span is None:
            self._added.setdefault(start, {})[key] = dumps(value)
        else:
            self.replace(span, value)

    def apply(self) -> str:
        """The edited text."""
        edits = [(start, end, new) for (start, end), new in self._replaced.items()]
        for key, values in self._appended.items():
            if span := self.members().get(key):
                comma = "" if self.text[_skip(self.text, span[0] + 1)] == "]" else ","
                edits.append((span[1] - 1, span[1] - 1, comma + ",".join(values)))
        if self._removed:
            members = self.members()
            stay = max((end for key, (_, end) in members.items() if key not in self._removed))
            if any(members[key][0] < stay for key in self._removed):
                raise ValueError(f"{', '.join(self._removed)} did not come last")
            last = max(end for _, end in members.values())
            edits.append((_skip(self.text, stay), last, ""))
        for start, added in self._added.items():
            members = self.members(start)
            last = max((end for _, end in members.values()), default=_skip(self.text, start) + 1)
            end = _skip(self.text, last)
            new = ",".join(f"{dumps(key)}:{value}" for key, value in added.items())
            edits.append((end, end, f",{new}" if members else new))
        parts, at = [], 0
        for start, end, new in sorted(edits):
            parts += [self.text[at:start], new]
            at = end
        return "".join([*parts, self.text[at:]])


def _members(text: str, start: int) -> dict[str, tuple[int, int]]:
    found: dict[str, tuple[int, int]] = {}
    at = _skip(text, _skip(text, start) + 1)
    while text[at] != "}":
        key, at = _SCAN(text, at)
        at = _skip(text, _skip(text, at) + 1)
        _, end = _SCAN(text, at)
        found[key] = (at, end)
        at = _next(text, end)
    return found


@by_content
def _root_members(text: str) -> dict[str, tuple[int, int]]:
    return _members(text, 0)


def _next(text: str, at: int) -> int:
    at = _skip(text, at)
    return _skip(text, at + 1) if text[at] == "," else at


def _skip(text: str, at: int) -> int:
    while text[at] in _SPACE:
        at += 1
    return at


def dumps(value: Any) -> str:
    """Compact JSON; keys in the order given, characters as they are."""
    if isinstance(value, Mapping):
        value = dict(value)
    return json.dumps(value, ensure_ascii=False, separators=(",", ":"), allow_nan=False)


class Encoded(str):
    """JSON text that stands for what it says."""


def dumps_members(root: Mapping[str, Any]) -> str:
    """As `dumps`, of an object some of whose members are `Encoded` already."""
    members = (
        f"{dumps(key)}:{value if isinstance(value, Encoded) else dumps(value)}"
        for key, value in root.items()
    )
    return f"{{{','.join(members)}}}"
