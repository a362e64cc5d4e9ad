"""`Timings`: what somebody else found out about when things are said."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import NamedTuple

ROUNDING_S = 0.001
"""Seconds by which neighbours may overlap, or times leave the file: writers round to this."""


class DamagedError(ValueError):
    """A file is not what its format promises; the message says what, without the file's name."""


class Span(NamedTuple):
    """Something that is said or seen.

    Attributes:
        label: a word or words, a phone's symbol, or a viseme's name.
        start_s, end_s: seconds from the start of the recording; equal for an event at one moment.
    """

    label: str
    start_s: float
    end_s: float


@dataclass(frozen=True)
class Timings:
    """The timings of one recording, as a file tells them.

    Overlaps of neighbours up to `ROUNDING_S` are settled at construction: the later one gives way.

    Attributes:
        words: words, or groups of words where the source knows no better; pauses are left out.
        phones: symbols as the source spells them, its pauses included; () where it has none.
        events: visemes, with their lengths or as moments; () where the source has none.
        duration_s: length of the recording in seconds, None where the source does not tell.
        source: name of the format, a key of `FORMATS`.
        tags: a transcript's inline tags as moments; () where the source has none.

    Raises:
        DamagedError: a time is not finite or negative, order is broken, or neighbours overlap.
    """

    words: tuple[Span, ...]
    phones: tuple[Span, ...]
    events: tuple[Span, ...]
    duration_s: float | None
    source: str
    tags: tuple[Span, ...] = ()

    def __post_init__(self) -> None:
        if self.duration_s is not None and not 0.0 < self.duration_s < math.inf:
            raise DamagedError(f"its length is {self.duration_s} s")
        limit_s = math.inf if self.duration_s is None else self.duration_s
        for tier in ("words", "phones"):
            settled = _settled(getattr(self, tier), limit_s, tier)
            object.__setattr__(self, tier, settled)
        for tier in ("events", "tags"):
            settled = _settled_events(getattr(self, tier), limit_s, tier)
            object.__setattr__(self, tier, settled)
        if not (self.words or self.phones or self.events):
            raise DamagedError("it holds no word, phone or viseme")

    @property
    def end_s(self) -> float:
        """Where the last word, phone or event ends, in seconds."""
        return max(span.end_s for span in (*self.words, *self.phones, *self.events))


def words_of(spans: Iterable[Span]) -> tuple[Span, ...]:
    """`spans` without pauses, white space in their labels made single spaces."""
    tidy = (span._replace(label=" ".join(span.label.split())) for span in spans)
    return tuple(span for span in tidy if span.label.lower() not in WORD_SILENCES)


WORD_SILENCES = frozenset(
    {"", "sil", "sp", "spn", "pau", "h#", "<eps>", "<sil>", "<s>", "</s>", "<p:>", "!sil"}
)
"""What aligners write for a pause among words, in lower case; nothing that is a word as well."""


def _settled(spans: Sequence[Span], limit_s: float, tier: str) -> tuple[Span, ...]:
    settled: list[Span] = []
    cursor_s = 0.0
    for span in spans:
        _require_sound(span, limit_s, tier)
        if span.start_s < cursor_s - ROUNDING_S:
            where = f"'{settled[-1].label:.40}'" if settled else "the start"
            raise DamagedError(f"{tier}: '{span.label:.40}' at {span.start_s} s overlaps {where}")
        start_s, end_s = max(span.start_s, cursor_s), min(span.end_s, limit_s)
        if not start_s < end_s:
            raise DamagedError(f"{tier}: '{span.label:.40}' at {span.start_s} s has no length")
        settled.append(Span(span.label, start_s, end_s))
        cursor_s = end_s
    return tuple(settled)


def _settled_events(spans: Sequence[Span], limit_s: float, tier: str) -> tuple[Span, ...]:
    settled: list[Span] = []
    cursor_s = 0.0
    for span in spans:
        _require_sound(span, limit_s, tier)
        if span.start_s < cursor_s or span.end_s < span.start_s:
            raise DamagedError(f"{tier}: '{span.label:.40}' at {span.start_s} s is out of order")
        settled.append(span)
        cursor_s = span.start_s
    return tuple(settled)


def _require_sound(span: Span, limit_s: float, tier: str) -> None:
    if not (math.isfinite(span.start_s) and math.isfinite(span.end_s)):
        raise DamagedError(f"{tier}: '{span.label:.40}' has a time that is not a number")
    if span.start_s < -ROUNDING_S or span.end_s > limit_s + ROUNDING_S:
        raise DamagedError(
            f"{tier}: '{span.label:.40}' ({span.start_s} to {span.end_s} s) leaves the recording"
        )
    if any("\ud800" <= character <= "\udfff" for character in span.label):
        raise DamagedError(f"{tier}: the label at {span.start_s} s is not Unicode text")
