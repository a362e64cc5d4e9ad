"""Timings made into what the pipeline works with."""

from __future__ import annotations

from animeme.errors import InputError
from animeme.phones import SILENCE, Event, Inventory, Phone, PhoneTrack, Word, contiguous
from animeme_stages.align.interchange.symbols import arpabet, inventory_of, ipa
from animeme_stages.align.interchange.timings import ROUNDING_S, Span, Timings

LEFT_OVER_S = 0.05
"""Seconds by which timings may run past the recording: encoders pad and trim by up to this."""

SUBTITLE_LEFT_OVER_S = 1.0
"""As much for subtitles, which stay a while to be read."""
SUBTITLES = ("webvtt", "srt")
"""The formats, keys of `FORMATS`, that subtitles come in."""


def track_from(
    timings: Timings,
    *,
    language: str,
    inventory: Inventory | None = None,
    duration_s: float,
    place: str = "timings",
) -> PhoneTrack:
    """The phones and words of `timings`, over the whole recording.

    Args:
        timings: with phones.
        language: BCP-47 tag.
        inventory: what the symbols must belong to; None takes the one they do belong to.
        duration_s: length of the recording, seconds.
        place: the file, for messages.

    Raises:
        InputError: there are no phones, a symbol is unknown, or the timings belong to a longer
            recording.
    """
    if not timings.phones:
        raise InputError(
            "timings-without-phones",
            "it has no phones",
            place=place,
            action="Use its words as anchors (`anchors`), and let the aligner find the phones.",
        )
    _require_fit(timings, duration_s, place)
    symbols = [span.label for span in timings.phones]
    chosen = inventory or inventory_of(symbols) or _nearest(symbols)
    phones = _joined([_phone(span, chosen, place) for span in timings.phones])
    words = tuple(
        Word(span.label, span.start_s, min(span.end_s, duration_s))
        for span in timings.words
        if span.start_s < duration_s
    )
    events = tuple(Event(tag.label, min(max(tag.start_s, 0.0), duration_s)) for tag in timings.tags)
    return PhoneTrack(language, chosen, contiguous(phones, duration_s), words, events)


def anchors(timings: Timings, *, duration_s: float, place: str = "timings") -> tuple[Span, ...]:
    """The words, or groups of words, between which an aligner may look for phones.

    Args:
        timings: with words.
        duration_s: length of the recording, seconds; spans are cut there.
        place: the file, for messages.

    Raises:
        InputError: there are no words, or they belong to a longer recording.
    """
    if not timings.words:
        raise InputError(
            "timings-without-words",
            "it has no words",
            place=place,
            action="Give timings of words or phones; mouth shapes alone cannot be aligned.",
        )
    _require_fit(timings, duration_s, place)
    return tuple(
        span._replace(end_s=min(span.end_s, duration_s))
        for span in timings.words
        if span.start_s < duration_s
    )


def _require_fit(timings: Timings, duration_s: float, place: str) -> None:
    spans = (*timings.words, *(p for p in timings.phones if arpabet(p.label) != SILENCE))
    end_s = max((span.end_s for span in spans), default=0.0)
    left_over_s = SUBTITLE_LEFT_OVER_S if timings.source in SUBTITLES else LEFT_OVER_S
    if end_s > duration_s + left_over_s:
        raise InputError(
            "timings-too-long",
            f"speech ends at {end_s:.3f} s, but the recording at {duration_s:.3f} s",
            place=place,
            action="The timings belong to another take, or the recording was cut.",
        )


def _nearest(symbols: list[str]) -> Inventory:
    """The inventory that most of `symbols` belong to, for the message about the others."""
    known_arpabet = sum(arpabet(symbol) is not None for symbol in symbols)
    known_ipa = sum(ipa(symbol) is not None for symbol in symbols)
    return "arpabet" if known_arpabet >= known_ipa else "ipa"


def _joined(phones: list[Phone]) -> list[Phone]:
    """Close gaps that only rounding left: nobody pauses for a millisecond."""
    joined: list[Phone] = []
    for phone in phones:
        if joined and phone.start_s - joined[-1].end_s <= ROUNDING_S:
            phone = Phone(phone.symbol, joined[-1].end_s, phone.end_s)
        joined.append(phone)
    return joined


def _phone(span: Span, inventory: Inventory, place: str) -> Phone:
    symbol = arpabet(span.label) if inventory == "arpabet" else ipa(span.label)
    if symbol is None:
        name = "ARPAbet" if inventory == "arpabet" else "IPA"
        raise InputError(
            "timings-symbol-unknown",
            f"the phone '{span.label[:40]}' at {span.start_s:.3f} s is not {name}",
            place=place,
            action="Correct the label; phones may be ARPAbet (AA1) or IPA, in one file not both.",
        )
    return Phone(symbol, span.start_s, span.end_s)
