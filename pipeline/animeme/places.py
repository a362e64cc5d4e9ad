"""Where in a document's file a member stands, for messages."""

from __future__ import annotations

import re
from pathlib import Path

_HEADER = re.compile(r"^\s*\[\[?\s*(?P<keys>[^\]\n]+?)\s*\]\]?")
_ENTRY = re.compile(r"^\s*(?P<keys>(?:[\w-]+|\"[^\"\n]*\"|'[^'\n]*')(?:\s*\.\s*(?:[\w-]+))*)\s*=")
_KEY = re.compile(r"[\w-]+|\"[^\"\n]*\"|'[^'\n]*'")


class Places:
    """Finds the lines of a TOML file's members; knows none where the file is anything else.

    It looks for headers and keys at the start of lines, so what stands in the middle of a value is
    placed at the line where the value starts.
    """

    def __init__(self, path: Path) -> None:
        self._lines: dict[tuple[str, ...], int] = {}
        if path.suffix.lower() == ".toml":
            try:
                self._scan(path.read_text(encoding="utf-8"))
            except (OSError, ValueError):
                return

    def _scan(self, text: str) -> None:
        table: tuple[str, ...] = ()
        for number, line in enumerate(text.split("\n"), 1):
            if entry := _ENTRY.match(line):
                self._lines.setdefault((*table, *_keys(entry["keys"])), number)
            elif header := _HEADER.match(line):
                table = _keys(header["keys"])
                self._lines.setdefault(table, number)

    def of(self, *keys: str) -> str:
        """The dotted path of a member, with its line where that is known.

        Args:
            keys: the names on the way to it, or one dotted path.
        """
        dotted = ".".join(keys)
        parts = keys if len(keys) > 1 else tuple(dotted.split("."))
        for count in range(len(parts), 0, -1):
            if line := self._lines.get(tuple(parts[:count])):
                return f"{dotted} (line {line})"
        return dotted


def _keys(text: str) -> tuple[str, ...]:
    return tuple(key.strip("\"'") for key in _KEY.findall(text))
