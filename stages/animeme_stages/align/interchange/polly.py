"""Amazon Polly's speech marks: a JSON object per line, times in milliseconds.

A mark tells when something starts, not when it ends. A word lasts until the next word or the next
viseme of silence. Where that is missing (marks of words alone), the last word is given the median
length of the others; a recording's own length, once known, is the better bound. There is no mark
at the end.
"""

from __future__ import annotations

from collections.abc import Iterator
from statistics import median

from animeme_stages.align.interchange.source import Source, mapping, number, parse_json, string
from animeme_stages.align.interchange.timings import DamagedError, Span, Timings, words_of

_KINDS = ("word", "viseme", "sentence", "ssml")
_LONE_WORD_S = 0.3


def matches(source: Source) -> bool:
    """Whether the first line is a speech mark."""
    try:
        first = parse_json(source.first_line)
    except DamagedError:
        return False
    return isinstance(first, dict) and {"time", "type", "value"} <= first.keys()


def read(source: Source) -> Timings:
    """The words and visemes among the marks.

    Raises:
        DamagedError: a line is not a mark.
    """
    marks = [_mark(text, line) for line, text in source.lines()]
    visemes = [(time_s, label) for kind, time_s, label in marks if kind == "viseme"]
    words = [(time_s, label) for kind, time_s, label in marks if kind == "word"]
    rests = [time_s for time_s, label in visemes if label == "sil"]
    events = tuple(Span(label, time_s, time_s) for time_s, label in visemes)
    return Timings(words_of(_words(words, rests)), (), events, None, "polly")


def _mark(text: str, line: int) -> tuple[str, float, str]:
    mark = mapping(parse_json(text), f"line {line}")
    kind = string(mark.get("type"), f"the type in line {line}")
    if kind not in _KINDS:
        raise DamagedError(f"line {line}: '{kind[:40]}' is not a kind of mark")
    time_s = number(mark.get("time"), f"the time in line {line}") / 1000
    return kind, time_s, string(mark.get("value"), f"the value in line {line}")


def _words(words: list[tuple[float, str]], rests: list[float]) -> Iterator[Span]:
    lengths: list[float] = []
    pauses = iter(sorted(rests))
    pause_s = next(pauses, None)
    for index, (start_s, label) in enumerate(words):
        while pause_s is not None and pause_s <= start_s:
            pause_s = next(pauses, None)
        ends = [words[index + 1][0]] if index + 1 < len(words) else []
        ends += [pause_s] if pause_s is not None else []
        end_s = min(ends) if ends else start_s + (median(lengths) if lengths else _LONE_WORD_S)
        lengths.append(end_s - start_s)
        yield Span(label, start_s, end_s)
