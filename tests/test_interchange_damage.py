"""Half a file is never read; no content whatever raises anything but `InputError`."""

from __future__ import annotations

import random
from contextlib import suppress
from pathlib import Path

import pytest

from animeme.errors import InputError
from animeme_stages.align.interchange import (
    FORMATS,
    Timings,
    anchors,
    read_timings,
    track_from,
)
from support.timing_files import FOLDER, NAMES, expected, open_ended, same

CUTS = 60
MUTATIONS_PER_FILE = 130
SEED = 3

# What writers and disks do to files, and what attackers would like to.
SPLICES: tuple[bytes, ...] = (
    b"", b"\0", b"\xff", b"\xfe\xff", b'"', b'""', b"<", b">", b"&e;", b"<!DOCTYPE x [", b"-->",
    b"{", b"}", b"[", b"]", b"[" * 3000, b",", b":", b"\n", b"\n\n", b"\r", b"\t", b"-", b"-1",
    b"0", b"9" * 400, b"1e999", b"1e-999", b"NaN", b"Infinity", b"null", b"true", b'"\\ud800"',
    b"1_0", b".", b"999999999", b"\xe2\x80\xae", b"\xd9\xa3", b"\xc2\xb2", b"<exists>", b"sil",
    b"!", b" ", b"size = 4",
)  # fmt: skip


def _outcome(path: Path) -> Timings | str:
    """The timings in a file, or the code of its refusal."""
    try:
        return read_timings(path)
    except InputError as error:
        return error.code


def _is_beginning(part: Timings, whole: Timings) -> bool:
    """Whether `part` holds the first lines of `whole`, none of them altered.

    The last word of a part may lack a second line of its text, or be as long as those before it.
    """
    ends = max(0, len(part.words) - 1)
    return (
        part.words[:ends] == whole.words[:ends]
        and [w.start_s for w in part.words] == [w.start_s for w in whole.words[: len(part.words)]]
        and all(
            mine.label == theirs.label or theirs.label.startswith(f"{mine.label} ")
            for mine, theirs in zip(part.words, whole.words, strict=False)
        )
        and part.phones == whole.phones[: len(part.phones)]
        and part.events == whole.events[: len(part.events)]
    )


@pytest.mark.parametrize("name", ["mary", "bobby_phones", "bobby_words"])
def test_a_real_textgrid_cut_short_is_refused(name: str, shared: Path, tmp_path: Path) -> None:
    original = shared / "data" / "phone-labels" / f"{name}.TextGrid"
    data = original.read_bytes()
    whole = read_timings(original)
    path = tmp_path / original.name
    for cut in range(len(data)):
        path.write_bytes(data[:cut])
        outcome = _outcome(path)
        if data[cut:].strip():
            assert outcome == "timings-damaged", cut
        else:
            assert outcome == whole, cut


@pytest.mark.parametrize("name", NAMES)
def test_a_file_cut_short_is_refused(name: str, tmp_path: Path) -> None:
    data = (FOLDER / name).read_bytes()
    whole = read_timings(FOLDER / name)
    path = tmp_path / name
    ends = [index + 1 for index, byte in enumerate(data[:-1]) if byte == ord("\n")]
    cuts = {len(data) * index // CUTS for index in range(CUTS)} | {*ends}
    for cut in sorted(cuts | set(range(len(data) - 40, len(data)))):
        path.write_bytes(data[:cut])
        outcome = _outcome(path)
        if isinstance(outcome, Timings):
            nothing_lost = not data[cut:].strip(b"\r\n\t \0")
            if open_ended(name) and not nothing_lost:
                assert {data[cut - 1 : cut], data[cut : cut + 1]} & {b"\n", b"\r"}, cut
                assert _is_beginning(outcome, whole), cut
            else:
                assert nothing_lost, cut
                assert same(outcome, expected(name)), cut
        else:
            assert outcome == "timings-damaged", cut


def _mutated(data: bytes, chance: random.Random) -> bytes:
    result = bytearray(data)
    for _ in range(chance.choice((1, 1, 1, 2, 5))):
        start = chance.randrange(len(result) + 1)
        end = min(len(result), start + chance.choice((0, 1, 1, 2, 8, 100)))
        kind = chance.randrange(4)
        if kind == 0 and start < len(result):
            result[start] ^= 1 << chance.randrange(8)
        elif kind == 1:
            result[start:end] = chance.choice(SPLICES)
        elif kind == 2:
            result[start:start] = result[start:end]
        else:
            del result[start:end]
    return bytes(result)


def _use(timings: Timings, name: str) -> None:
    """Do with `timings` all that can be done."""
    for duration_s in (1.2, timings.duration_s or timings.end_s or 1.0):
        with suppress(InputError):
            anchors(timings, duration_s=duration_s)
        try:
            track = track_from(timings, language="en", duration_s=duration_s)
        except InputError:
            continue
        for form in FORMATS.values():
            if form.write:
                form.write(track, name).encode()


@pytest.mark.parametrize("name", NAMES)
def test_no_mutation_raises_anything_but_input_errors(name: str, tmp_path: Path) -> None:
    chance = random.Random(f"{SEED}-{name}")
    data = (FOLDER / name).read_bytes()
    path = tmp_path / name
    for _ in range(MUTATIONS_PER_FILE):
        path.write_bytes(_mutated(data, chance))
        outcome = _outcome(path)
        if isinstance(outcome, Timings):
            _use(outcome, name)


def test_noise_is_refused(tmp_path: Path) -> None:
    chance = random.Random(SEED)
    suffixes = sorted({Path(name).suffix for name in NAMES} | {".txt"})
    for index in range(400):
        path = tmp_path / f"noise{suffixes[index % len(suffixes)]}"
        path.write_bytes(chance.randbytes(chance.randrange(300)))
        assert isinstance(_outcome(path), str)


# Content that would take quadratic time, or memory without bound, if it were read naively.
HOSTILE: dict[str, tuple[str, str]] = {
    "digits": ("a.TextGrid", '"ooTextFile" "TextGrid" 0 ' + "9" * 2_000_000 + "x"),
    "quotes": ("a.TextGrid", '"ooTextFile" "TextGrid"' + '"' * 2_000_001),
    "promised": ("a.TextGrid", '"ooTextFile" "TextGrid" 0 1 <exists> 999999999'),
    "tiers": (
        "a.TextGrid",
        '"ooTextFile" "TextGrid" 0 1 <exists> 50000 '
        + '"IntervalTier" "phones" 0 1 1 0 1 "a" ' * 50_000,
    ),
    "long label": (
        "a.TextGrid",
        '"ooTextFile" "TextGrid" 0 1 <exists> 1 "IntervalTier" "x" 0 1 1 0 1 "' + "a" * 10**6 + '"',
    ),
    "untimed": ("a.json", '{"word_segments": [' + '{"word": "a"},' * 200_000 + '{"word": "b"}]}'),
    "spaces": ("a.lab", "1 2" + " " * 2_000_000 + "\n"),
    "markup": ("a.srt", "1\n00:00:00,000 --> 00:00:01,000\n" + "<{\\" * 500_000 + "\n"),
    "attributes": ("a.eaf", "<ANNOTATION_DOCUMENT " + 'a="" ' * 100_000),
}


@pytest.mark.parametrize("case", HOSTILE)
def test_hostile_content_ends_soon(case: str, tmp_path: Path) -> None:
    name, text = HOSTILE[case]
    path = tmp_path / name
    path.write_text(text, encoding="utf-8")
    outcome = _outcome(path)  # that this returns is the test
    if isinstance(outcome, Timings):
        _use(outcome, name)
