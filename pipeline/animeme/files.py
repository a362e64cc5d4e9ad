"""Files that appear whole or not at all."""

from __future__ import annotations

import hashlib
import json
import os
import secrets
from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager, suppress
from operator import attrgetter
from pathlib import Path
from typing import Any

from animeme.errors import InputError

# File systems count time in steps: of 4 ms and less, of 1 or 2 s where no digits follow.
_STEP_NS = 50_000_000
_COARSE_NS = 1_000_000
_COARSE_STEP_NS = 2_100_000_000
# Bytes that are read and written together.
_BLOCK = 1 << 20
# Bytes of a file that is worth forgetting.
_LARGE = 1 << 22


@contextmanager
def atomic_path(target: Path, *, durable: bool = True) -> Iterator[Path]:
    """Give a path beside `target` to write to, and rename it to `target` on success.

    A durable file is flushed to disk before it takes its name, so that a crash of the machine
    leaves the old file or the new one. The temporary keeps `target`'s suffix, by which writers
    choose a format, and is short, so that it fits wherever `target` does.

    Args:
        target: the file.
        durable: flush it; not worth the wait for what the next run makes again if it is damaged.

    Raises:
        InputError: the folder or the file cannot be written.
    """
    scratch = scratch_beside(target)
    try:
        folder = os.path.dirname(scratch)
        if folder and not os.path.isdir(folder):
            os.makedirs(folder, exist_ok=True)
        yield scratch
        if durable:
            with open(scratch, "rb+", buffering=0) as stream:
                os.fsync(stream.fileno())
        os.replace(scratch, target)
    except BaseException as error:
        with suppress(OSError):
            os.unlink(scratch)
        if isinstance(error, OSError):
            raise unwritable(target, error) from error
        raise


def scratch_beside(target: Path) -> Path:
    """A name for a temporary file beside `target`; runs remove what killed ones have left of it."""
    return target.with_name(f".{secrets.token_hex(4)}{target.suffix}")


def unwritable(target: Path, error: OSError) -> InputError:
    """The error to raise when `target` cannot be written."""
    return InputError(
        "output-unwritable",
        f"cannot be written: {error.strerror or error}",
        place=str(target),
        action="Choose another output folder, or free space and permissions there.",
    )


def unreadable(path: Path, code: str, error: OSError) -> InputError:
    """The error to raise when the file at `path` is there and cannot be read."""
    return InputError(
        code,
        f"cannot be read: {error.strerror or error}",
        place=str(path),
        action="Check its permissions, and the disk or share that it is on.",
    )


def write_text(target: Path, text: str) -> None:
    """Write `text` to `target` as UTF-8 with LF line ends, atomically."""
    with atomic_path(target) as scratch:
        scratch.write_text(text, encoding="utf-8", newline="\n")


def update_text(target: Path, parts: Iterable[str]) -> None:
    """As `write_text`, part by part; a file that says just that already is left alone."""
    blocks = _blocks(parts)
    same, block = 0, b""
    with suppress(OSError), target.open("rb") as old:
        for block in blocks:
            if old.read(len(block)) != block:
                break
            same += len(block)
        else:
            if not old.read(1):
                return
            block = b""
    with atomic_path(target) as scratch, scratch.open("wb") as new:
        if same:
            with target.open("rb") as old:
                for start in range(0, same, _BLOCK):
                    new.write(old.read(min(_BLOCK, same - start)))
        new.write(block)
        new.writelines(blocks)


def _blocks(parts: Iterable[str]) -> Iterator[bytes]:
    """The parts as UTF-8, some together."""
    some: list[str] = []
    size = 0
    for part in parts:
        some.append(part)
        size += len(part)
        if size >= _BLOCK:
            yield "".join(some).encode()
            some, size = [], 0
    yield "".join(some).encode()


_encoded = json.JSONEncoder(ensure_ascii=False).encode


def json_text(document: Mapping[str, Any]) -> str:
    """A document as JSON with a line for each member, and one for each element of its lists.

    Faster than an indented one by far, and easier to read where elements are alike.
    """
    members = []
    for name, value in document.items():
        if isinstance(value, list) and value:
            rows = ",\n  ".join(map(_encoded, value))
            members.append(f" {_encoded(name)}: [\n  {rows}\n ]")
        else:
            members.append(f" {_encoded(name)}: {_encoded(value)}")
    return "{\n" + ",\n".join(members) + "\n}\n"


def write_bytes(target: Path, data: bytes, *, durable: bool = True) -> None:
    """Write `data` to `target`, atomically; see `atomic_path`."""
    with atomic_path(target, durable=durable) as scratch, open(scratch, "wb", buffering=0) as new:
        left = memoryview(data)
        while left:
            left = left[new.write(left) :]


def walk(
    folder: str, *, without: str = "", hidden: list[str] | None = None
) -> Iterator[tuple[str, list[str]]]:
    """Each folder that has files, and their names, from the top down and by name.

    Nothing hidden, and nothing behind a link to a folder. There may be as many as lines, so these
    are strings, and what the system tells with a name is not asked for again.

    Args:
        folder: where to look; it need not be there.
        without: a folder that is left out.
        hidden: takes in the paths of what is hidden.
    """
    try:
        with os.scandir(folder) as found:
            entries = sorted(found, key=_name_of)
    except (FileNotFoundError, NotADirectoryError, PermissionError):
        return
    names: list[str] = []
    below: list[str] = []
    for entry in entries:
        if entry.name[0] == ".":
            if hidden is not None:
                hidden.append(entry.path)
        elif entry.is_dir(follow_symlinks=False):
            if not without or os.path.normpath(entry.path) != without:
                below.append(entry.path)
        elif entry.is_file():
            names.append(entry.name)
    if names:
        yield folder, names
    for inner in below:
        yield from walk(inner, without=without, hidden=hidden)


_name_of = attrgetter("name")


def stamp(path: str | Path) -> str:
    """What changes when a file is written: size, times of change, inode; "" if it is not there."""
    try:
        state = os.stat(path)
    except OSError:
        return ""
    return f"{state.st_size}:{state.st_mtime_ns}:{state.st_ctime_ns}:{state.st_ino}"


def telling(stamped: str, seen_ns: int) -> bool:
    """Whether a file shows by its stamp whether it was changed after it was read.

    File systems count time in steps, and one that was changed just before it was read may change
    once more within the same.

    Args:
        stamped: its stamp, not "".
        seen_ns: when it was read, in nanoseconds since the epoch.
    """
    last_ns = _last_ns(stamped)
    return seen_ns - last_ns > (_STEP_NS if _is_fine(last_ns) else _COARSE_STEP_NS)


def counts_finely(stamped: str) -> bool:
    """Whether the file system of a stamp counts parts of a second."""
    return _is_fine(_last_ns(stamped))


def _is_fine(time_ns: int) -> bool:
    return time_ns % _COARSE_NS != 0


def _last_ns(stamped: str) -> int:
    """When the file of a stamp was last changed, in nanoseconds since the epoch."""
    _, modified, changed, _ = stamped.split(":")
    return max(int(modified), int(changed))


def let_go(path: Path) -> None:
    """Have the system forget a large file that is on disk, and that nobody will read soon.

    A run's outputs would push its recordings and assets out of memory, and memory that was used
    just now costs less than other.
    """
    with suppress(AttributeError, OSError), open(path, "rb", buffering=0) as stream:
        if os.fstat(stream.fileno()).st_size > _LARGE:
            os.posix_fadvise(stream.fileno(), 0, 0, os.POSIX_FADV_DONTNEED)


def sha256(path: str | Path) -> str:
    """Hexadecimal SHA-256 of a file's content."""
    with open(path, "rb", buffering=0) as stream:
        if os.fstat(stream.fileno()).st_size < _BLOCK:  # the other way takes longer
            return hashlib.sha256(stream.readall()).hexdigest()
        return hashlib.file_digest(stream, "sha256").hexdigest()


def anywhere(asset: Path) -> Path:
    """The folder that all of an asset's files may be in, where somebody only looks at it.

    What animeme writes refers to its source, which lies elsewhere. A run, which delivers files,
    is stricter.
    """
    return Path(asset.absolute().anchor)
