"""Results by the digest of all that they depend on: plain files, one per result.

Any number of processes may read and write one store at once: a file appears whole, under a name
that says what it was made from, and nobody changes it afterwards. Each carries its own digest, and
what does not agree with it counts as absent. Nothing in a store is worth a flush to disk: what a
crash of the machine damages is made again.
"""

from __future__ import annotations

import hashlib
import json
import os
import secrets
import socket
import time
from collections.abc import Iterator, Mapping
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from animeme.errors import InputError
from animeme.files import unwritable

_MAGIC = b"animeme.entry/1 "
_TEMPORARY = "tmp"
# Somebody else's half-written file, on a machine that we cannot ask about its process.
ABANDONED_S = 24 * 3600.0


@dataclass(frozen=True)
class Entry:
    """One result.

    Attributes:
        value: JSON-safe.
        payload: bytes that belong to it.
        digest: hexadecimal SHA-256 of `payload`.
    """

    value: Mapping[str, Any]
    payload: bytes
    digest: str


@dataclass(frozen=True)
class EntryFile:
    """An entry as it lies on disk.

    Attributes:
        key: of the entry.
        path: its file.
        size: bytes.
        used: when it was last written or used, seconds since the epoch.
    """

    key: str
    path: Path
    size: int
    used: float


class Store:
    """A folder of entries; made when the first is written.

    Attributes:
        folder: where it is.
        damaged: keys of entries that were asked for, and were not what had been put there.
    """

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self.damaged: list[str] = []
        self._place = str(folder)  # joining paths takes longer than it should, for every entry

    def path(self, key: str) -> Path:
        """The file of the entry called `key` (64 hexadecimal digits)."""
        return Path(self._file(key))

    def _file(self, key: str) -> str:
        return f"{self._place}/{key[:2]}/{key[2:]}"

    def scratch(self) -> Path:
        """A name for a temporary file; `sweep` removes it when this process is dead."""
        return Path(self._scratch())

    def _scratch(self) -> str:
        name = f"{socket.gethostname()}-{os.getpid()}-{secrets.token_hex(4)}"
        return f"{self._place}/{_TEMPORARY}/{name}"

    def put(self, key: str, value: Mapping[str, Any], payload: bytes = b"") -> Entry:
        """Keep a result.

        Raises:
            InputError: the store cannot be written.
        """
        digest = hashlib.sha256(payload).hexdigest()
        content = {"key": key, "payload": digest, "value": value}
        head = json.dumps(content, ensure_ascii=False, separators=(",", ":")).encode()
        scratch, target = self._scratch(), self._file(key)
        first = _MAGIC + hashlib.sha256(head).hexdigest().encode() + b"\n"
        try:
            try:
                _write(scratch, target, first + head + b"\n" + payload)
            except FileNotFoundError:  # its folders are not there yet
                for path in (target, scratch):
                    os.makedirs(os.path.dirname(path), exist_ok=True)
                _write(scratch, target, first + head + b"\n" + payload)
        except OSError as error:
            with suppress(OSError):
                os.unlink(scratch)
            raise unstorable(self.folder, error) from error
        return Entry(value, payload, digest)

    def get(self, key: str) -> Entry | None:
        """The entry called `key`; None if there is none, or it is not what was written."""
        try:
            with open(self._file(key), "rb", buffering=0) as stream:
                data = stream.readall()
        except OSError:
            return None
        entry = _parsed(key, data)
        if entry is None:
            self.damaged.append(key)
        return entry

    def has(self, key: str) -> bool:
        """Whether there is a file for `key`; what it holds shows when it is read."""
        return os.path.isfile(self._file(key))

    def touch(self, key: str) -> bool:
        """Note that an entry is in use; False if there is none."""
        try:
            os.utime(self._file(key))
        except OSError:
            return self.has(key)  # on a store that may only be read
        return True

    def files(self) -> Iterator[EntryFile]:
        """Every entry, in no order."""
        for folder in _folders(self.folder):
            with suppress(OSError), os.scandir(folder) as found:
                for entry in found:
                    with suppress(OSError):  # another process may have removed it
                        state = entry.stat(follow_symlinks=False)
                        key = os.path.basename(folder) + entry.name
                        yield EntryFile(key, Path(entry.path), state.st_size, state.st_mtime)

    def sweep(self) -> int:
        """Remove what processes that are dead had begun to write; how many files."""
        removed = 0
        own = socket.gethostname()
        with suppress(OSError), os.scandir(self.folder / _TEMPORARY) as found:
            for entry in found:
                host, _, rest = entry.name.rpartition("-")[0].rpartition("-")
                with suppress(OSError, ValueError):
                    if host == own:
                        dead = not alive(int(rest))
                    else:
                        dead = time.time() - entry.stat().st_mtime > ABANDONED_S
                    if dead:
                        os.unlink(entry.path)
                        removed += 1
        return removed


def unstorable(folder: Path, error: OSError) -> InputError:
    """The error to raise when a store cannot be written."""
    plain = unwritable(folder, error)
    return InputError(
        "store-unwritable",
        plain.problem,
        place=str(folder),
        action="Free space there, name another folder with --cache, or run with --no-cache.",
    )


def alive(process: int) -> bool:
    """Whether a process of this machine lives."""
    try:
        os.kill(process, 0)
    except ProcessLookupError:
        return False
    except PermissionError:
        return True
    return not _ended(process)


def _ended(process: int) -> bool:
    """Whether nothing but its exit code is left: in containers, nobody may ever ask for that."""
    try:
        with open(f"/proc/{process}/stat") as stream:
            return stream.read().rpartition(")")[2].split()[0] in "ZX"
    except (OSError, UnicodeDecodeError):  # no Linux, or gone meanwhile
        return False


def _write(scratch: str, target: str, data: bytes) -> None:
    with open(scratch, "wb") as stream:
        stream.write(data)
    os.replace(scratch, target)


def _parsed(key: str, data: bytes) -> Entry | None:
    first, _, rest = data.partition(b"\n")
    head, _, payload = rest.partition(b"\n")
    if first != _MAGIC + hashlib.sha256(head).hexdigest().encode():
        return None
    content = json.loads(head)
    digest = hashlib.sha256(payload).hexdigest()
    if content["key"] != key or content["payload"] != digest:
        return None
    return Entry(content["value"], payload, digest)


def _folders(root: Path) -> list[str]:
    try:
        with os.scandir(root) as found:
            return sorted(entry.path for entry in found if len(entry.name) == 2 and entry.is_dir())
    except OSError:
        return []
