"""Adding to JSON text without touching what is there.

Parsing and dumping would change number formats, escapes, white space and repeated keys. So the text
is edited in place: arrays get elements before their closing bracket, single values are replaced,
and everything else keeps its bytes.
"""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

_SCAN = json.JSONDecoder().raw_decode
_SPACE = " \t\r\n"


@dataclass
class Splice:
    """Edits of one JSON object, applied together by `apply`.

    Attributes:
        text: the JSON text of an object.
    """

    text: str
    _edits: list[tuple[int, int, str]] = field(default_factory=list)
    _members: dict[int, dict[str, tuple[int, int]]] = field(default_factory=dict)

    def members(self, start: int = 0) -> dict[str, tuple[int, int]]:
        """Span [from, to) of each member's value in the object at `start`; of twins, the last."""
        if start not in self._members:
            self._members[start] = self._scan_members(start)
        return self._members[start]

    def _scan_members(self, start: int) -> dict[str, tuple[int, int]]:
        found: dict[str, tuple[int, int]] = {}
        at = self._skip(self._skip(start) + 1)
        while self.text[at] != "}":
            key, at = _SCAN(self.text, at)
            at = self._skip(self._skip(at) + 1)
            _, end = _SCAN(self.text, at)
            found[key] = (at, end)
            at = self._next(end)
        return found

    def elements(self, start: int) -> list[tuple[int, int]]:
        """Span of each element of the array at `start`."""
        found: list[tuple[int, int]] = []
        at = self._skip(start + 1)
        while self.text[at] != "]":
            _, end = _SCAN(self.text, at)
            found.append((at, end))
            at = self._next(end)
        return found

    def replace(self, span: tuple[int, int], value: Any) -> None:
        """Put `value` in the place of a value's span."""
        self._edits.append((*span, dumps(value)))

    def append(self, key: str, values: Sequence[Any]) -> None:
        """Append `values` to the top-level array `key`, which is made where there is none."""
        if not values:
            return
        new = ",".join(dumps(value) for value in values)
        span = self.members().get(key)
        if span is None:
            self._insert_member(0, key, f"[{new}]")
            return
        at = span[1] - 1
        self._edits.append((at, at, f",{new}" if self.elements(span[0]) else new))

    def set(self, start: int, key: str, value: Any) -> None:
        """Give the object at `start` a member, in the place of an older one of that key."""
        span = self.members(start).get(key)
        if span is None:
            self._insert_member(start, key, dumps(value))
        else:
            self.replace(span, value)

    def apply(self) -> str:
        """The edited text."""
        parts, at = [], 0
        # Stable: several insertions at one place keep their order.
        for start, end, new in sorted(self._edits, key=lambda edit: edit[:2]):
            parts += [self.text[at:start], new]
            at = end
        return "".join([*parts, self.text[at:]])

    def _insert_member(self, start: int, key: str, value: str) -> None:
        members = self.members(start)
        last = max((end for _, end in members.values()), default=self._skip(start) + 1)
        end = self._skip(last) + 1
        comma = "," if members or self._inserted(end - 1) else ""
        self._edits.append((end - 1, end - 1, f"{comma}{dumps(key)}:{value}"))

    def _inserted(self, at: int) -> bool:
        return any(start == at for start, _, _ in self._edits)

    def _next(self, at: int) -> int:
        at = self._skip(at)
        return self._skip(at + 1) if self.text[at] == "," else at

    def _skip(self, at: int) -> int:
        while self.text[at] in _SPACE:
            at += 1
        return at


def dumps(value: Any) -> str:
    """Compact JSON; keys in the order given, characters as they are."""
    if isinstance(value, Mapping):
        value = dict(value)
    return json.dumps(value, ensure_ascii=False, separators=(",", ":"), allow_nan=False)
