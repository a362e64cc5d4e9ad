"""Rhubarb Lip Sync: mouth shapes A–H and X, as JSON and as tab-separated values.

Both are read as events; the second is written from phones. A TSV line is ``start shape``; the last
one tells only where the recording ends, and its shape is X (A where X is switched off).
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from itertools import pairwise

from animeme.phones import SILENCE, Phone, PhoneTrack
from animeme_stages.align.interchange.source import Source, listing, mapping, number, string
from animeme_stages.align.interchange.timings import DamagedError, Span, Timings
from animeme_stages.align.language import acoustic_phones

SHAPES = frozenset("ABCDEFGHX")

# Mouth shapes after the table in Rhubarb's manual, "Mouth shapes", with the phones it names for
# each; the rest by articulation. A diphthong goes through two shapes.
#   A closed: P B M               B clenched teeth: most consonants, EE
#   C open: EH AE                 D wide open: AA
#   E slightly rounded: AO ER     F puckered: UW OW W
#   G teeth on the lip: F V       H tongue raised: long L         X at rest
_SHAPES_OF = {
    # closed lips
    **dict.fromkeys(("P", "B", "M"), "A"),
    # lower lip at the teeth
    **dict.fromkeys(("F", "V"), "G"),
    # tongue, velum and teeth: the mouth is a little open
    **dict.fromkeys(("T", "D", "N", "K", "G", "NG", "S", "Z", "SH", "ZH", "CH", "JH"), "B"),
    **dict.fromkeys(("TH", "DH", "Y", "IY", "IH"), "B"),
    # the tongue's tip behind the upper teeth, for long enough to be seen
    "L": "H",
    # open
    **dict.fromkeys(("HH", "EH", "AE", "AH"), "C"),
    "AA": "D",
    # rounded
    **dict.fromkeys(("AO", "ER", "R", "UH"), "E"),
    **dict.fromkeys(("UW", "W"), "F"),
    # diphthongs
    "AW": "DF",
    "AY": "DB",
    "EY": "CB",
    "OW": "EF",
    "OY": "EB",
}

_CUE = re.compile(r"(\d+\.\d+)\t(\S+)")


def matches_json(source: Source) -> bool:
    """Whether this is Rhubarb's JSON."""
    return isinstance(source.json, dict) and "mouthCues" in source.json


def read_json(source: Source) -> Timings:
    """The mouth cues of Rhubarb's JSON.

    Raises:
        DamagedError: its structure is another.
    """
    root = mapping(source.json, "the top level")
    metadata = mapping(root.get("metadata", {}), "metadata")
    duration = metadata.get("duration")
    duration_s = None if duration is None else number(duration, "duration")
    events = tuple(_json_cue(cue) for cue in listing(root["mouthCues"], "mouthCues"))
    return Timings((), (), events, duration_s, "rhubarb-json")


def matches_tsv(source: Source) -> bool:
    """Whether the first line is a time and a mouth shape."""
    return _CUE.fullmatch(source.first_line) is not None


def read_tsv(source: Source) -> Timings:
    """The mouth cues of Rhubarb's TSV.

    Raises:
        DamagedError: a line is not a cue, or the last is not the closing one.
    """
    marks = [_tsv_mark(text, line) for line, text in source.lines()]
    if len(marks) < 2 or marks[-1][1] not in "XA":
        raise DamagedError("its last line is not the closing mouth shape")
    for (before_s, _), (after_s, _) in pairwise(marks):
        if before_s >= after_s:
            raise DamagedError(f"{after_s} s does not follow {before_s} s")
    events = [Span(shape, start_s, end_s) for (start_s, shape), (end_s, _) in pairwise(marks)]
    return Timings((), (), tuple(events), marks[-1][0], "rhubarb-tsv")


def write_tsv(track: PhoneTrack, name: str) -> str:
    """The mouth shapes of `track`, to the hundredth of a second that Rhubarb uses."""
    cues: list[tuple[int, str]] = []
    for start_s, shape in _cues(track):
        hundredths = round(start_s * 100)
        if cues and cues[-1][0] == hundredths:  # shorter than can be written
            cues.pop()
        if not cues or cues[-1][1] != shape:
            cues.append((hundredths, shape))
    end = max(round(track.duration_s * 100), cues[-1][0] + 1)
    return "".join(f"{time / 100:.2f}\t{shape}\n" for time, shape in [*cues, (end, "X")])


def shapes_of(symbol: str) -> str:
    """The mouth shapes that a phone goes through.

    Args:
        symbol: ARPAbet, IPA that the acoustic map knows, or `SILENCE`.

    Example:
        >>> shapes_of("M"), shapes_of("OW"), shapes_of("ts"), shapes_of("sil")
        ('A', 'EF', 'B', 'X')
    """
    if symbol == SILENCE:
        return "X"
    acoustic = (symbol,) if symbol in _SHAPES_OF else acoustic_phones(symbol)
    shapes = "".join(_SHAPES_OF[phone] for phone in acoustic)
    return re.sub(r"(.)\1+", r"\1", shapes)


def _cues(track: PhoneTrack) -> Iterator[tuple[float, str]]:
    for phone in track.phones:
        shapes = _shapes_or_rest(phone)
        for index, shape in enumerate(shapes):
            yield phone.start_s + phone.duration_s * index / len(shapes), shape


def _shapes_or_rest(phone: Phone) -> str:
    try:
        return shapes_of(phone.symbol)
    except KeyError:  # a sound without counterpart: slightly open, as most are
        return "B"


def _json_cue(cue: object) -> Span:
    members = mapping(cue, "a cue")
    shape = string(members.get("value"), "a cue's value")
    start_s = number(members.get("start"), "a cue's start")
    return Span(_shape(shape), start_s, number(members.get("end"), "a cue's end"))


def _tsv_mark(text: str, line: int) -> tuple[float, str]:
    match = _CUE.fullmatch(text.rstrip())
    if match is None:
        raise DamagedError(f"line {line} is not a time, a tab and a mouth shape")
    return number(match[1], "a time"), _shape(match[2])


def _shape(shape: str) -> str:
    if shape not in SHAPES:
        raise DamagedError(f"'{shape[:40]}' is not a mouth shape")
    return shape
