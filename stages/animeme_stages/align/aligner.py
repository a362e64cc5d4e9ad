"""Forced alignment: exact search with PocketSphinx's acoustic model.

Settings and their reasons are measured facts, recorded in ``docs/alignment.md``.
"""

from __future__ import annotations

import json
from collections.abc import Iterable, Iterator, Sequence
from functools import cache
from pathlib import Path
from typing import ClassVar

from animeme.contracts import Alignment, Anchor, LearnedVoice, Speech
from animeme.errors import InputError
from animeme.findings import Severity
from animeme.phones import Inventory, Phone, PhoneTrack, Word, contiguous
from animeme_stages.align.acoustic.features import FRAME_S, RATE_HZ, WINDOW
from animeme_stages.align.acoustic.hear import Heard, HeardWord, UnsayableError, Window, hear
from animeme_stages.align.acoustic.model import AcousticModel, acoustic_model
from animeme_stages.align.cmudict import Pronunciation
from animeme_stages.align.confidence import calibration, judge
from animeme_stages.align.doubts import anchor_doubts, doubts, require_likeness
from animeme_stages.align.language import Language, languages
from animeme_stages.align.language import language as language_of
from animeme_stages.align.lexicon import Lexicon, read_lexicon
from animeme_stages.align.pronounce import SpokenWord, pronounce
from animeme_stages.align.rate import rate_doubt
from animeme_stages.align.tags import timed_tags, unpaired_brackets
from animeme_stages.align.text import tokens
from animeme_stages.align.voice import Example, learn, read_voice, write_voice

# A frame's features describe its window's centre, but frame n is counted from n × 10 ms: half a
# window less half a hop too early.
OFFSET_S = (WINDOW / RATE_HZ - FRAME_S) / 2

# Less than this of a voice tells too little of it.
LEAST_VOICE_S, LEAST_VOICE_LINES = 30.0, 10

# The most that a line in doubt may have, whatever else speaks for it: from 0.5 on it is trusted.
MOST_IN_DOUBT = 0.49


class PocketSphinxAligner:
    """The default aligner: PocketSphinx's English acoustic model, any language with a data file."""

    name: ClassVar[str] = "pocketsphinx"

    def languages(self) -> frozenset[str]:
        """Primary language subtags that it can align."""
        return frozenset(languages())

    def lexicon_part(self, text: str, *, language: str, lexicon: Path) -> str:
        """The lexicon's entries for the words of `text`; see `animeme.contracts.Aligner`."""
        settings = language_of(language)
        entries = _lexicon(lexicon, settings.tag, _version(lexicon)).entries
        words = sorted({token.text for token in tokens(text, settings)} & entries.keys())
        found = {
            word: [[entry.arpabet, *entry.phones] for entry in entries[word]] for word in words
        }
        return json.dumps(found, ensure_ascii=False) if found else ""

    def align(
        self,
        speech: Speech,
        text: str,
        *,
        language: str,
        lexicon: Path | None = None,
        anchors: Sequence[Anchor] = (),
        voice: Path | None = None,
    ) -> Alignment:
        """Align `text` with `speech`; see `animeme.contracts.Aligner`."""
        return _aligned(speech, text, language, lexicon, anchors, voice)[0]

    def learn_voice(
        self,
        lines: Iterable[tuple[Speech, str]],
        target: Path,
        *,
        language: str,
        lexicon: Path | None = None,
    ) -> LearnedVoice:
        """Learn how a speaker sounds; see `animeme.contracts.VoiceLearner`."""
        examples = []
        refused = 0
        for speech, text in lines:
            try:
                found, heard, words = _aligned(speech, text, language, lexicon)
            except InputError:
                refused += 1
                continue
            if found.findings or speech.findings:
                refused += 1
            else:
                sounds = [sounds_of(word) for word in words]
                examples.append(Example(speech.samples, sounds, heard.senones))
        audio_s = sum(len(example.samples) for example in examples) / RATE_HZ
        enough = audio_s >= LEAST_VOICE_S and len(examples) >= LEAST_VOICE_LINES
        if enough:
            write_voice(learn(examples, language_of(language).family), target)
        return LearnedVoice(len(examples), refused, round(audio_s, 3), enough)


def _aligned(
    speech: Speech,
    text: str,
    language: str,
    lexicon: Path | None,
    anchors: Sequence[Anchor] = (),
    voice: Path | None = None,
) -> tuple[Alignment, Heard, list[SpokenWord]]:
    if speech.rate_hz != RATE_HZ:
        raise ValueError(f"the acoustic model needs {RATE_HZ} Hz, not {speech.rate_hz}")
    settings = language_of(language)
    own = None if voice is None else read_voice(voice, settings.family)
    words = spoken_words(text, settings, str(speech.source), lexicon)
    heard = _heard(own.model if own else acoustic_model(), speech, words, anchors)
    track = _track(heard, words, settings.inventory, language, text, speech)
    known = own.calibration if own else calibration(settings.family)
    judgement = judge(heard, known, settings.tag)
    require_likeness(judgement, speech)
    findings = (
        *unpaired_brackets(text),
        *doubts(judgement, track),
        *anchor_doubts(track, anchors),
        *rate_doubt(track),
    )
    sure = judgement.confidence
    if any(finding.severity >= Severity.WARNING for finding in findings):
        sure = min(sure, MOST_IN_DOUBT)
    return Alignment(track, findings, round(sure, 4)), heard, words


def spoken_words(
    text: str, language: Language, place: str, lexicon: Path | None = None
) -> list[SpokenWord]:
    """The words of a transcript, each with all of its pronunciations.

    Args:
        text: the transcript.
        language: its language.
        place: its recording, for messages.
        lexicon: the user's pronunciations.

    Raises:
        InputError: no word has a sound, or some cannot be pronounced.
    """
    own = _lexicon(lexicon, language.tag, _version(lexicon)) if lexicon else None
    return pronounce(tokens(text, language), language, place, own)


def sounds_of(word: SpokenWord) -> list[tuple[str, ...]]:
    """A word's pronunciations in the acoustic model's phones."""
    return [tuple(sound for _, group in variant for sound in group) for variant in word.variants]


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


def _heard(
    model: AcousticModel, speech: Speech, words: Sequence[SpokenWord], anchors: Sequence[Anchor]
) -> Heard:
    sounds = [sounds_of(word) for word in words]
    try:
        return hear(model, speech.samples, sounds, _windows(words, anchors))
    except UnsayableError:
        count = sum(min(map(len, each)) for each in sounds)
        raise InputError(
            "transcript-too-long",
            f"{count} sounds cannot be spoken in {speech.duration_s:.2f} s",
            place=str(speech.source),
            action="The transcript belongs to a longer recording, or the recording was cut.",
        ) from None


def _windows(words: Sequence[SpokenWord], anchors: Sequence[Anchor]) -> list[Window | None]:
    """The frames that anchors allow each word; () if there are none."""
    if not anchors:
        return []
    ordered = sorted(anchors, key=lambda anchor: anchor.start)
    windows: list[Window | None] = []
    at = 0
    for word in words:
        while at < len(ordered) and ordered[at].end <= word.token.start:
            at += 1
        inside = at < len(ordered) and ordered[at].start <= word.token.start
        windows.append(_window(ordered[at]) if inside else None)
    return windows


def _window(anchor: Anchor) -> Window:
    return (
        (anchor.start_s - anchor.slack_s - OFFSET_S) / FRAME_S,
        (anchor.end_s + anchor.slack_s - OFFSET_S) / FRAME_S,
    )


def _track(
    heard: Heard,
    words: Sequence[SpokenWord],
    inventory: Inventory,
    language: str,
    text: str,
    speech: Speech,
) -> PhoneTrack:
    """Words and phones, in seconds, from what was heard."""
    phones: list[Phone] = []
    timed: list[Word] = []
    for entry, word in zip(heard.words, words, strict=True):
        spoken = list(_word_phones(entry, word.variants[entry.variant]))
        phones += spoken
        source = (word.token.start, word.token.end)
        start_s, end_s = spoken[0].start_s, min(spoken[-1].end_s, speech.duration_s)
        timed.append(Word(word.token.text, start_s, end_s, source))
    covering = contiguous(phones, speech.duration_s)
    return PhoneTrack(language, inventory, covering, tuple(timed), timed_tags(text, timed))


def _word_phones(entry: HeardWord, spelling: Pronunciation) -> Iterator[Phone]:
    cursor = 0
    for symbol, group in spelling:
        parts = entry.phones[cursor : cursor + len(group)]
        cursor += len(group)
        frames = sum(part.length for part in parts)
        gain = sum(part.gain for part in parts)
        end = parts[-1].start + parts[-1].length
        yield Phone(symbol, _seconds(parts[0].start), _seconds(end), round(gain / frames, 3))


def _seconds(frame: int) -> float:
    # Rounded to the microsecond, so that documents show times and not binary fractions.
    return round(frame * FRAME_S + OFFSET_S, 6)
