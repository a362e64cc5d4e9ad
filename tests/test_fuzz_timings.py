"""Damaged timing files: flipped, cut, doubled and spliced; read, or refused with `InputError`.

`test_interchange_damage` says what must be refused; here it is only about surviving it, at little
cost in memory.
"""

from __future__ import annotations

import random
import tracemalloc
from contextlib import suppress
from pathlib import Path

import pytest

from animeme.errors import InputError
from animeme_stages.align.interchange import FORMATS, anchors, kind_of, read_timings, track_from
from support.timing_files import FOLDER, NAMES

SEED = 17
# A mutated file may promise millions of entries; its reader must not make room for them.
LARGEST_GROWTH_BYTES = 24 * 2**20

GOOD: dict[str, bytes] = {name: (FOLDER / name).read_bytes() for name in NAMES}
SUFFIXES = sorted({suffix for form in FORMATS.values() for suffix in form.suffixes})


def _flipped(data: bytearray, chance: random.Random) -> None:
    for _ in range(chance.choice((1, 2, 8, 64))):
        data[chance.randrange(len(data))] ^= 1 << chance.randrange(8)


def _cut(data: bytearray, chance: random.Random) -> None:
    start = chance.randrange(len(data))
    del data[start : chance.choice((len(data), start + chance.randrange(1, 400)))]


def _inserted(data: bytearray, chance: random.Random) -> None:
    """Noise, or another part of the same file."""
    at = chance.randrange(len(data) + 1)
    if chance.random() < 0.5:
        data[at:at] = chance.randbytes(chance.choice((1, 4, 50)))
    else:
        start = chance.randrange(len(data))
        data[at:at] = data[start : start + chance.randrange(1, 500)]


def _swapped(data: bytearray, chance: random.Random) -> None:
    """Two parts of equal length change places."""
    length = chance.choice((1, 2, 10, 60))
    if len(data) > 2 * length:
        a = chance.randrange(len(data) - 2 * length)
        b = chance.randrange(a + length, len(data) - length + 1)
        data[a : a + length], data[b : b + length] = data[b : b + length], data[a : a + length]


def _spliced(data: bytearray, chance: random.Random) -> None:
    """The end of a file of any format."""
    other = chance.choice(list(GOOD.values()))
    data[chance.randrange(len(data)) :] = other[chance.randrange(len(other)) :]


def _numbers(data: bytearray, chance: random.Random) -> None:
    """A digit becomes another number, so that the form stays whole."""
    for _ in range(chance.choice((1, 3))):
        digits = [index for index, byte in enumerate(data) if 48 <= byte < 58]
        if digits:
            at = chance.choice(digits)
            new = (b"9", b"0", b"-1", b"1e308", b"1e-320", b"99999999999", b".", b"0x1")
            data[at : at + 1] = chance.choice(new)


KINDS = (_flipped, _cut, _inserted, _swapped, _spliced, _numbers)


def mutated(name: str, chance: random.Random) -> bytes:
    data = bytearray(GOOD[name])
    for _ in range(chance.choice((1, 1, 1, 2, 4))):
        if data:
            chance.choice(KINDS)(data, chance)
    return bytes(data)


def use(path: Path, chance: random.Random) -> str:
    """What became of a file: "read", or the code of its refusal."""
    with suppress(InputError):
        kind_of(path)
    try:
        timings = read_timings(path)
    except InputError as error:
        return error.code
    duration_s = chance.choice((0.1, 1.2, timings.end_s or 1.0, 3600.0))
    with suppress(InputError):
        found = anchors(timings, duration_s=duration_s)
        assert all(0.0 <= span.start_s < span.end_s <= duration_s for span in found)
    for inventory in (None, "ipa", "arpabet"):
        try:
            track = track_from(timings, language="en", inventory=inventory, duration_s=duration_s)
        except InputError:
            continue
        assert track.duration_s == duration_s
        for form in FORMATS.values():
            if form.write:
                form.write(track, "fuzz").encode()
    return "read"


def run(folder: Path, name: str, seed: str, count: int) -> set[str]:
    chance = random.Random(f"{seed}-{name}")
    outcomes = set()
    for _ in range(count):
        # Mostly under its own name, sometimes as if it were of another format.
        suffix = chance.choice((Path(name).suffix,) * 4 + (chance.choice(SUFFIXES), ".txt"))
        path = folder / f"{Path(name).stem}{suffix}"  # CTM looks for it in the file
        path.write_bytes(mutated(name, chance))
        outcomes.add(use(path, chance))
    return outcomes


@pytest.mark.parametrize("name", NAMES)
def test_damaged_files_are_read_or_refused(name: str, tmp_path: Path) -> None:
    assert "timings-damaged" in run(tmp_path, name, f"{SEED}", 25)


@pytest.mark.slow
@pytest.mark.parametrize("name", NAMES)
def test_many_damaged_files_are_read_or_refused(name: str, tmp_path: Path) -> None:
    assert {"timings-damaged", "read"} <= run(tmp_path, name, f"slow-{SEED}", 600)


@pytest.mark.parametrize("name", NAMES)
def test_damage_costs_no_memory(name: str, tmp_path: Path) -> None:
    read_timings(FOLDER / name)  # what is loaded but once
    tracemalloc.start()
    try:
        run(tmp_path, name, f"memory-{SEED}", 8)
        _, peak_bytes = tracemalloc.get_traced_memory()
    finally:
        tracemalloc.stop()
    assert peak_bytes < LARGEST_GROWTH_BYTES
