"""Whether a recording holds as much sound as its header says.

libsndfile takes a cut file for a shorter one; a transcript that lost its end is then stretched
over what is left, and nobody notices.
"""

from __future__ import annotations

import io
import struct
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import BinaryIO

# Lengths by which streaming writers say that they do not know.
_UNKNOWN = (0, 0xFFFFFFFF)
_OGG_PAGE = b"OggS"
_OGG_LAST = 0x04
# A page is at most 65,307 bytes (RFC 3533), so the last one begins within this.
_OGG_TAIL = 1 << 17


@dataclass(frozen=True)
class Promise:
    """How much sound a header promises.

    Attributes:
        length: bytes promised, or there are, if the header does not say.
        missing: bytes that the file ends too early by.
        patches: (offset, bytes) that make a header without length say what there is.
    """

    length: int
    missing: int
    patches: tuple[tuple[int, bytes], ...] = ()

    def repaired(self, path: Path) -> Path | BinaryIO:
        """The recording with a header that states its length."""
        if not self.patches:
            return path
        data = bytearray(path.read_bytes())
        for offset, new in self.patches:
            data[offset : offset + len(new)] = new
        return io.BytesIO(data)


def promised_sound(path: Path) -> Promise | None:
    """What the header of a WAV, RF64, AIFF or Ogg file promises; None for other formats.

    FLAC and MP3 are checked while they are decoded.
    """
    size = path.stat().st_size
    with path.open("rb") as stream:
        head = stream.read(12)
        if len(head) == 12 and head[8:] == b"WAVE" and head[:4] in (b"RIFF", b"RIFX", b"RF64"):
            return _wav(stream, head[:4], size)
        if len(head) == 12 and head[:4] == b"FORM" and head[8:] in (b"AIFF", b"AIFC"):
            return _aiff(stream, size)
        if head[:4] == _OGG_PAGE:
            return _ogg(stream, size)
    return None


def _wav(stream: BinaryIO, form: bytes, size: int) -> Promise | None:
    order = ">" if form == b"RIFX" else "<"
    long_length = 0
    for name, start, length in _chunks(stream, order, size):
        if name == b"ds64":
            stream.seek(start + 8)
            (long_length,) = struct.unpack("<Q", stream.read(8).ljust(8, b"\0"))
        if name == b"data":
            if form == b"RF64" and length == 0xFFFFFFFF:
                length = long_length
            if length in _UNKNOWN:
                there = size - start
                patch = struct.pack(f"{order}I", min(there, 0xFFFFFFFF))
                return Promise(there, 0, ((start - 4, patch),) if there and not length else ())
            return Promise(length, max(0, start + length - size))
    return None


def _aiff(stream: BinaryIO, size: int) -> Promise | None:
    for name, start, length in _chunks(stream, ">", size):
        if name == b"SSND":
            return Promise(length, max(0, start + length - size))
    return None


def _ogg(stream: BinaryIO, size: int) -> Promise:
    """Ogg states no length; its last page says that it is the last."""
    stream.seek(max(0, size - _OGG_TAIL))
    tail = stream.read()
    page = tail.rfind(_OGG_PAGE)
    flags = tail[page + 5] if 0 <= page < len(tail) - 5 else 0
    segments = tail[page + 27 : page + 27 + tail[page + 26]] if len(tail) > page + 26 else b""
    whole = flags & _OGG_LAST and page + 27 + len(segments) + sum(segments) <= len(tail)
    return Promise(size, 0 if whole else 1)


def _chunks(stream: BinaryIO, order: str, size: int) -> Iterator[tuple[bytes, int, int]]:
    """Name, offset and promised length of each chunk, up to the first that leaves the file."""
    offset = 12
    while offset + 8 <= size:
        stream.seek(offset)
        name, length = struct.unpack(f"{order}4sI", stream.read(8))
        yield name, offset + 8, length
        offset += 8 + length + length % 2
