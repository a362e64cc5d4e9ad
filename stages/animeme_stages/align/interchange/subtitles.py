"""WebVTT and SubRip (``.srt``): cues, whose text is a group of words between two times.

Tags are stripped; everything else in a cue is taken to be said. Neither format has a mark at the
end, so a file that lacks whole cues cannot be told; one that lacks part of a line can.
"""

from __future__ import annotations

import html
import re
from collections.abc import Iterator, Sequence
from itertools import groupby

from animeme_stages.align.interchange.source import Source
from animeme_stages.align.interchange.timings import (
    ROUNDING_S,
    DamagedError,
    Span,
    Timings,
    words_of,
)

_TIME = r"(?:(\d{{1,4}}):)?([0-5]\d):([0-5]\d){mark}(\d{{3}})"
_VTT_TIME = _TIME.format(mark=r"\.")
_SRT_TIME = _TIME.format(mark=r"[.,]")
_VTT_CUE = re.compile(rf"\s*{_VTT_TIME}\s+-->\s+{_VTT_TIME}(?:\s+.*)?")
_SRT_CUE = re.compile(rf"\s*{_SRT_TIME}\s*-->\s*{_SRT_TIME}(?:\s+.*)?")
_TAG = re.compile(r"<[^<>]*>")
_SRT_STYLE = re.compile(r"\{\\[^{}]*\}")


def matches_vtt(source: Source) -> bool:
    """Whether this starts as WebVTT does."""
    return re.match(r"WEBVTT(?=\s|$)", source.text) is not None


def read_vtt(source: Source) -> Timings:
    """The cues of a WebVTT file.

    Raises:
        DamagedError: it does not start as WebVTT does, or a block is no cue.
    """
    if not matches_vtt(source):
        raise DamagedError("it does not start with WEBVTT")
    header, *blocks = _blocks(source)
    if any("-->" in text for _, text in header):
        raise DamagedError("there is no blank line behind its header")
    cues = [block for block in blocks if not _is_aside(block[0][1])]
    return _timings([_cue(block, _VTT_CUE) for block in cues], "webvtt")


def matches_srt(source: Source) -> bool:
    """Whether this starts with a numbered cue."""
    lines = source.text.lstrip().split("\n", 2)
    return len(lines) > 1 and lines[0].strip().isdecimal() and "-->" in lines[1]


def read_srt(source: Source) -> Timings:
    """The cues of a SubRip file.

    Raises:
        DamagedError: a block is not number, times and text.
    """
    cues: list[Span] = []
    for block in _blocks(source):
        line, text = block[0]
        if not text.strip().isdecimal():
            raise DamagedError(f"line {line} is not the number of a cue")
        cues.append(_cue(block, _SRT_CUE))
    return _timings(cues, "srt")


def _blocks(source: Source) -> Iterator[list[tuple[int, str]]]:
    """Numbered lines between blank lines."""
    for _, lines in groupby(
        _counted(source.lines()), key=lambda counted: counted[0] - counted[1][0]
    ):
        yield [line for _, line in lines]


def _counted(lines: Iterator[tuple[int, str]]) -> Iterator[tuple[int, tuple[int, str]]]:
    yield from enumerate(lines)


def _is_aside(line: str) -> bool:
    return re.match(r"(NOTE|STYLE|REGION)(\s|$)", line) is not None and "-->" not in line


def _cue(block: Sequence[tuple[int, str]], pattern: re.Pattern[str]) -> Span:
    """The cue in a block, whose first line may be an identifier."""
    times = next((index for index, (_, text) in enumerate(block[:2]) if "-->" in text), None)
    if times is None:
        raise DamagedError(f"the block at line {block[0][0]} has no times")
    line, text = block[times]
    match = pattern.fullmatch(text)
    if match is None:
        raise DamagedError(f"line {line} is not a cue's times")
    if len(block) == times + 1:
        raise DamagedError(f"the cue at line {line} has no text")
    label = _spoken("\n".join(text for _, text in block[times + 1 :]), line)
    return Span(label, _seconds(match.groups()[:4]), _seconds(match.groups()[4:]))


def _spoken(text: str, line: int) -> str:
    bare = _SRT_STYLE.sub("", _TAG.sub("", text))
    if re.search(r"<[/a-z]", bare):
        raise DamagedError(f"a tag of the cue at line {line} has no end")
    return html.unescape(bare)


def _seconds(parts: Sequence[str | None]) -> float:
    hours, minutes, seconds, milliseconds = (int(part or 0) for part in parts)
    return (hours * 3_600_000 + minutes * 60_000 + seconds * 1000 + milliseconds) / 1000


def _timings(cues: Sequence[Span], source: str) -> Timings:
    return Timings(words_of(_apart(cues)), (), (), None, source)


def _apart(cues: Sequence[Span]) -> list[Span]:
    """Cues of which none is shown beside another: those that were are one.

    Both formats allow two at a time; which words are said when is then known of both together.
    """
    found: list[Span] = []
    for cue in cues:
        before = found[-1] if found else None
        if before and before.start_s <= cue.start_s < before.end_s - ROUNDING_S:
            label = f"{before.label} {cue.label}"
            found[-1] = Span(label, before.start_s, max(before.end_s, cue.end_s))
        else:
            found.append(cue)
    return found
