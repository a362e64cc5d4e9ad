"""Forced alignment with PocketSphinx.

Two passes: words first (a grammar that is the transcript), then phones within them. Settings and
their reasons are measured facts, recorded in ``docs/alignment.md``.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cache
from pathlib import Path
from typing import Any, ClassVar

import numpy as np
import pocketsphinx

from animeme.contracts import Alignment, Anchor, Speech
from animeme.errors import InputError
from animeme.findings import Finding
from animeme.phones import Inventory, Phone, PhoneTrack, Word, contiguous
from animeme_stages.align.doubts import FRAME_S, SHORTEST_PHONE_S, doubt, doubts
from animeme_stages.align.language import language as language_of
from animeme_stages.align.language import languages
from animeme_stages.align.lexicon import Lexicon, read_lexicon
from animeme_stages.align.pronounce import Pronunciation, SpokenWord, pronounce
from animeme_stages.align.text import tokens

ACOUSTIC_RATE_HZ = 16_000
# A frame's features describe its 25.6 ms window's centre, but frame n is reported as n × 10 ms:
# half a window less half a hop too early.
OFFSET_S = (0.025625 - FRAME_S) / 2

# The second pass takes frames × states × 8 bytes: 20 s of speech take 18 MB, 300 s take 1.4 GB.
LONGEST_PIECE_S = 20.0
# A cut needs this many frames of pause around it.
SHORTEST_PAUSE = 8

# A language's own beams are narrow enough to reject most wrong transcripts; wide ones accept 83 %
# of them. So wide is for what narrow rejects, and its result is only ever "for review".
WIDE = {"beam": 1e-200, "pbeam": 1e-200, "wbeam": 1e-200}


# How the decoder names a word's second and further pronunciations: ``word(2)``.
_VARIANT = re.compile(r"\((\d+)\)$")
# A word or pause with its first and last frame.
_Heard = tuple[str, int, int]


@dataclass(frozen=True)
class _Found:
    """A word as the decoder found it.

    Attributes:
        name: its key, with the number of the variant in brackets if it is not the first.
        phones: (acoustic phone, first frame, frames, score) of each.
    """

    name: str
    phones: tuple[tuple[str, int, int, int], ...]


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
                for number, variant in enumerate(word.variants, 1):
                    acoustic = " ".join(symbol for _, group in variant for symbol in group)
                    name = word.key if number == 1 else f"{word.key}({number})"
                    self.decoder.add_word(name, acoustic, False)
                self.taught.add(word.key)

    def decode(self, data: bytes) -> None:
        self.decoder.start_utt()
        self.decoder.process_raw(data, full_utt=True)
        self.decoder.end_utt()

    def align(self, data: bytes, words: Sequence[SpokenWord]) -> list[_Found] | None:
        """The phones of `words`, None where the beams lose them.

        A long recording is cut at pauses: the second pass keeps a history of frames × states.
        """
        self.teach(words)
        if len(data) <= _bytes(LONGEST_PIECE_S):
            return self._align_piece(data, words, 0)
        heard = self._first_pass(data, words)
        if heard is None:
            return None
        found: list[_Found] = []
        for start, end, first, last in _pieces(heard, len(data) // _bytes(FRAME_S)):
            part = data[start * _bytes(FRAME_S) : end * _bytes(FRAME_S)]
            piece = self._align_piece(part, words[first:last], start)
            if piece is None:
                return None
            found += piece
        return found

    def _first_pass(
        self, data: bytes, words: Sequence[SpokenWord]
    ) -> list[tuple[str, int, int]] | None:
        """Words and pauses with their first and last frame; None unless they spell `words`."""
        # The noise tracker carries over from one file to the next and moves boundaries by up to
        # 20 ms; results must not depend on order.
        self.decoder.reinit_feat()
        self.decoder.set_align_text(" ".join(word.key for word in words))
        self.decode(data)
        if self.decoder.hyp() is None:
            return None
        heard = [(entry.word, entry.start_frame, entry.end_frame) for entry in self.decoder.seg()]
        said = [name.split("(")[0] for name, _, _ in heard if not _is_filler(name)]
        return heard if said == [word.key for word in words] else None

    def _align_piece(
        self, data: bytes, words: Sequence[SpokenWord], offset: int
    ) -> list[_Found] | None:
        if self._first_pass(data, words) is None:
            return None
        try:
            self.decoder.set_alignment()
            self.decode(data)
        except RuntimeError:  # the second pass lost the path that the first one found
            return None
        return [
            _Found(
                entry.name,
                tuple((p.name, p.start + offset, p.duration, p.score) for p in entry),
            )
            for entry in self.decoder.get_alignment()
            if not _is_filler(entry.name)
        ]


def _is_filler(name: str) -> bool:
    """Whether an entry is silence or noise and no word."""
    return name.startswith(("<", "[", "+", "("))


def _bytes(length_s: float) -> int:
    """Bytes of 16-bit samples in a length of time."""
    return 2 * round(length_s * ACOUSTIC_RATE_HZ)


def _pieces(
    heard: Sequence[tuple[str, int, int]], frames: int
) -> Iterator[tuple[int, int, int, int]]:
    """Cut a recording in the middle of pauses.

    Args:
        heard: words and pauses with their first and last frame.
        frames: length of the recording.

    Yields:
        First frame, end frame, first word and end word of each piece: as long as allowed, or up to
        the next pause where there is none in time.
    """
    longest = round(LONGEST_PIECE_S / FRAME_S)
    start = first = word = 0
    cut: tuple[int, int] | None = None
    for name, begin, end in heard:
        if not _is_filler(name):
            word += 1
            continue
        middle = (begin + end) // 2
        if cut and word > cut[1] and middle - start > longest:
            yield start, cut[0], first, cut[1]
            start, first = cut
            cut = None
        if word > first and end - begin >= SHORTEST_PAUSE:
            cut = (middle, word)
    if cut and word > cut[1] and frames - start > longest:
        yield start, cut[0], first, cut[1]
        start, first = cut
    yield start, frames, first, word


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

    def align(
        self,
        speech: Speech,
        text: str,
        *,
        language: str,
        lexicon: Path | None = None,
        anchors: Sequence[Anchor] = (),
    ) -> Alignment:
        """Align `text` with `speech`; see `animeme.contracts.Aligner`."""
        settings = language_of(language)
        place = str(speech.source)
        narrow = self._decoder(settings.beams)
        own = _lexicon(lexicon, settings.tag, _version(lexicon)) if lexicon else None
        words = pronounce(tokens(text, settings), settings, narrow.has, place, own)
        _require_time(words, narrow, speech)
        data = _samples(speech)
        findings: list[Finding] = []
        found = narrow.align(data, words)
        if found is None:
            found = self._decoder(WIDE).align(data, words)
            findings.append(doubt("align-wide-beams", "only a tolerant second try fitted them"))
        if found is None:
            raise InputError(
                "align-failed",
                "the recording and the transcript do not fit together",
                place=place,
                action="Listen to the line: a wrong take, a missing sentence, or the wrong file.",
            )
        track = _track(found, words, settings.inventory, language, speech.duration_s)
        findings += doubts(track, speech, settings)
        return Alignment(track, tuple(findings))

    def _decoder(self, beams: Mapping[str, float]) -> _Decoder:
        key = tuple(sorted(beams.items()))
        if key not in self._decoders:
            self._decoders[key] = _Decoder(beams)
        return self._decoders[key]


@cache
def _lexicon(path: Path, tag: str, version: tuple[int, int]) -> Lexicon:
    return read_lexicon(path, language_of(tag))


def _version(path: Path) -> tuple[int, int]:
    """What changes when a file is edited; (0, 0) if it is not there, for its reader to say."""
    try:
        state = path.stat()
    except OSError:
        return (0, 0)
    return (state.st_mtime_ns, state.st_size)


def _samples(speech: Speech) -> bytes:
    if speech.rate_hz != ACOUSTIC_RATE_HZ:
        raise ValueError(f"the acoustic model needs {ACOUSTIC_RATE_HZ} Hz, not {speech.rate_hz}")
    return speech.samples.astype(np.int16).tobytes()


def _require_time(words: Sequence[SpokenWord], decoder: _Decoder, speech: Speech) -> None:
    """Refuse text that nobody could say in the recording's time."""
    count = sum(
        min((sum(len(group) for _, group in v) for v in word.variants), default=0)
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
    found: Sequence[_Found],
    words: Sequence[SpokenWord],
    inventory: Inventory,
    language: str,
    duration_s: float,
) -> PhoneTrack:
    """Words and phones, in seconds, from what the decoder found."""
    phones: list[Phone] = []
    timed: list[Word] = []
    for entry, word in zip(found, words, strict=True):
        spoken = list(_word_phones(entry, word))
        phones += spoken
        source = (word.token.start, word.token.end)
        start_s, end_s = spoken[0].start_s, min(spoken[-1].end_s, duration_s)
        timed.append(Word(word.token.text, start_s, end_s, source))
    return PhoneTrack(language, inventory, contiguous(phones, duration_s), tuple(timed))


def _word_phones(entry: _Found, word: SpokenWord) -> Iterator[Phone]:
    acoustic = [phone for phone in entry.phones if phone[0] != "SIL"]
    groups: Pronunciation = tuple((name, (name,)) for name, *_ in acoustic)
    if word.phones:
        number = _VARIANT.search(entry.name)
        groups = word.variants[int(number[1]) - 1 if number else 0]
    cursor = 0
    for symbol, group in groups:
        parts = acoustic[cursor : cursor + len(group)]
        cursor += len(group)
        frames = sum(length for _, _, length, _ in parts)
        score = sum(score for *_, score in parts)
        _, start, _, _ = parts[0]
        _, last, length, _ = parts[-1]
        yield Phone(symbol, _seconds(start), _seconds(last + length), round(score / frames, 3))


def _seconds(frame: int) -> float:
    # Rounded to the microsecond, so that documents show times and not binary fractions.
    return round(frame * FRAME_S + OFFSET_S, 6)
