"""The table of contents of a binary USD file ("crate"), looked at before OpenUSD follows it.

OpenUSD 25 and 26 loop without end on a file whose table of contents was shifted or overwritten, and
nothing in the same process can stop them. The layout is that of OpenUSD's
``pxr/usd/sdf/crateFile.h``: 8 bytes of identifier, 8 of version, the table's offset; there the
number of sections, and for each a name of 16 bytes, its start and its size, little-endian.
"""

from __future__ import annotations

import struct
from pathlib import Path
from typing import BinaryIO

from animeme.errors import InputError

_IDENTIFIER = b"PXR-USDC"
_HEAD = struct.Struct("<8s8sq")
_COUNT = struct.Struct("<Q")
_SECTION = struct.Struct("<16sqq")
# There are six kinds of sections, and room for those to come.
_MOST_SECTIONS = 64


def require_table(path: Path) -> None:
    """Make sure that the table of contents lies in the file, and its sections too.

    Files that are no crate pass: text, packages, and what OpenUSD itself refuses.

    Raises:
        InputError: ``asset-unreadable``.
    """
    size = path.stat().st_size
    with path.open("rb") as stream:
        head = stream.read(_HEAD.size)
        if not head.startswith(_IDENTIFIER):
            return
        if len(head) < _HEAD.size or not _table_fits(stream, _HEAD.unpack(head)[2], size):
            raise InputError(
                "asset-unreadable",
                "its table of contents is damaged",
                place=str(path),
                action="Export it anew, or fetch it again: it may be cut off.",
            )


def _table_fits(stream: BinaryIO, start: int, size: int) -> bool:
    """Whether `start` is a table whose sections are all within `size` bytes."""
    if not _HEAD.size <= start <= size - _COUNT.size:
        return False
    stream.seek(start)
    (count,) = _COUNT.unpack(stream.read(_COUNT.size))
    if not 0 < count <= _MOST_SECTIONS:
        return False
    table = stream.read(count * _SECTION.size)
    return len(table) == count * _SECTION.size and all(
        name.rstrip(b"\0").isalnum() and first >= _HEAD.size and 0 <= length <= size - first
        for name, first, length in _SECTION.iter_unpack(table)
    )
