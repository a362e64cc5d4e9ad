"""A binary USD file is refused if its table of contents leads nowhere: OpenUSD would hang."""

from __future__ import annotations

import struct
from pathlib import Path

import pytest

from animeme import registry
from animeme.errors import InputError
from support.jobs import SAMPLE
from support.patience import patience

CRATE = (SAMPLE / "crab.usdc").read_bytes()
(TABLE,) = struct.unpack_from("<q", CRATE, 16)


def put(at: int, form: str, value: int) -> bytes:
    data = bytearray(CRATE)
    struct.pack_into(form, data, at, value)
    return bytes(data)


@pytest.mark.parametrize(
    "content",
    [
        CRATE[:20],
        CRATE[: TABLE + 20],
        CRATE[:TABLE] + b"\0\0\0" + CRATE[TABLE:],
        put(16, "<q", -1),
        put(16, "<q", len(CRATE)),
        put(TABLE, "<Q", 1 << 60),
        put(TABLE + 8, "<Q", 1),
        put(TABLE + 24, "<q", len(CRATE) + 1),
        put(TABLE + 32, "<q", 1 << 62),
    ],
)
def test_tables_that_lead_nowhere(tmp_path: Path, content: bytes) -> None:
    path = tmp_path / "crab.usdc"
    path.write_bytes(content)
    with patience(), pytest.raises(InputError, match="table of contents") as caught:
        registry.format_of(path).load(path)
    assert caught.value.code == "asset-unreadable"


def test_a_sound_table(tmp_path: Path) -> None:
    (tmp_path / "crab.usdc").write_bytes(CRATE)
    assert registry.format_of(Path("a.usdc")).load(tmp_path / "crab.usdc").shapes
