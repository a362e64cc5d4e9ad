"""Phones, words, events and the tracks they make.

A `PhoneTrack` is what aligners give and models take: phones without gap or overlap over the whole
recording, silence included. Symbols belong to an inventory: ``arpabet`` (the 39 phones of CMUdict,
without stress) or ``ipa``. Models see IPA through `PhoneTrack.ipa`.
"""

from __future__ import annotations

import math
import unicodedata
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Any, Literal

Inventory = Literal["arpabet", "ipa"]

SILENCE = "sil"
"""The symbol of a pause, in every inventory."""

# ARPAbet symbol, IPA, example word. Source: the CMU Pronouncing Dictionary's phone list; IPA as in
# the IPA Handbook (1999), "American English".
ARPABET: tuple[tuple[str, str, str], ...] = (
    ("AA", "ɑ", "odd"),
    ("AE", "æ", "at"),
    ("AH", "ʌ", "hut"),
    ("AO", "ɔ", "ought"),
    ("AW", "aʊ", "cow"),
    ("AY", "aɪ", "hide"),
    ("B", "b", "be"),
    ("CH", "tʃ", "cheese"),
    ("D", "d", "dee"),
    ("DH", "ð", "thee"),
    ("EH", "ɛ", "Ed"),
    ("ER", "ɝ", "hurt"),
    ("EY", "eɪ", "ate"),
    ("F", "f", "fee"),
    ("G", "ɡ", "green"),
    ("HH", "h", "he"),
    ("IH", "ɪ", "it"),
    ("IY", "i", "eat"),
    ("JH", "dʒ", "gee"),
    ("K", "k", "key"),
    ("L", "l", "lee"),
    ("M", "m", "me"),
    ("N", "n", "knee"),
    ("NG", "ŋ", "ping"),
    ("OW", "oʊ", "oat"),
    ("OY", "ɔɪ", "toy"),
    ("P", "p", "pee"),
    ("R", "ɹ", "read"),
    ("S", "s", "sea"),
    ("SH", "ʃ", "she"),
    ("T", "t", "tea"),
    ("TH", "θ", "theta"),
    ("UH", "ʊ", "hood"),
    ("UW", "u", "two"),
    ("V", "v", "vee"),
    ("W", "w", "we"),
    ("Y", "j", "yield"),
    ("Z", "z", "zee"),
    ("ZH", "ʒ", "seizure"),
)
ARPABET_TO_IPA: dict[str, str] = {symbol: ipa for symbol, ipa, _ in ARPABET}

# Marks that change length, stress, tone, voicing, syllabicity or the place by less than a class of
# phones, but not the shape of the mouth. The tilde of nasal vowels is among them: the velum cannot
# be seen.
_INVISIBLE_MARKS = frozenset("ˈˌːˑ̯͡ʰˠ̩̃ʲ̪̥̆ˤ̚‿.-̞̠̟͈̈̊ᵝⁿ˥˦˧˨˩")


def plain_ipa(symbol: str) -> str:
    """`symbol` without the marks that cannot be seen on the lips, composed (NFC).

    Example:
        >>> plain_ipa("ˈaː"), plain_ipa("t͡s"), plain_ipa("ɔ̃")
        ('a', 'ts', 'ɔ')
    """
    kept = (c for c in unicodedata.normalize("NFD", symbol) if c not in _INVISIBLE_MARKS)
    return unicodedata.normalize("NFC", "".join(kept))


@dataclass(frozen=True)
class Phone:
    """One phone or pause.

    Attributes:
        symbol: in the track's inventory, or `SILENCE`.
        start_s, end_s: seconds from the start of the recording, end after start.
        score: mean acoustic log score per 10 ms frame, None where the aligner has none.
    """

    symbol: str
    start_s: float
    end_s: float
    score: float | None = None

    @property
    def duration_s(self) -> float:
        """Length in seconds."""
        return self.end_s - self.start_s


@dataclass(frozen=True)
class Word:
    """One spoken word.

    Attributes:
        text: as spoken, normalised.
        start_s, end_s: seconds from the start of the recording.
        source: (start, end) character positions in the transcript that it was read from.
    """

    text: str
    start_s: float
    end_s: float
    source: tuple[int, int] = (0, 0)


@dataclass(frozen=True)
class Event:
    """Something that a transcript asks for at a moment and nobody says: an inline tag.

    Attributes:
        tag: its text without brackets; ``/`` comes first in one that closes another.
        time_s: seconds from the start of the recording.
        source: (start, end) character positions in the transcript, brackets included.
    """

    tag: str
    time_s: float
    source: tuple[int, int] = (0, 0)


@dataclass(frozen=True)
class PhoneTrack:
    """The phones of one recording, contiguous from 0 to its end.

    Attributes:
        language: BCP-47 tag.
        inventory: which symbols the phones use.
        phones: at least one; the first starts at 0; each starts where the one before ends.
        words: in order, without overlap, within the phones' time; may be empty.
        events: the transcript's inline tags, in order, within the phones' time; may be empty.

    Raises:
        ValueError: an invariant does not hold.
    """

    language: str
    inventory: Inventory
    phones: tuple[Phone, ...]
    words: tuple[Word, ...] = ()
    events: tuple[Event, ...] = ()

    def __post_init__(self) -> None:
        if not self.phones:
            raise ValueError("a phone track needs at least one phone")
        if self.phones[0].start_s != 0.0:
            raise ValueError(f"the first phone starts at {self.phones[0].start_s} s, not at 0")
        for phone in self.phones:
            if not phone.start_s < phone.end_s < math.inf:
                raise ValueError(f"'{phone.symbol}' at {phone.start_s} s has no length")
            if self.inventory == "arpabet" and phone.symbol not in (*ARPABET_TO_IPA, SILENCE):
                raise ValueError(f"'{phone.symbol}' at {phone.start_s} s is not in ARPAbet")
        for before, after in pairwise(self.phones):
            if before.end_s != after.start_s:
                raise ValueError(f"gap or overlap between phones at {before.end_s} s")
        for word in self.words:
            if not 0.0 <= word.start_s < word.end_s <= self.phones[-1].end_s:
                raise ValueError(f"'{word.text}' is not within the recording, or has no length")
        for first, second in pairwise(self.words):
            if second.start_s < first.end_s:
                raise ValueError(f"the words '{first.text}' and '{second.text}' overlap")
        for event in self.events:
            if not event.tag or not 0.0 <= event.time_s <= self.phones[-1].end_s:
                raise ValueError(f"the tag '{event.tag}' is empty, or not within the recording")
        for earlier, later in pairwise(self.events):
            if later.time_s < earlier.time_s:
                raise ValueError(f"the tags '{earlier.tag}' and '{later.tag}' are out of order")

    @property
    def duration_s(self) -> float:
        """End of the last phone in seconds."""
        return self.phones[-1].end_s

    def ipa(self) -> tuple[str, ...]:
        """The symbol of each phone in plain IPA (see `plain_ipa`); pauses stay `SILENCE`."""
        if self.inventory == "arpabet":
            return tuple(ARPABET_TO_IPA.get(phone.symbol, SILENCE) for phone in self.phones)
        return tuple(
            SILENCE if phone.symbol == SILENCE else plain_ipa(phone.symbol) for phone in self.phones
        )

    def to_document(self) -> dict[str, Any]:
        """An ``animeme.alignment/1`` document."""
        return {
            "schema": "animeme.alignment/1",
            "language": self.language,
            "inventory": self.inventory,
            "duration_s": self.duration_s,
            "words": [
                {
                    "text": word.text,
                    "start_s": word.start_s,
                    "end_s": word.end_s,
                    "source": list(word.source),
                }
                for word in self.words
            ],
            "phones": [
                {
                    "symbol": phone.symbol,
                    "start_s": phone.start_s,
                    "end_s": phone.end_s,
                    "score": phone.score,
                }
                for phone in self.phones
            ],
            "events": [
                {"tag": event.tag, "time_s": event.time_s, "source": list(event.source)}
                for event in self.events
            ],
        }

    @classmethod
    def from_document(cls, document: dict[str, Any]) -> PhoneTrack:
        """Read what `to_document` wrote, also before there were events.

        Raises:
            ValueError: the document breaks an invariant.
        """
        phones = tuple(
            Phone(p["symbol"], p["start_s"], p["end_s"], p.get("score")) for p in document["phones"]
        )
        words = tuple(
            Word(w["text"], w["start_s"], w["end_s"], (w["source"][0], w["source"][1]))
            for w in document["words"]
        )
        events = tuple(
            Event(e["tag"], e["time_s"], (e["source"][0], e["source"][1]))
            for e in document.get("events", ())
        )
        return cls(document["language"], document["inventory"], phones, words, events)


def contiguous(phones: Sequence[Phone], duration_s: float) -> tuple[Phone, ...]:
    """Fill the gaps between `phones` with pauses, from 0 to `duration_s`, and join pauses.

    Args:
        phones: in order, without overlap.
        duration_s: where the track ends; phones are cut there.
    """
    filled: list[Phone] = []
    cursor_s = 0.0
    for phone in (*phones, Phone(SILENCE, duration_s, duration_s + 1.0)):
        start_s = min(max(phone.start_s, cursor_s), duration_s)
        if start_s > cursor_s:
            filled.append(Phone(SILENCE, cursor_s, start_s))
            cursor_s = start_s
        end_s = min(phone.end_s, duration_s)
        if end_s > cursor_s:
            filled.append(Phone(phone.symbol, cursor_s, end_s, phone.score))
            cursor_s = end_s
    joined: list[Phone] = []
    for phone in filled:
        if joined and joined[-1].symbol == phone.symbol == SILENCE:
            joined[-1] = Phone(SILENCE, joined[-1].start_s, phone.end_s)
        else:
            joined.append(phone)
    return tuple(joined)
