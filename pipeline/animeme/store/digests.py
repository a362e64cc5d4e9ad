"""Digests of files, from a table of what they were when they were last read.

A file whose size, times of change and inode are those of the table has the digest of the table, as
git's index has it. One that was changed just before it was read may change once more without any
of them showing it, so the table does not hold it: such files are read again.
"""

from __future__ import annotations

import os
import time
from pathlib import Path

from animeme.files import sha256, stamp
from animeme.store.index import Index

ABSENT = "absent"
"""Stands for the digest of a file that is not there."""

# File systems count time in steps: of 4 ms and less, of 1 or 2 s where no digits follow.
_STEP_NS = 50_000_000
_COARSE_STEP_NS = 2_100_000_000


class Digests:
    """SHA-256 of files, by path.

    Args:
        index: keeps the table.
        rehash: read every file, whatever the table says.
    """

    def __init__(self, index: Index, *, rehash: bool = False) -> None:
        self._index = index
        self._rehash = rehash
        self._fresh: dict[str, tuple[str, str]] = {}
        self._folder = os.getcwd()

    def load(self, *folders: Path) -> None:
        """Have what is known of files below these folders at hand, in one query each."""
        for folder in folders:
            self._index.load_files(os.path.abspath(folder))

    def of(self, path: str | Path) -> str | None:
        """Digest of a file: `ABSENT` if it is not there, None if it cannot be read."""
        return self.look(path)[0]

    def look(self, path: str | Path) -> tuple[str | None, str]:
        """Digest of a file as `of` gives it, and its stamp at that moment."""
        seen_ns = time.time_ns()
        now = stamp(path)
        if not now:
            return ABSENT, ""
        name = os.fspath(path)
        full = name if name.startswith("/") else os.path.join(self._folder, name)
        known = self._fresh.get(full)
        if known is None and not self._rehash:
            known = self._index.file(full)
        if known is not None and known[0] == now:
            return known[1], now
        try:
            digest = sha256(Path(path))
        except OSError:
            return None, now
        self.learn(full, now, digest, seen_ns=seen_ns)
        return digest, now

    def learn(
        self, path: str | Path, stamped: str, digest: str, *, seen_ns: int | None = None
    ) -> None:
        """Remember a file.

        Args:
            path: of the file.
            stamped: its stamp when it was read or written.
            digest: of what was read or written.
            seen_ns: when that was, in nanoseconds since the epoch; now if None.
        """
        full = os.path.join(self._folder, path)
        self._fresh[full] = stamped, digest
        _, modified, changed, _ = map(int, stamped.split(":"))
        last = max(modified, changed)
        step = _STEP_NS if last % 1_000_000 else _COARSE_STEP_NS
        if (seen_ns or time.time_ns()) - last > step:
            self._index.set_file(full, stamped, digest)

    def settle(self) -> None:
        """At the end of a run: learn what was too fresh to be trusted when it was learnt."""
        for path, (stamped, digest) in self._fresh.items():
            if self._index.loaded_file(path) != (stamped, digest) and stamp(path) == stamped:
                self.learn(path, stamped, digest)
