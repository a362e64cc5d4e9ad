"""HTK label files (``.lab``): ``start end label …`` per line, in 100 ns units or in seconds.

Integers are 100 ns units, as the HTK Book has them; a decimal point anywhere means seconds, as
Festival and HTS tools write. A word stands behind the first phone it covers, in a fourth or fifth
column (HTK Book 3.4, section 6.2). There is no mark at the end.
"""

from __future__ import annotations

import re

from animeme_stages.align.interchange.source import Source, number
from animeme_stages.align.interchange.symbols import SILENCES, looks_phonetic
from animeme_stages.align.interchange.timings import DamagedError, Span, Timings, words_of

_UNIT_S = 1e-7
_LINE = re.compile(r"\s*(\d+(?:\.\d+)?)\s+(\d+(?:\.\d+)?)\s+(\S+)((?:\s+\S+)*)\s*")
_SHORTEST_S = 0.001  # no label ends earlier
_MAIN = "#!MLF!#"


def matches(source: Source) -> bool:
    """Whether the first line is times and a label, rather than a transcript like "2 4 six"."""
    if source.first_line == _MAIN:
        return True
    match = _LINE.fullmatch(source.first_line)
    if match is None:
        return False
    seconds = "." in match[1] or "." in match[2]
    return seconds or float(match[2]) * _UNIT_S >= _SHORTEST_S


def read(source: Source) -> Timings:
    """The phones of a label file, with the words beside them; or its words.

    Raises:
        DamagedError: a line is not times and a label.
    """
    if source.first_line == _MAIN:
        raise DamagedError("it is a master label file; split it into one file per recording")
    rows = [_fields(text, line) for line, text in source.lines()]
    scale = 1.0 if any("." in time for row in rows for time in row[:2]) else _UNIT_S
    spans = [Span(row[2], _time(row[0], scale), _time(row[1], scale)) for row in rows]
    extras = [row[3] for row in rows]
    if any(extras):
        return Timings(_words(spans, extras), tuple(spans), (), None, "htk")
    if looks_phonetic(spans):
        return Timings((), tuple(spans), (), None, "htk")
    return Timings(words_of(spans), (), (), None, "htk")


def _fields(text: str, line: int) -> tuple[str, str, str, str]:
    match = _LINE.fullmatch(text)
    if match is None:
        raise DamagedError(f"line {line} is not `start end label`")
    # A score may stand between the label and the word.
    extra = [field for field in match[4].split() if not re.fullmatch(r"-?\d+(\.\d+)?", field)]
    return match[1], match[2], match[3], " ".join(extra)


def _time(text: str, scale: float) -> float:
    # Rounded to the unit, so that 1 300 000 is 0.13 and not 0.13 less a bit.
    return round(number(text, "a time") * scale, 7)


def _words(spans: list[Span], extras: list[str]) -> tuple[Span, ...]:
    """Words from the column beside the phones: each lasts until the next."""
    words: list[Span] = []
    for span, extra in zip(spans, extras, strict=True):
        if extra:
            words.append(Span(extra, span.start_s, span.end_s))
        elif words and span.label.lower() not in SILENCES:
            words[-1] = words[-1]._replace(end_s=span.end_s)
    return words_of(words)
