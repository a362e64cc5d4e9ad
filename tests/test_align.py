"""Alignment of the sample's lines: right ones pass, wrong ones are refused or flagged."""

from __future__ import annotations

from functools import cache
from pathlib import Path

import numpy as np
import pytest

from animeme.contracts import Alignment, Speech
from animeme.errors import InputError
from animeme.findings import Finding
from animeme.phones import SILENCE, Phone, PhoneTrack
from animeme_stages.align.aligner import LONGEST_PIECE_S, PocketSphinxAligner
from animeme_stages.align.doubts import sound_in_pauses
from animeme_stages.ingest.audio import read_speech
from conftest import LANGUAGES, SAMPLE

LINES = ("boat", "count", "five", "moon", "think", "welcome")
ALIGNER = PocketSphinxAligner()


@cache
def speech(language: str, line: str) -> Speech:
    return read_speech(SAMPLE / "dialogue" / language / f"{line}.wav")


def text(language: str, line: str) -> str:
    path = SAMPLE / "dialogue" / language / f"{line}.txt"
    return path.read_text(encoding="utf-8").strip()


def outcome(recording: Speech, transcript: str, language: str) -> tuple[Finding, ...] | str:
    """Findings, or the code of the refusal."""
    try:
        return ALIGNER.align(recording, transcript, language=language).findings
    except InputError as error:
        return error.code


def joined(*recordings: Speech) -> Speech:
    samples = np.concatenate([recording.samples for recording in recordings])
    return Speech(Path("joined"), samples, 16_000, len(samples) / 16_000)


@pytest.mark.parametrize("language", LANGUAGES)
@pytest.mark.parametrize("line", LINES)
def test_right_lines_raise_no_doubt(language: str, line: str) -> None:
    assert outcome(speech(language, line), text(language, line), language) == ()


@pytest.mark.parametrize("language", LANGUAGES)
@pytest.mark.parametrize("line", LINES)
def test_another_lines_transcript_never_passes(language: str, line: str) -> None:
    for other in LINES:
        if other != line:
            assert outcome(speech(language, line), text(language, other), language) != ()


def test_a_missing_second_half_of_the_transcript_is_noticed() -> None:
    recording = joined(speech("en", "boat"), speech("en", "five"))
    found = outcome(recording, text("en", "boat"), "en")
    assert found != ()
    whole = f"{text('en', 'boat')} {text('en', 'five')}"
    assert outcome(recording, whole, "en") == ()


def test_sound_between_words_is_measured() -> None:
    track = ALIGNER.align(speech("en", "boat"), text("en", "boat"), language="en").track
    assert sound_in_pauses(track, speech("en", "boat"))[1] < 0.2
    rest = Phone(SILENCE, track.phones[6].start_s, track.duration_s)
    cut = PhoneTrack("en", "arpabet", (*track.phones[:6], rest))
    pause, length_s = sound_in_pauses(cut, speech("en", "boat"))
    assert pause == rest
    assert length_s > 1.0


def test_a_long_recording_is_cut_at_pauses_and_aligned_alike() -> None:
    """Several times the longest piece; its words fall where they do when aligned one by one."""
    names = LINES * 4
    recording = joined(*(speech("en", name) for name in names))
    assert recording.duration_s > 3 * LONGEST_PIECE_S
    whole: Alignment = ALIGNER.align(
        recording, " ".join(text("en", name) for name in names), language="en"
    )
    expected, offset_s = [], 0.0
    for name in names:
        alone = ALIGNER.align(speech("en", name), text("en", name), language="en").track
        expected += [(word.text, word.start_s + offset_s) for word in alone.words]
        offset_s += speech("en", name).duration_s
    assert [word.text for word in whole.track.words] == [word for word, _ in expected]
    moved = np.abs([w.start_s - at for w, (_, at) in zip(whole.track.words, expected, strict=True)])
    assert np.median(moved) < 0.01
    assert moved.max() < 0.15
    assert whole.track.duration_s == recording.duration_s
