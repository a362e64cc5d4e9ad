"""The container around glTF's JSON: GLB chunks, or a bare ``.gltf`` file.

Only headers and JSON are read; the binary chunk stays where it is.
"""

from __future__ import annotations

import json
import os
import struct
from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property, lru_cache, wraps
from pathlib import Path
from typing import Any, TypeVar

from animeme.errors import InputError

_MAGIC = b"glTF"
_JSON = 0x4E4F534A
_BIN = 0x004E4942
# Characters of JSON; what is made of a longer one is not kept.
_SHORT = 8_000_000
# Bytes; files of animation alone are read at once.
_BUFFER = 1 << 16
_Read = TypeVar("_Read", "str", "Container")
_Made = TypeVar("_Made")


@dataclass(frozen=True)
class Chunk:
    """A GLB chunk: its type, and where its data lies in the file."""

    kind: int
    start: int
    length: int

    @property
    def is_bin(self) -> bool:
        """Whether it is the binary buffer."""
        return self.kind == _BIN


@dataclass(frozen=True)
class Container:
    """A glTF file taken apart.

    Attributes:
        path: the file.
        text: its JSON, exactly as stored.
        chunks: of a GLB, those after the JSON, in order; () for a ``.gltf``.
        binary: whether it is a GLB.
        json_bytes: length of the JSON as stored, with the NULs that some exporters pad it with.
    """

    path: Path
    text: str
    chunks: tuple[Chunk, ...]
    binary: bool
    json_bytes: int

    @cached_property
    def json(self) -> dict[str, Any]:
        """Its JSON, parsed; `open_container` has made sure that this can be done."""
        return parse(self.path, self.text)

    @property
    def is_short(self) -> bool:
        """Whether its JSON may be kept for a while."""
        return len(self.text) < _SHORT

    @property
    def bin(self) -> Chunk | None:
        """The binary chunk, if there is one."""
        return self.chunks[0] if self.chunks and self.chunks[0].is_bin else None


def unreadable(path: Path, problem: str) -> InputError:
    """The error for a file that is not a sound asset."""
    return InputError(
        "asset-unreadable",
        problem,
        place=str(path),
        action="Export or copy the asset again.",
    )


def open_container(path: Path) -> Container:
    """Take a ``.glb``, ``.vrm`` or ``.gltf`` file apart.

    Raises:
        InputError: missing, truncated, or not glTF 2.0.
    """
    try:
        with open(path, "rb", buffering=_BUFFER) as stream:
            head = stream.read(12)
            if head[:4] == _MAGIC:
                chunks = _chunks(path, stream, head)
                stream.seek(chunks[0].start)
                data, rest = stream.read(chunks[0].length), chunks[1:]
            else:
                data, rest = head + stream.read(), ()
    except OSError as error:
        raise unreadable(path, f"cannot be read ({error.strerror})") from error
    container = Container(path, _decode(path, data), rest, head[:4] == _MAGIC, len(data))
    _ = container.json
    return container


def _chunks(path: Path, stream: Any, head: bytes) -> tuple[Chunk, ...]:
    size = os.fstat(stream.fileno()).st_size
    if len(head) < 12:
        raise unreadable(path, "is cut off within its header")
    version, promised = struct.unpack("<II", head[4:])
    if version != 2:
        raise unreadable(path, f"is glTF version {version}; only 2 is known")
    if promised != size:
        raise unreadable(path, f"has {size} bytes, but its header says {promised}")
    found: list[Chunk] = []
    offset = 12
    while offset < size:
        stream.seek(offset)
        header = stream.read(8)
        if len(header) < 8:
            raise unreadable(path, f"is cut off at byte {offset}, within a chunk's header")
        length, kind = struct.unpack("<II", header)
        if length % 4:
            raise unreadable(path, f"has a chunk at byte {offset} that is not a multiple of 4 long")
        if offset + 8 + length > size:
            raise unreadable(path, f"has a chunk at byte {offset} that leaves the file")
        found.append(Chunk(kind, offset + 8, length))
        offset += 8 + length
    if not found or found[0].kind != _JSON:
        raise unreadable(path, "does not begin with a JSON chunk")
    return tuple(found)


def _no_number(text: str) -> float:
    raise ValueError(f"{text} is no number in JSON")


def _decode(path: Path, data: bytes) -> str:
    try:
        return data.decode("utf-8").rstrip("\0")
    except ValueError as error:
        raise unreadable(path, f"holds no JSON ({str(error)[:120]})") from error


def by_content(make: Callable[[_Read], _Made]) -> Callable[[_Read], _Made]:
    """Have a function keep what it makes of the last few texts or containers.

    A line's file is read by its writer and by each check, and its source for every line anew.
    Nobody may change what the function gives.
    """
    kept = lru_cache(maxsize=3)(make)

    @wraps(make)
    def made(read: _Read) -> _Made:
        short = read.is_short if isinstance(read, Container) else len(read) < _SHORT
        return kept(read) if short else make(read)

    return made


@by_content
def _parsed(text: str) -> Any:
    return json.loads(text, parse_constant=_no_number)


def parse(path: Path, text: str) -> dict[str, Any]:
    """The root object of a glTF 2.x document.

    Raises:
        InputError: it is none.
    """
    try:
        parsed = _parsed(text)
    except (ValueError, RecursionError) as error:
        raise unreadable(path, f"holds no JSON ({str(error)[:120]})") from error
    if not isinstance(parsed, dict):
        raise unreadable(path, "holds JSON that is not an object")
    version = (
        parsed.get("asset", {}).get("version") if isinstance(parsed.get("asset"), dict) else None
    )
    if not str(version).startswith("2."):
        raise unreadable(path, f"says asset.version {version!r}; only 2.x is known")
    return parsed
