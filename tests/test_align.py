"""Alignment of the sample's lines: right ones pass, wrong ones are refused or flagged."""

from __future__ import annotations

from functools import cache
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from animeme.contracts import Alignment, Speech
from animeme.errors import InputError
from animeme.findings import Finding
from animeme.phones import SILENCE, Phone, PhoneTrack
from animeme_stages.align.aligner import LONGEST_PIECE_S, PocketSphinxAligner, _pieces
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


@given(
    st.lists(st.tuples(st.booleans(), st.integers(1, 900)), min_size=1, max_size=60),
    st.integers(0, 30),
)
@settings(deadline=None, derandomize=True, max_examples=300)
def test_pieces_cover_the_recording_and_every_word_once(
    entries: list[tuple[bool, int]], rest: int
) -> None:
    heard, at = [], 0
    for number, (pause, length) in enumerate(entries):
        heard.append(("<sil>" if pause else f"w{number}", at, at + length - 1))
        at += length
    words = sum(not pause for pause, _ in entries)
    found = list(_pieces(heard, at + rest))
    assert (found[0][0], found[-1][1]) == (0, at + rest)
    assert (found[0][2], found[-1][3]) == (0, words)
    for (_, end, _, last), (start, _, first, _) in pairwise(found):
        assert (end, last) == (start, first)
    for start, end, first, last in found:
        assert start < end
        assert first < last or len(found) == 1


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
