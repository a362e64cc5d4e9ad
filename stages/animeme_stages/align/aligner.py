"""Forced alignment with PocketSphinx.

Two passes: words first (a grammar that is the transcript), then phones within them. Settings and
their reasons are measured facts, recorded in ``docs/alignment.md``.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, ClassVar

import numpy as np
import pocketsphinx

from animeme.contracts import Alignment, Speech
from animeme.errors import InputError
from animeme.findings import Finding, Severity
from animeme.phones import SILENCE, Inventory, Phone, PhoneTrack, Word, contiguous
from animeme_stages.align.language import language as language_of
from animeme_stages.align.language import languages
from animeme_stages.align.pronounce import SpokenWord, pronounce
from animeme_stages.align.text import tokens

ACOUSTIC_RATE_HZ = 16_000
FRAME_S = 0.01
# A frame's features describe its 25.6 ms window's centre, but frame n is reported as n × 10 ms:
# half a window less half a hop too early.
OFFSET_S = (0.025625 - FRAME_S) / 2
# Every phone model has three states of at least one frame each.
SHORTEST_PHONE_S = 3 * FRAME_S

# A language's own beams are narrow enough to reject most wrong transcripts; wide ones accept 83 %
# of them. So wide is for what narrow rejects, and its result is only ever "for review".
WIDE = {"beam": 1e-200, "pbeam": 1e-200, "wbeam": 1e-200}


@dataclass
class _Decoder:
    """A loaded decoder and the words it was taught."""

    beams: Mapping[str, float]
    decoder: Any = field(init=False)
    taught: set[str] = field(default_factory=set)

    def __post_init__(self) -> None:
        model = pocketsphinx.get_model_path("en-us")
        self.decoder = pocketsphinx.Decoder(
            pocketsphinx.Config(
                hmm=f"{model}/en-us",
                dict=f"{model}/cmudict-en-us.dict",
                lm=None,
                bestpath=False,  # True fails on 8–46 % of clean, correct lines
                loglevel="FATAL",
                **self.beams,
            )
        )

    def has(self, word: str) -> bool:
        return self.decoder.lookup_word(word) is not None

    def teach(self, words: Sequence[SpokenWord]) -> None:
        for word in words:
            if word.phones and word.key not in self.taught:
                acoustic = " ".join(symbol for _, group in word.phones for symbol in group)
                self.decoder.add_word(word.key, acoustic, False)
                self.taught.add(word.key)

    def decode(self, data: bytes) -> None:
        self.decoder.start_utt()
        self.decoder.process_raw(data, full_utt=True)
        self.decoder.end_utt()

    def align(self, data: bytes, words: Sequence[SpokenWord]) -> Any | None:
        """PocketSphinx's alignment of `words`, None where the beams lose them."""
        self.teach(words)
        # The noise tracker carries over from one file to the next and moves boundaries by up to
        # 20 ms; results must not depend on order.
        self.decoder.reinit_feat()
        self.decoder.set_align_text(" ".join(word.key for word in words))
        self.decode(data)
        hypothesis = self.decoder.hyp()
        if hypothesis is None:
            return None
        heard = [word.split("(")[0] for word in hypothesis.hypstr.split()]
        if heard != [word.key for word in words]:
            return None
        try:
            self.decoder.set_alignment()
            self.decode(data)
        except RuntimeError:  # the second pass lost the path that the first one found
            return None
        return self.decoder.get_alignment()


class PocketSphinxAligner:
    """The default aligner: English acoustic model, any language that has a data file.

    A process loads one decoder per set of beams, and keeps it.
    """

    name: ClassVar[str] = "pocketsphinx"

    def __init__(self) -> None:
        self._decoders: dict[tuple[tuple[str, float], ...], _Decoder] = {}

    def languages(self) -> frozenset[str]:
        """Primary language subtags that it can align."""
        return frozenset(languages())

    def align(self, speech: Speech, text: str, *, language: str) -> Alignment:
        """Align `text` with `speech`; see `animeme.contracts.Aligner`."""
        settings = language_of(language)
        place = str(speech.source)
        narrow = self._decoder(settings.beams)
        words = pronounce(tokens(text, settings), settings, narrow.has, place)
        _require_time(words, narrow, speech)
        data = _samples(speech)
        findings: list[Finding] = []
        found = narrow.align(data, words)
        if found is None:
            found = self._decoder(WIDE).align(data, words)
            findings.append(_doubt("align-wide-beams", "only a tolerant second try fitted them"))
        if found is None:
            raise InputError(
                "align-failed",
                "the recording and the transcript do not fit together",
                place=place,
                action="Listen to the line: a wrong take, a missing sentence, or the wrong file.",
            )
        track = _track(found, words, settings.inventory, language, speech.duration_s)
        share = _squeezed_share(track)
        if share > settings.squeezed_share and not findings:
            findings.append(
                _doubt("align-squeezed", f"{share:.0%} of the sounds had to be squeezed in")
            )
        return Alignment(track, tuple(findings))

    def _decoder(self, beams: Mapping[str, float]) -> _Decoder:
        key = tuple(sorted(beams.items()))
        if key not in self._decoders:
            self._decoders[key] = _Decoder(beams)
        return self._decoders[key]


def _doubt(code: str, reason: str) -> Finding:
    return Finding(
        Severity.WARNING,
        code,
        f"the recording and the transcript may differ: {reason}",
        action="Listen to the line with its transcript in hand.",
    )


def _samples(speech: Speech) -> bytes:
    if speech.rate_hz != ACOUSTIC_RATE_HZ:
        raise ValueError(f"the acoustic model needs {ACOUSTIC_RATE_HZ} Hz, not {speech.rate_hz}")
    return speech.samples.astype(np.int16).tobytes()


def _require_time(words: Sequence[SpokenWord], decoder: _Decoder, speech: Speech) -> None:
    """Refuse text that nobody could say in the recording's time."""
    count = sum(
        sum(len(group) for _, group in word.phones)
        or len(str(decoder.decoder.lookup_word(word.key)).split())
        for word in words
    )
    if count * SHORTEST_PHONE_S > speech.duration_s:
        raise InputError(
            "transcript-too-long",
            f"{count} sounds cannot be spoken in {speech.duration_s:.2f} s",
            place=str(speech.source),
            action="The transcript belongs to a longer recording, or the recording was cut.",
        )


def _track(
    found: Any, words: Sequence[SpokenWord], inventory: Inventory, language: str, duration_s: float
) -> PhoneTrack:
    """Words and phones, in seconds, from PocketSphinx's alignment."""
    phones: list[Phone] = []
    timed: list[Word] = []
    pending = iter(words)
    for entry in found:
        if entry.name.startswith(("<", "[", "+")):  # silence and noise fillers
            continue
        word = next(pending)
        spoken = list(_word_phones(entry, word))
        phones += spoken
        source = (word.token.start, word.token.end)
        start_s, end_s = spoken[0].start_s, min(spoken[-1].end_s, duration_s)
        timed.append(Word(word.token.text, start_s, end_s, source))
    return PhoneTrack(language, inventory, contiguous(phones, duration_s), tuple(timed))


def _word_phones(entry: Any, word: SpokenWord) -> Iterator[Phone]:
    acoustic = [phone for phone in entry if phone.name != "SIL"]
    groups = word.phones or tuple((phone.name, (phone.name,)) for phone in acoustic)
    cursor = 0
    for symbol, group in groups:
        parts = acoustic[cursor : cursor + len(group)]
        cursor += len(group)
        frames = sum(part.duration for part in parts)
        yield Phone(
            symbol,
            _seconds(parts[0].start),
            _seconds(parts[-1].start + parts[-1].duration),
            round(sum(part.score for part in parts) / frames, 3),
        )


def _seconds(frame: int) -> float:
    # Rounded to the microsecond, so that documents show times and not binary fractions.
    return round(frame * FRAME_S + OFFSET_S, 6)


def _squeezed_share(track: PhoneTrack) -> float:
    spoken = [phone for phone in track.phones if phone.symbol != SILENCE]
    squeezed = sum(phone.duration_s < SHORTEST_PHONE_S + FRAME_S / 2 for phone in spoken)
    return squeezed / len(spoken)
