"""Transcripts spoken by espeak-ng, with exact timings, until an actor has recorded them.

The words are those that an aligner would look for: numbers and signs as `tokens` reads them, tags
left out. Punctuation stays, so that there are pauses. Sounds and times are what espeak-ng says it
does while it speaks.
"""

from __future__ import annotations

import re
from bisect import bisect_right
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace
from itertools import pairwise
from pathlib import Path

import numpy as np
import soundfile
from numpy.typing import NDArray

from animeme.contracts import Alignment, Speech, Spoken
from animeme.errors import InputError
from animeme.files import atomic_path
from animeme.findings import Finding, Severity
from animeme.phones import Phone, PhoneTrack, Word, contiguous
from animeme_stages.align.espeak import (
    FASTEST_WPM,
    LONGEST_PART_BYTES,
    SLOWEST_WPM,
    Rendition,
    espeak,
)
from animeme_stages.align.language import Language
from animeme_stages.align.language import language as language_of
from animeme_stages.align.pronounce import espeak_phones
from animeme_stages.align.tags import timed_tags, untagged
from animeme_stages.align.text import Token, tokens
from animeme_stages.ingest.audio import SPEECH_RATE_HZ, quantized, resampled

# A conversation's pace; espeak's own, 175, sounds hurried.
WORDS_PER_MINUTE = 160
# The mouth needs time to open and to come to rest.
MARGIN_S = 0.2

# Share of the mean power of speech below which a stretch is a pause (-12 dB).
QUIET_SHARE = 1 / 16

# What a voice makes of the signs between two words; the first that is there counts.
_PAUSES = (
    (re.compile(r"[?？؟;;](?![^?？؟;;]*[.!])"), "?"),
    (re.compile(r"[!！]"), "!"),
    (re.compile(r"[.。．…।॥۔]|\n\s*\n"), "."),
    (re.compile(r"[,，、،;；؛:：—–()（）«»]"), ","),
)

_ENDS = ("?", "!", ".")


def speak(
    text: str,
    *,
    language: str,
    words_per_minute: int = WORDS_PER_MINUTE,
    source: Path = Path("speech.wav"),
) -> Spoken:
    """Speak a transcript with espeak-ng.

    The same arguments give the same bytes. A lexicon has no say: espeak-ng has its own
    pronunciations, and what is reported is what it spoke.

    Args:
        text: the transcript.
        language: BCP-47 tag.
        words_per_minute: pace, 80 to 450.
        source: file that the speech will be in, for messages.

    Raises:
        InputError: nothing in it can be spoken, or espeak-ng or a reader is not installed.
        ValueError: nobody speaks at that pace.
    """
    if not SLOWEST_WPM <= words_per_minute <= FASTEST_WPM:
        raise ValueError(
            f"words_per_minute must be {SLOWEST_WPM} to {FASTEST_WPM}, not {words_per_minute}"
        )
    settings = language_of(language)
    words = tokens(text, settings)
    parts = _parts(text, words)
    renditions = espeak().speak(
        [part.script for part in parts],
        _voice(language, settings),
        words_per_minute=words_per_minute,
    )
    uttered: list[_Utterance] = []
    offset = 0
    for part, rendition in zip(parts, renditions, strict=True):
        uttered += _utterances(rendition, part, offset, settings)
        offset += len(rendition.samples)
    if not uttered:
        raise InputError(
            "transcript-empty",
            "the transcript has no word that can be spoken",
            place=str(source),
            action="Write what shall be said, or take the line out of the folder.",
        )
    samples = np.concatenate([rendition.samples for rendition in renditions])
    spoken = _spoken(samples, espeak().rate_hz, uttered, language, settings, source)
    track = spoken.alignment.track
    track = replace(track, events=timed_tags(text, track.words))
    return replace(spoken, alignment=replace(spoken.alignment, track=track))


def write_speech(spoken: Spoken, path: Path) -> None:
    """Write what was spoken as 16-bit WAV, atomically.

    Raises:
        InputError: the file cannot be written, or its name is that of another format.
    """
    if path.suffix.lower() not in (".wav", ".wave"):
        raise InputError(
            "audio-format",
            f"speech is written as WAV, not as '{path.suffix}'",
            place=str(path),
            action="Give it a name that ends in .wav.",
        )
    with atomic_path(path) as scratch:
        soundfile.write(
            scratch, spoken.samples, spoken.rate_hz, subtype="PCM_16", format="WAV", endian="LITTLE"
        )


@dataclass
class _Utterance:
    """One or more words that were spoken as one, and their phones.

    Attributes:
        words: usually one.
        phones: (symbol in the language's inventory, first sample, end sample) of each.
    """

    words: list[Token]
    phones: list[tuple[str, float, float]]


def _voice(tag: str, settings: Language) -> str:
    """The language's voice, or that of the region where there is one."""
    region = tag.replace("_", "-").lower()
    return region if region in settings.accents else settings.voice


@dataclass
class _Part:
    """What espeak is given at a time.

    Attributes:
        script: what it shall read.
        words: in it.
        places: where each of them starts in `script`.
    """

    script: str = ""
    words: list[Token] = field(default_factory=list)
    places: list[int] = field(default_factory=list)


def _parts(text: str, words: Sequence[Token]) -> list[_Part]:
    """The text as words and signs, cut after sentences and wherever espeak could lose its end."""
    plain = untagged(text)
    parts = [_Part()]
    for index, word in enumerate(words):
        following = words[index + 1] if index + 1 < len(words) else None
        part = parts[-1]
        said = word.spelling or word.text
        if part.words and len(f"{part.script}{said}".encode()) > LONGEST_PART_BYTES:
            part = _Part()
            parts.append(part)
        part.words.append(word)
        part.places.append(len(part.script))
        sign = _pause(plain[word.end : following.start] if following else plain[word.end :])
        part.script += f"{said}{sign} "
        if sign in _ENDS and following:
            parts.append(_Part())
    return parts if words else []


def _pause(between: str) -> str:
    return next((sign for pattern, sign in _PAUSES if pattern.search(between)), "")


def _utterances(
    rendition: Rendition, part: _Part, offset: int, settings: Language
) -> list[_Utterance]:
    """The words of a part as they were spoken, with their phones; samples from `offset` on."""
    spoken: list[list[_Sound]] = [[] for _ in part.words]
    word = 0
    glide: int | None = None
    for event, end in zip(rendition.events, _ends(rendition), strict=True):
        if event.kind == "word":
            word = max(word, bisect_right(part.places, event.character) - 1)
        elif event.symbol.startswith("("):
            continue
        elif event.symbol:
            start = event.sample if glide is None else glide
            spoken[word].append((event.symbol, offset + start, offset + end))
            glide = None
        else:  # a pause, or the nameless glide from [i] to another vowel, which is the vowel's
            glide = event.sample if _is_heard(rendition.samples, event.sample, end) else None
    groups: list[tuple[list[Token], list[_Sound]]] = []
    for token, sounds in zip(part.words, spoken, strict=True):
        if sounds or not groups:
            groups.append(([token], sounds))
        else:  # espeak reads frequent pairs (of the) as one word
            groups[-1][0].append(token)
    parted = (part for tokens, sounds in groups for part in _parted(tokens, sounds, settings))
    found = (_Utterance(tokens, list(_symbols(sounds, settings))) for tokens, sounds in parted)
    return [utterance for utterance in found if utterance.phones]


_Sound = tuple[str, int, int]
"""A symbol of espeak's, first sample, end sample."""


def _ends(rendition: Rendition) -> Iterator[int]:
    """Where each event's sound ends: where the next phone or pause begins."""
    end = len(rendition.samples)
    found: list[int] = []
    for event in reversed(rendition.events):
        found.append(end)
        if event.kind == "phone" and not event.symbol.startswith("("):
            end = event.sample
    return reversed(found)


def _is_heard(samples: NDArray[np.int16], start: int, end: int) -> bool:
    """Whether a stretch is no pause; espeak's pauses are 20 dB below its speech, its glides not."""
    if end <= start:
        return False
    whole, part = (np.square(s.astype(np.float64)).mean() for s in (samples, samples[start:end]))
    return bool(part > QUIET_SHARE * whole)


def _parted(
    words: list[Token], sounds: list[_Sound], settings: Language
) -> list[tuple[list[Token], list[_Sound]]]:
    """Sounds of words that were spoken as one, given to each; unparted if there are too few.

    Each word gets as many as it takes for both halves to be most like what the words sound like
    alone.
    """
    if len(words) == 1:
        return [(words, sounds)]
    said = [symbol for symbol, *_ in sounds]
    alone = [espeak().pronounce(word.text, settings.voice) for word in words]
    rest = [phone for phones in alone[1:] for phone in phones]
    cuts = range(1, len(said) - len(words) + 2)
    if not cuts:
        return [(words, sounds)]
    cut = min(cuts, key=lambda n: _distance(said[:n], alone[0]) + _distance(said[n:], rest))
    return [(words[:1], sounds[:cut]), *_parted(words[1:], sounds[cut:], settings)]


def _distance(left: Sequence[str], right: Sequence[str]) -> int:
    """Levenshtein's, stress not counted."""
    row = list(range(len(right) + 1))
    for index, symbol in enumerate(left, 1):
        previous, row[0] = row[0], index
        for place, other in enumerate(right, 1):
            change = previous + (symbol.strip("ˈˌ") != other.strip("ˈˌ"))
            previous, row[place] = row[place], min(change, row[place] + 1, row[place - 1] + 1)
    return row[-1]


def _symbols(sounds: Sequence[_Sound], settings: Language) -> Iterator[tuple[str, float, float]]:
    """Sounds in the language's inventory.

    One of espeak's may be several of ours ([əl]): they share its time evenly. A mark of its own
    (palatalisation) belongs to the sound before it.
    """
    pending: list[tuple[str, float, float]] = []
    for symbol, start, end in sounds:
        names = espeak_phones(symbol, settings)
        if not names and pending:
            name, begin, _ = pending[-1]
            pending[-1] = (name, begin, end)
        length = (end - start) / max(len(names), 1)
        edges = [start + part * length for part in range(len(names) + 1)]
        pending += [(name, *edge) for name, edge in zip(names, pairwise(edges), strict=True)]
    return (sound for sound in pending if sound[2] > sound[1])


def _spoken(
    spoken: NDArray[np.int16],
    rate_hz: int,
    uttered: Sequence[_Utterance],
    language: str,
    settings: Language,
    source: Path,
) -> Spoken:
    margin = round(MARGIN_S * rate_hz)
    samples = np.pad(spoken, margin)
    duration_s = len(samples) / rate_hz

    def seconds(sample: float) -> float:
        return round((margin + sample) / rate_hz, 6)

    phones = [
        Phone(symbol, seconds(start), seconds(end))
        for utterance in uttered
        for symbol, start, end in utterance.phones
    ]
    words = tuple(
        Word(
            " ".join(token.text for token in utterance.words),
            seconds(utterance.phones[0][1]),
            seconds(utterance.phones[-1][2]),
            (utterance.words[0].start, utterance.words[-1].end),
        )
        for utterance in uttered
    )
    track = PhoneTrack(language, settings.inventory, contiguous(phones, duration_s), words)
    pcm = quantized(resampled((samples / 32768.0).astype(np.float32), rate_hz))
    speech = Speech(source, pcm, SPEECH_RATE_HZ, duration_s, (_synthetic(),))
    return Spoken(samples, rate_hz, speech, Alignment(track))


def _synthetic() -> Finding:
    return Finding(
        Severity.INFO,
        "line-synthetic",
        "there is no recording; espeak-ng spoke the transcript",
        action="Record it before it ships.",
    )
