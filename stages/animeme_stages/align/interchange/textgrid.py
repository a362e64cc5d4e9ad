"""Praat TextGrid, long and short, read by Praat's own rule, and written in the long form.

The rule (Praat manual, "TextGrid file formats"): numbers, quoted strings and flags that stand free
are data; everything else is comment. So one reader takes both forms. Every list's declared size
must be met, and nothing may follow.
"""

from __future__ import annotations

import re
from collections.abc import Iterator

from animeme.phones import SILENCE, Event, Phone, PhoneTrack, Word
from animeme_stages.align.interchange.source import Source, number
from animeme_stages.align.interchange.tiers import TAG_TIER, Tier, timings_of
from animeme_stages.align.interchange.timings import ROUNDING_S, DamagedError, Span, Timings

# Possessive throughout: no text, however odd, is scanned twice.
_TOKEN = re.compile(
    r"""(?P<string>"[^"]*+(?:""[^"]*+)*+"(?!\S))"""
    r"""|(?P<open>")"""
    r"""|(?P<comment>![^\n]*)"""
    r"""|(?P<flag><\w+>(?!\S))"""
    r"""|(?P<number>[-+]?+(?:\d++(?:\.\d*+)?+|\.\d++)(?:[eE][-+]?\d++)?+(?!\S))"""
    r"""|(?P<other>\S+)"""
)


def matches(source: Source) -> bool:
    """Whether this is a TextGrid, going by its first line."""
    return "ooTextFile" in source.first_line or "ooBinaryFile" in source.first_line


def read(source: Source) -> Timings:
    """The words and phones of a TextGrid; see `tiers` for which tiers these are.

    Raises:
        DamagedError: it is incomplete, binary, or does not start at 0 s.
    """
    if "ooBinaryFile" in source.first_line:
        raise DamagedError("it is a binary TextGrid; save it as a text file in Praat")
    tokens = _Tokens(source.text)
    if not tokens.string().startswith("ooTextFile") or tokens.string() != "TextGrid":
        raise DamagedError("it does not start as a TextGrid does")
    start_s, end_s = tokens.number(), tokens.number()
    if abs(start_s) > ROUNDING_S:
        raise DamagedError(f"its xmin is {start_s} s, not 0; shift its times to zero in Praat")
    tiers = tuple(_tiers(tokens)) if tokens.flag() == "<exists>" else ()
    tokens.require_end()
    _require_within(tiers, end_s)
    return timings_of(tiers, end_s, "textgrid")


def write(track: PhoneTrack, name: str) -> str:
    """`track` in the long form: tiers of words, phones and, as points, of tags.

    Tiers of words and tags are left out where there are none. Pauses are empty intervals, as Praat
    and MFA have them. Times keep every digit.
    """
    duration_s = track.duration_s
    tiers = [("phones", [_interval(phone) for phone in track.phones])]
    if track.words:
        tiers.insert(0, ("words", _filled(track.words, duration_s)))
    lines = ['File type = "ooTextFile"', 'Object class = "TextGrid"', ""]
    size = len(tiers) + bool(track.events)
    lines += ["xmin = 0", f"xmax = {duration_s!r}", "tiers? <exists>", f"size = {size}"]
    lines.append("item []:")
    for index, (tier, spans) in enumerate(tiers, start=1):
        lines += _tier_lines(index, tier, spans, duration_s)
    if track.events:
        lines += _point_lines(size, _moments(track.events), duration_s)
    return "\n".join(lines) + "\n"


class _Tokens:
    """The data of a TextGrid, one after the other, lazily."""

    def __init__(self, text: str) -> None:
        self._found: Iterator[re.Match[str]] = _TOKEN.finditer(text)

    def string(self) -> str:
        return self._next("string")[1:-1].replace('""', '"')

    def number(self) -> float:
        return number(self._next("number"), "a number")

    def flag(self) -> str:
        return self._next("flag")

    def count(self) -> int:
        value = self._next("number")
        if not value.isdecimal() or len(value) > 9:
            raise DamagedError(f"{value} is not the size of a list")
        return int(value)

    def require_end(self) -> None:
        if (token := self._data()) is not None:
            raise DamagedError(f"more follows than its sizes tell (at character {token.start()})")

    def _next(self, kind: str) -> str:
        token = self._data()
        if token is None:
            raise DamagedError(f"it ends where a {kind} should be")
        if token.lastgroup != kind:
            raise DamagedError(f"character {token.start()}: {token[0][:40]!r} is not a {kind}")
        return token[0]

    def _data(self) -> re.Match[str] | None:
        for token in self._found:
            if token.lastgroup == "open":
                raise DamagedError(f"the text at character {token.start()} has no end")
            if token.lastgroup not in ("comment", "other"):
                return token
        return None


def _tiers(tokens: _Tokens) -> Iterator[Tier]:
    for _ in range(tokens.count()):
        kind, name = tokens.string(), tokens.string()
        if kind not in ("IntervalTier", "TextTier"):
            raise DamagedError(f"'{kind[:40]}' is not a kind of tier")
        tokens.number()
        tokens.number()
        points = kind == "TextTier"
        yield Tier(name, tuple(_spans(tokens, points=points)), points)


def _spans(tokens: _Tokens, *, points: bool) -> Iterator[Span]:
    for _ in range(tokens.count()):
        start_s = tokens.number()
        end_s = start_s if points else tokens.number()
        yield Span(tokens.string(), start_s, end_s)


def _require_within(tiers: tuple[Tier, ...], end_s: float) -> None:
    """Every tier's times are in the file's, in order; also the tiers that nobody will read."""
    for tier in tiers:
        cursor_s = 0.0
        for span in tier.spans:
            if not cursor_s - ROUNDING_S <= span.start_s <= span.end_s <= end_s + ROUNDING_S:
                raise DamagedError(f"tier '{tier.name[:40]}': {span.start_s} s is out of order")
            cursor_s = span.end_s


def _interval(phone: Phone) -> Span:
    return Span("" if phone.symbol == SILENCE else phone.symbol, phone.start_s, phone.end_s)


def _filled(words: tuple[Word, ...], duration_s: float) -> list[Span]:
    """Words with empty intervals between, as Praat wants them."""
    spans: list[Span] = []
    cursor_s = 0.0
    for word in words:
        if word.start_s > cursor_s:
            spans.append(Span("", cursor_s, word.start_s))
        spans.append(Span(word.text, word.start_s, word.end_s))
        cursor_s = word.end_s
    if cursor_s < duration_s:
        spans.append(Span("", cursor_s, duration_s))
    return spans


def _moments(events: tuple[Event, ...]) -> list[tuple[float, str]]:
    """Time and label of each point: Praat has no two points of a tier at one time."""
    labels: dict[float, list[str]] = {}
    for event in events:
        labels.setdefault(event.time_s, []).append(event.tag)
    return [(time_s, "\n".join(tags)) for time_s, tags in labels.items()]


def _point_lines(index: int, points: list[tuple[float, str]], duration_s: float) -> list[str]:
    lines = [
        f"    item [{index}]:",
        '        class = "TextTier"',
        f'        name = "{TAG_TIER}"',
        "        xmin = 0",
        f"        xmax = {duration_s!r}",
        f"        points: size = {len(points)}",
    ]
    for number_, (time_s, label) in enumerate(points, start=1):
        quoted = label.replace('"', '""')
        lines += [
            f"        points [{number_}]:",
            f"            number = {time_s!r}",
            f'            mark = "{quoted}"',
        ]
    return lines


def _tier_lines(index: int, name: str, spans: list[Span], duration_s: float) -> list[str]:
    lines = [
        f"    item [{index}]:",
        '        class = "IntervalTier"',
        f'        name = "{name}"',
        "        xmin = 0",
        f"        xmax = {duration_s!r}",
        f"        intervals: size = {len(spans)}",
    ]
    for number_, span in enumerate(spans, start=1):
        label = span.label.replace('"', '""')
        lines += [
            f"        intervals [{number_}]:",
            f"            xmin = {span.start_s!r}",
            f"            xmax = {span.end_s!r}",
            f'            text = "{label}"',
        ]
    return lines
