"""What became of a job's lines and files when it was last run, by what they looked like.

It spares a run digests of digests. A line whose files have the size, times and inode that they had,
in a run with the same settings and code, has the keys that it had; what it delivered is in place if
it looks as it did. Everything else is looked up by content, as on any other machine.
"""

from __future__ import annotations

import json
from collections import deque
from collections.abc import Iterable, Mapping, Sequence
from typing import Any

from animeme.dialogue import Line
from animeme.files import stamp
from animeme.store.keys import LINE, File, Value, canonical
from animeme.store.memory import Memory

Stamps = tuple[tuple[str, str], ...]
"""(file, its stamp) each."""

_as_json = json.JSONEncoder(ensure_ascii=False, separators=(",", ":")).encode
# Half of what waits for its files to settle has done so by then.
_AT_ONCE = 2_000
_VALUES = tuple(name for name, declared in LINE.items() if isinstance(declared, Value))
_FILES = tuple(name for name, declared in LINE.items() if isinstance(declared, File))


class Recent:
    """Rows by name: what a thing looked like, and what was known of it.

    Args:
        memory: keeps them.
        scope: whose things they are.
    """

    def __init__(self, memory: Memory, scope: str) -> None:
        self._memory = memory
        self._scope = scope
        self._waiting: deque[tuple[str, str, str, Stamps]] = deque()

    def rows(self, names: Iterable[str]) -> dict[str, tuple[str, str]]:
        """Name → what it looked like, and what was known of it, as JSON; none on ``--rehash``."""
        if self._memory.digests.rehashes:
            return {}
        return self._memory.index.recent(self._scope, names)

    def known(self, name: str) -> dict[str, Any]:
        """What was known of one thing, whatever it looks like now; {} if nothing."""
        row = self._memory.index.recent(self._scope, [name]).get(name)
        found: dict[str, Any] = json.loads(row[1]) if row is not None else {}
        return found

    def put(self, name: str, seen: str, known: Mapping[str, Any], files: Stamps) -> None:
        """Remember a thing once all of these files show any further change."""
        text = _as_json(known)
        self._waiting.append((name, seen, text, files))
        if len(self._waiting) >= _AT_ONCE:
            self._memory.digests.settle()
            for _ in range(len(self._waiting)):
                self._take(self._waiting.popleft(), last=False)

    def forget(self, name: str, known: Mapping[str, Any]) -> None:
        """Remember of a thing only this: whatever it looks like, it must be looked up."""
        self._memory.index.set_recent(self._scope, name, "", json.dumps(known))

    def close(self) -> None:
        """At the end of a run: remember what has settled by now."""
        if self._waiting:
            self._memory.digests.settle()
        while self._waiting:
            self._take(self._waiting.popleft(), last=True)

    def _take(self, row: tuple[str, str, str, Stamps], *, last: bool) -> None:
        name, seen, text, files = row
        settled = all(self._memory.digests.trusts(path) for path, _ in files)
        if settled or last:
            self._memory.index.set_recent(self._scope, name, seen if settled else "", text)
        else:
            self._waiting.append(row)


def files_of(line: Line) -> list[str]:
    """Every file that a line's results are keyed on, the voice aside."""
    paths = [getattr(line, name) for name in _FILES]
    return [str(path) for path in (*paths, *(car.path for car in line.side_cars)) if path]


def look_of(common: str, line: Line, targets: Sequence[int], stamps: Iterable[Any]) -> str:
    """What a line looks like in a run.

    Args:
        common: what all lines of the run depend on.
        line: the line.
        targets: indices of those that speak it.
        stamps: of its files, in any order.
    """
    values = [getattr(line, name) for name in _VALUES]
    said = [v if isinstance(v, str) else "\1" if v is None else canonical(v) for v in values]
    cars = [f"{car.kind} {car.character}" for car in line.side_cars]
    files = [f"{path}\0{stamped}" for path, stamped in sorted(set(stamps))]
    return "\0".join((common, line.key, str(targets), *said, *cars, *files))


def stamped(paths: Iterable[str]) -> Stamps:
    """Files with their stamps."""
    return tuple((path, stamp(path)) for path in paths)
