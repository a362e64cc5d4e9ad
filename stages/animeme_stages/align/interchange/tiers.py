"""Which of a file's tiers holds the words, and which the phones.

Names first, as aligners and annotators use them; content where names do not tell.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

from animeme_stages.align.interchange.symbols import looks_phonetic
from animeme_stages.align.interchange.timings import DamagedError, Span, Timings, words_of

# Praat's and ELAN's users, MFA, WebMAUS (ORT, KAN, MAU), TIMIT (wrd, phn).
WORD_NAMES = ("words", "word", "ort-mau", "ort", "kan", "wrd", "orthography", "tokens")
PHONE_NAMES = ("phones", "phone", "mau", "phonemes", "phoneme", "phn", "segments", "segment")
_MOST = 1000
VISEME_NAMES = ("visemes", "viseme", "mouth", "mouthcues")
TAG_TIER = "events"
"""The point tier of a transcript's inline tags, which we write; tags at one moment share a point,
one a line."""


@dataclass(frozen=True)
class Tier:
    """One tier: its name and its spans, which are moments in a point tier."""

    name: str
    spans: tuple[Span, ...]
    points: bool = False

    @property
    def key(self) -> str:
        """The name without MFA's speaker, in lower case."""
        return self.name.rsplit(" - ", 1)[-1].strip().lower()

    @property
    def labelled(self) -> tuple[Span, ...]:
        """The spans that are not pauses."""
        return words_of(self.spans)


def timings_of(tiers: Sequence[Tier], duration_s: float | None, source: str) -> Timings:
    """The timings in `tiers`; a phrase tier gives word groups where there is no word tier.

    Raises:
        DamagedError: no tier has words, phones or visemes, or speakers talk at the same time.
    """
    if len(tiers) > _MOST:
        raise DamagedError(f"it has {len(tiers)} tiers; nobody annotates more than {_MOST}")
    intervals = [tier for tier in tiers if not tier.points and tier.labelled]
    phones = _named(intervals, PHONE_NAMES) or _by_phones(intervals)
    rest = [tier for tier in intervals if tier not in phones]
    events = _named([tier for tier in tiers if tier.labelled], VISEME_NAMES)
    rest = [tier for tier in rest if tier not in events]
    words = _named(rest, WORD_NAMES) or _by_words(rest)
    if not (words or phones or events):
        raise DamagedError("no tier holds words or phones")
    spans = words_of(_merged(words))
    marks = words_of(_merged(events))
    return Timings(spans, _merged(phones), marks, duration_s, source, tuple(_tags(tiers)))


def _tags(tiers: Sequence[Tier]) -> Iterator[Span]:
    """Each tag of the first point tier that holds them."""
    found = [tier for tier in tiers if tier.points and tier.name == TAG_TIER]
    for point in found[0].spans if found else ():
        for tag in point.label.split("\n"):
            if tag.strip():
                yield point._replace(label=" ".join(tag.split()))


def _named(tiers: Sequence[Tier], names: Sequence[str]) -> list[Tier]:
    """The tiers, one per speaker, that bear the first of `names` that occurs."""
    for name in names:
        found = [tier for tier in tiers if tier.key == name]
        if found:
            return found
    return []


def _by_phones(tiers: Sequence[Tier]) -> list[Tier]:
    unnamed = [tier for tier in tiers if tier.key not in (*WORD_NAMES, *VISEME_NAMES)]
    return _fullest([tier for tier in unnamed if looks_phonetic(tier.labelled)])


def _by_words(tiers: Sequence[Tier]) -> list[Tier]:
    """The tier with the most single words, else the one with the most phrases."""
    single = [tier for tier in tiers if _words_share(tier) > 0.5]
    return _fullest(single) or _fullest(tiers)


def _fullest(tiers: Sequence[Tier]) -> list[Tier]:
    return [max(tiers, key=lambda tier: len(tier.labelled))] if tiers else []


def _words_share(tier: Tier) -> float:
    labels = [span.label for span in tier.labelled]
    return sum(" " not in label for label in labels) / len(labels)


def _merged(tiers: Sequence[Tier]) -> tuple[Span, ...]:
    """Spans of several speakers in order; of one, as they are, so that disorder shows."""
    if len(tiers) == 1:
        return tiers[0].spans
    # A speaker's pauses span the others' speech.
    spoken = [span for tier in tiers for span in tier.labelled]
    return tuple(sorted(spoken, key=lambda span: (span.start_s, span.end_s)))
