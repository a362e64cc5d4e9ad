"""Writing GLBs in pieces, so that memory does not grow with the asset."""

from __future__ import annotations

import os
import struct
import zlib
from collections.abc import Callable, Iterable, Iterator
from contextlib import suppress
from functools import partial
from pathlib import Path
from typing import BinaryIO

from animeme.errors import InputError
from animeme_stages.ingest.glb import Chunk, Container, unreadable

_PIECE = 1 << 20
_JSON = struct.unpack("<I", b"JSON")[0]
_BIN = struct.unpack("<I", b"BIN\0")[0]
LARGEST = 0xFFFFFFFF  # a GLB's length is 32 bits


def write_glb(
    stream: BinaryIO,
    container: Container,
    text: str,
    data: bytes,
    *,
    old: Iterable[bytes] | None = None,
) -> None:
    """Write `container` with another JSON, and with `data` behind its binary chunk.

    Args:
        stream: a file.
        container: the asset.
        text: the JSON.
        data: what comes behind its binary chunk.
        old: its binary chunk, if that is at hand; else it is copied from the file.

    Raises:
        InputError: a GLB cannot be that large.
    """
    encoded = text.encode("utf-8")
    encoded += b" " * (-len(encoded) % 4)
    binary = container.bin
    others = [chunk for chunk in container.chunks if chunk is not binary]
    bin_length = (binary.length if binary else 0) + len(data) if binary or data else None
    total = 20 + len(encoded) + sum(8 + chunk.length for chunk in others)
    total += 8 + bin_length if bin_length is not None else 0
    if total > LARGEST:
        raise InputError(
            "asset-too-large",
            "would pass 4 GiB, the most a GLB can hold",
            place=str(container.path),
            action='Use layout = "per-line".',
        )
    stream.write(struct.pack("<4sII", b"glTF", 2, total))
    stream.write(struct.pack("<II", len(encoded), _JSON) + encoded)
    with container.path.open("rb") as source:
        if bin_length is not None:
            stream.write(struct.pack("<II", bin_length, _BIN))
            if old is not None:
                stream.writelines(old)
            elif binary:
                _copy(source, stream, binary)
            stream.write(data)
        for chunk in others:
            stream.write(struct.pack("<II", chunk.length, chunk.kind))
            _copy(source, stream, chunk)


def pack_glb(text: str, data: bytes) -> bytes:
    """A GLB of a JSON text and, unless it is empty, a binary chunk."""
    encoded = text.encode("utf-8")
    chunks = [(_JSON, encoded + b" " * (-len(encoded) % 4))]
    chunks += [(_BIN, data + bytes(-len(data) % 4))] if data else []
    body = b"".join(struct.pack("<II", len(part), kind) + part for kind, part in chunks)
    return struct.pack("<4sII", b"glTF", 2, 12 + len(body)) + body


def restore(stream: BinaryIO, container: Container) -> None:
    """Write the file that `container` was read from."""
    stream.write(_head(container))
    with container.path.open("rb") as source:
        for chunk in container.chunks:
            stream.write(struct.pack("<II", chunk.length, chunk.kind))
            _copy(source, stream, chunk)


def stored(container: Container) -> Iterator[bytes]:
    """The file that `container` was read from, in pieces."""
    yield _head(container)
    with container.path.open("rb") as source:
        for chunk in container.chunks:
            yield struct.pack("<II", chunk.length, chunk.kind)
            yield from pieces(source, chunk)


def _head(container: Container) -> bytes:
    """What a file begins with: header and JSON as they were."""
    encoded = container.text.encode("utf-8").ljust(container.json_bytes, b"\0")
    if not container.binary:
        return encoded
    total = 20 + len(encoded) + sum(8 + chunk.length for chunk in container.chunks)
    return struct.pack("<4sIIII", b"glTF", 2, total, len(encoded), _JSON) + encoded


def pieces(source: BinaryIO, chunk: Chunk) -> Iterator[bytes]:
    """The data of a chunk.

    Raises:
        InputError: the file ends before it does.
    """
    for start in range(chunk.start, chunk.start + chunk.length, _PIECE):
        source.seek(start)
        size = min(_PIECE, chunk.start + chunk.length - start)
        piece = source.read(size)
        if len(piece) < size:
            raise unreadable(Path(source.name), "was cut off while it was read")
        yield piece


def checksum(parts: Iterator[bytes]) -> int:
    """CRC-32: enough to notice an edit, and quicker than reading the file."""
    crc = 0
    for part in parts:
        crc = zlib.crc32(part, crc)
    return crc


def checksum_of(path: Path) -> int:
    """CRC-32 of a file."""
    with path.open("rb") as stream:
        read: Callable[[], bytes] = partial(stream.read, _PIECE)
        return checksum(iter(read, b""))


def _copy(source: BinaryIO, stream: BinaryIO, chunk: Chunk) -> None:
    """Copy a chunk's data, within the kernel where that is possible."""
    stream.flush()
    done = 0
    with suppress(AttributeError, OSError):  # not on every system, not between all file systems
        while done < chunk.length:
            copied = os.copy_file_range(
                source.fileno(), stream.fileno(), chunk.length - done, chunk.start + done
            )
            if not copied:
                break
            done += copied
    stream.seek(0, os.SEEK_END)
    for piece in pieces(source, Chunk(chunk.kind, chunk.start + done, chunk.length - done)):
        stream.write(piece)
