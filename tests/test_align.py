"""Alignment of the sample's lines: right ones pass, wrong ones are refused or flagged."""

from __future__ import annotations

from functools import cache
from pathlib import Path

import numpy as np
import pytest

from animeme.contracts import Alignment, Anchor, Speech
from animeme.errors import InputError
from animeme.findings import Finding
from animeme.phones import SILENCE, Phone, PhoneTrack
from animeme_stages.align.acoustic.features import FRAME_S
from animeme_stages.align.acoustic.pieces import LONGEST
from animeme_stages.align.aligner import PocketSphinxAligner
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
    assert recording.duration_s > 3 * LONGEST * FRAME_S
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


def test_words_after_a_minute_of_silence_are_found() -> None:
    boat, silence = speech("en", "boat"), Speech(Path("-"), np.zeros(960_000, np.int16), 16_000, 60)
    recording = joined(silence, boat, silence)
    found = ALIGNER.align(recording, text("en", "boat"), language="en")
    alone = ALIGNER.align(boat, text("en", "boat"), language="en").track.words
    moved = [w.start_s - 60 - own.start_s for w, own in zip(found.track.words, alone, strict=True)]
    assert np.abs(moved).max() < 0.1
    assert found.findings == ()


@pytest.mark.parametrize("missing", [slice(0, 2), slice(2, 4), slice(-2, None)])
def test_missing_words_are_noticed_where_they_are(missing: slice) -> None:
    words = text("en", "boat").split()
    del words[missing]
    found = outcome(speech("en", "boat"), " ".join(words), "en")
    assert {finding.code for finding in found} & {"align-untranscribed", "align-word-differs"}


@pytest.mark.parametrize("at", [0, 2, 5])
def test_a_word_that_nobody_says_is_named(at: int) -> None:
    words = text("en", "boat").split()
    words.insert(at, "rhinoceros")
    found = outcome(speech("en", "boat"), " ".join(words), "en")
    assert "'rhinoceros'" in found[0].message


def test_the_score_is_a_confidence() -> None:
    good = ALIGNER.align(speech("en", "boat"), text("en", "boat"), language="en")
    bad = ALIGNER.align(speech("en", "boat"), "the " + text("en", "boat")[8:], language="en")
    assert good.score is not None
    assert bad.score is not None
    assert good.score > 0.5 > bad.score
    assert good.findings == ()
    assert bad.findings


def test_words_are_held_to_the_times_that_are_known() -> None:
    recording = joined(speech("en", "five"), speech("en", "five"))
    line = text("en", "five")
    half_s = speech("en", "five").duration_s
    alone = ALIGNER.align(speech("en", "five"), line, language="en").track.words
    for offset_s in (0.0, half_s):
        anchor = Anchor(0, len(line), offset_s, offset_s + half_s, 0.0)
        track = ALIGNER.align(recording, line, language="en", anchors=[anchor]).track
        for word, own in zip(track.words, alone, strict=True):
            assert word.start_s - offset_s == pytest.approx(own.start_s, abs=0.05)


def test_words_that_are_not_at_their_known_times_are_doubtful() -> None:
    line = text("en", "boat")
    end_s = speech("en", "boat").duration_s
    word = line.split()[-1]
    wrong = Anchor(len(line) - len(word), len(line), 0.0, 0.3, 0.0)
    right = Anchor(0, len(line), 0.0, end_s, 0.0)
    codes = [
        {
            f.code
            for f in ALIGNER.align(speech("en", "boat"), line, language="en", anchors=[a]).findings
        }
        for a in (wrong, right)
    ]
    assert "align-anchor-missed" in codes[0]
    assert codes[1] == set()
