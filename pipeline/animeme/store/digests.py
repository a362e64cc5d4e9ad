"""Digests of files, from a table of what they were when they were last read.

A file whose size, times of change and inode are those of the table has the digest of the table, as
git's index has it. One that was changed just before it was read may change once more without any
of them showing it, so the table does not hold it: such files are read again.
"""

from __future__ import annotations

import os
import time
from collections.abc import Iterable
from pathlib import Path

from animeme.files import counts_finely, sha256, stamp, telling
from animeme.store.index import Index

ABSENT = "absent"
"""Stands for the digest of a file that is not there."""


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
        self._unsettled: set[str] = set()
        self._folder = os.getcwd()

    @property
    def rehashes(self) -> bool:
        """Every file is read, whatever it looks like."""
        return self._rehash

    def load(self, paths: Iterable[str | Path]) -> None:
        """Have what is known of these files at hand, in one query, until the next such call."""
        self._index.load_files([self._full(path) for path in paths])

    def of(self, path: str | Path) -> str | None:
        """Digest of a file: `ABSENT` if it is not there, None if it cannot be read."""
        return self.look(path)[0]

    def look(self, path: str | Path) -> tuple[str | None, str]:
        """Digest of a file as `of` gives it, and its stamp at that moment."""
        now = stamp(path)
        if not now:
            return ABSENT, ""
        full = self._full(path)
        known = self._fresh.get(full)
        if known is None and not self._rehash:
            known = self._index.file(full)
        if known is not None and known[0] == now:
            return known[1], now
        seen_ns = time.time_ns()
        try:
            digest = sha256(path)
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
        full = self._full(path)
        if telling(stamped, seen_ns or time.time_ns()):
            self._index.set_file(full, stamped, digest)
            self._unsettled.discard(full)
            if not self._rehash:
                self._fresh.pop(full, None)
                return
        else:
            self._unsettled.add(full)
        self._fresh[full] = stamped, digest

    def trusts(self, path: str) -> bool:
        """Whether a file that was looked at or learnt will look different once it is changed."""
        return self._full(path) not in self._unsettled

    def _full(self, path: str | Path) -> str:
        """The path from the root; there are several of every line."""
        name = os.fspath(path)
        return name if name.startswith("/") else os.path.join(self._folder, name)

    def settle(self) -> None:
        """Learn what was too fresh to be trusted when it was learnt, and is as it was then.

        Where times are coarse, a file may have changed again without any sign of it: it is read
        by the next run.
        """
        for path in [*self._unsettled]:
            stamped, digest = self._fresh[path]
            if counts_finely(stamped) and stamp(path) == stamped:
                self.learn(path, stamped, digest)
