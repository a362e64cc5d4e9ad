"""What the driver knows of files on this machine, and of results by line: SQLite, on a local disk.

Everything in it can be found out again, so nothing is lost with it: where it cannot be opened, is
broken or busy, a run goes on without. It is never on a share: it holds inodes and times.
"""

from __future__ import annotations

import hashlib
import os
import sqlite3
from collections.abc import Iterable, Sequence
from contextlib import suppress
from pathlib import Path
from types import TracebackType
from typing import Self

# What it holds changes with this number; another one's file is left to other versions.
_FORMAT = 1
_SCHEMA = """
CREATE TABLE IF NOT EXISTS files (
    path TEXT PRIMARY KEY, stamp TEXT NOT NULL, digest TEXT NOT NULL) WITHOUT ROWID;
CREATE TABLE IF NOT EXISTS notes (key TEXT PRIMARY KEY, value TEXT NOT NULL) WITHOUT ROWID;
CREATE TABLE IF NOT EXISTS recent (
    scope TEXT NOT NULL, name TEXT NOT NULL, seen TEXT NOT NULL, value TEXT NOT NULL,
    PRIMARY KEY (scope, name)) WITHOUT ROWID;
"""
_AT_ONCE = 20_000  # fewer than SQLite's limit of variables


def user_cache() -> Path:
    """The user's cache folder: ``$ANIMEME_CACHE``, or the system's place for such things."""
    if own := os.environ.get("ANIMEME_CACHE"):
        return Path(own)
    base = os.environ.get("XDG_CACHE_HOME")
    return (Path(base) if base else Path.home() / ".cache") / "animeme"


def index_path(store: Path) -> Path:
    """Where this machine keeps its index of a store."""
    name = hashlib.sha256(os.path.realpath(store).encode("utf-8", "surrogateescape")).hexdigest()
    return user_cache() / "index" / f"{name[:16]}.{_FORMAT}.sqlite"


class Index:
    """Three tables, written when it is closed.

    Files → stamp and digest; notes, key → text; and what of a job's last run is looked up by name:
    what something looked like then, and what was known of it.

    Args:
        path: its file; None keeps it in memory.
        dry: write nothing.
    """

    def __init__(self, path: Path | None, *, dry: bool = False) -> None:
        self._dry = dry
        self._database = _open(path)
        self._files: dict[str, tuple[str, str]] = {}
        self._notes: dict[str, str] = {}
        self._new_files: dict[str, tuple[str, str]] = {}
        self._new_notes: dict[str, str] = {}
        self._new_recent: dict[tuple[str, str], tuple[str, str]] = {}

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, _: BaseException | None, __: TracebackType | None
    ) -> None:
        self.save()
        if self._database is not None:
            self._database.close()

    def load_files(self, paths: Sequence[str]) -> None:
        """Have these files at hand until the next such call; `file` alone asks one at a time."""
        self._files = {}
        for first in range(0, len(paths), _AT_ONCE):
            part = paths[first : first + _AT_ONCE]
            marks = ",".join("?" * len(part))
            query = f"SELECT path, stamp, digest FROM files WHERE path IN ({marks})"
            self._files.update((path, (seen, sum_)) for path, seen, sum_ in self._rows(query, part))

    def file(self, path: str) -> tuple[str, str] | None:
        """Stamp and digest of a file at an absolute path, as they were once."""
        known = self._new_files.get(path) or self._files.get(path)
        if known is None:
            for stamp, digest in self._rows(
                "SELECT stamp, digest FROM files WHERE path = ?", (path,)
            ):
                known = self._files[path] = (stamp, digest)
        return known

    def set_file(self, path: str, stamp: str, digest: str) -> None:
        """Remember the digest of a file."""
        with suppress(UnicodeEncodeError):  # a name that is not UTF-8 is asked for each time
            path.encode()
            self._new_files[path] = (stamp, digest)

    def note(self, key: str) -> str | None:
        """One note."""
        return self.notes([key]).get(key)

    def notes(self, keys: Iterable[str]) -> dict[str, str]:
        """Those of the notes that there are."""
        asked = list(keys)
        found: dict[str, str] = {}
        for first in range(0, len(asked), _AT_ONCE):
            part = asked[first : first + _AT_ONCE]
            marks = ",".join("?" * len(part))
            rows = self._rows(f"SELECT key, value FROM notes WHERE key IN ({marks})", part)
            found.update((key, value) for key, value in rows)
        found.update((key, self._new_notes[key]) for key in asked if key in self._new_notes)
        return found

    def set_note(self, key: str, value: str) -> None:
        """Remember a note."""
        self._new_notes[key] = value

    def recent(self, scope: str, names: Iterable[str]) -> dict[str, tuple[str, str]]:
        """Name → what it looked like in the last run, and what was known of it."""
        asked = list(names)
        found: dict[str, tuple[str, str]] = {}
        for first in range(0, len(asked), _AT_ONCE):
            part = asked[first : first + _AT_ONCE]
            marks = ",".join("?" * len(part))
            query = f"SELECT name, seen, value FROM recent WHERE scope = ? AND name IN ({marks})"
            found.update((n, (seen, value)) for n, seen, value in self._rows(query, [scope, *part]))
        if self._new_recent:
            new = {name: self._new_recent.get((scope, name)) for name in asked}
            found.update((name, row) for name, row in new.items() if row is not None)
        return found

    def set_recent(self, scope: str, name: str, seen: str, value: str) -> None:
        """Remember what something looks like in this run, and what is known of it."""
        self._new_recent[scope, name] = (seen, value)

    def forget(self, keys: Iterable[str]) -> None:
        """Drop notes that turned out to be wrong."""
        gone = [(key,) for key in keys]
        for (key,) in gone:
            self._new_notes.pop(key, None)
        self._write("DELETE FROM notes WHERE key = ?", gone)

    def save(self) -> None:
        """Write what is new."""
        files = [(path, *known) for path, known in self._new_files.items()]
        if self._write("INSERT OR REPLACE INTO files VALUES (?, ?, ?)", files):
            for path in self._files.keys() & self._new_files.keys():
                del self._files[path]
            self._new_files = {}
        if self._write("INSERT OR REPLACE INTO notes VALUES (?, ?)", [*self._new_notes.items()]):
            self._new_notes = {}
        recent = [(*key, *known) for key, known in self._new_recent.items()]
        if self._write("INSERT OR REPLACE INTO recent VALUES (?, ?, ?, ?)", recent):
            self._new_recent = {}

    def _rows(self, query: str, values: Iterable[str]) -> list[tuple[str, ...]]:
        try:
            return self._database.execute(query, tuple(values)).fetchall()
        except (sqlite3.Error, UnicodeEncodeError):  # it knows no name that is not UTF-8
            return []

    def _write(self, statement: str, rows: Sequence[tuple[str, ...]]) -> bool:
        if not rows or self._dry:
            return True
        try:
            with self._database:
                self._database.executemany(statement, rows)
        except sqlite3.Error:
            return False  # full, locked or broken: the next run finds out again
        return True


def _open(path: Path | None) -> sqlite3.Connection:
    """The database at `path`, or one in memory where that cannot be used."""
    for _ in range(2 if path is not None else 0):
        assert path is not None
        try:
            path.parent.mkdir(parents=True, exist_ok=True)
            return _prepared(sqlite3.connect(path, timeout=5.0))
        except (sqlite3.OperationalError, OSError):
            break  # locked, or no place for it
        except sqlite3.DatabaseError:  # broken: what it held can be found out again
            with suppress(OSError):
                for suffix in ("", "-wal", "-shm"):
                    path.with_name(path.name + suffix).unlink(missing_ok=True)
    return _prepared(sqlite3.connect(":memory:"))


def _prepared(database: sqlite3.Connection) -> sqlite3.Connection:
    database.execute("PRAGMA journal_mode = WAL")  # a disk that cannot keeps its own mode
    database.execute("PRAGMA synchronous = NORMAL")
    database.executescript(_SCHEMA)
    return database
