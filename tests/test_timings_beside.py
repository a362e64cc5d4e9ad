"""Timings of words beside a recording, from outside: what counts as such, and what comes of it."""

from __future__ import annotations

import json
import shutil
from pathlib import Path
from typing import Any

import pytest

import animeme
from animeme.phones import SILENCE, Word
from conftest import SAMPLE
from support.jobs import SmallJob, run_inline, small_job
from support.jobs import animeme as command
from support.timing_files import FOLDER
from support.word_timings import ctm, lab, srt, vtt, whisperx

Capture = pytest.CaptureFixture[str]
BOAT = SAMPLE / "dialogue" / "en" / "boat.wav"
TEXT = "Mama bought a big blue boat for Bob."
WORDS = ("mama", "bought", "a", "big", "blue", "boat", "for", "bob")


@pytest.fixture(scope="module")
def true_words() -> tuple[Word, ...]:
    return animeme.align(BOAT, TEXT).track.words


@pytest.fixture
def job(tmp_path: Path) -> SmallJob:
    return small_job(tmp_path / "job", "en/boat")


def beside(job: SmallJob, name: str) -> Path:
    return job.dialogue / "en" / name


def test_a_run_uses_subtitles_beside_a_recording(
    job: SmallJob, capsys: Capture, true_words: tuple[Word, ...]
) -> None:
    beside(job, "boat.srt").write_text(srt(true_words), encoding="utf-8")
    assert run_inline(capsys, job).code == 0
    assert [f["code"] for f in job.findings("en/boat")] == ["timings-used"]
    assert job.statuses() == {"en/boat": "ok"}


def test_a_label_file_beside_a_transcript_is_no_second_transcript(
    job: SmallJob, capsys: Capture, true_words: tuple[Word, ...]
) -> None:
    beside(job, "boat.lab").write_text(lab(true_words), encoding="utf-8")
    assert run_inline(capsys, job).code == 0
    assert [f["code"] for f in job.findings("en/boat")] == ["timings-used"]


def test_what_else_lies_beside_a_recording_does_not_matter(job: SmallJob, capsys: Capture) -> None:
    beside(job, "boat.json").write_text('{"take": 3, "words": ["Mama"], "text": ""}')
    beside(job, "boat.tsv").write_text("who\tmood\nada\tglad\n")
    beside(job, "boat.csv").write_text("time_s,lip_gap\n0.0,0.1\n")
    beside(job, "boat.jsonl").write_bytes(b"\x80\x81 nobody's")
    beside(job, "scene.srt").write_text("1\n00:00:00,000 --> 00:00:01,000\nhi\n")
    assert run_inline(capsys, job).code == 0
    assert job.findings("en/boat") == []
    assert job.statuses() == {"en/boat": "ok"}


def test_two_files_of_timings_are_one_too_many(
    job: SmallJob, capsys: Capture, true_words: tuple[Word, ...]
) -> None:
    beside(job, "boat.srt").write_text(srt(true_words), encoding="utf-8")
    beside(job, "boat.json").write_text(whisperx(true_words), encoding="utf-8")
    ran = run_inline(capsys, job)
    ran.says("has 2 files of timings: boat.json, boat.srt", "Keep one", "line-duplicate")
    beside(job, "boat.json").unlink()
    assert run_inline(capsys, job).code == 0


def test_rhubarb_beside_other_timings_does_not_count(
    job: SmallJob, capsys: Capture, true_words: tuple[Word, ...]
) -> None:
    shutil.copy(FOLDER / "rhubarb.json", beside(job, "boat.json"))
    assert run_inline(capsys, job).code == 0
    assert [f["code"] for f in job.findings("en/boat")] == ["timings-without-words"]
    beside(job, "boat.ctm").write_text(ctm(true_words), encoding="utf-8")
    assert run_inline(capsys, job).code == 0
    assert [f["code"] for f in job.findings("en/boat")] == ["timings-used"]


@pytest.mark.parametrize("share", [0.0, 0.4, 0.8])
def test_half_a_file_of_timings_fails_its_line(
    share: float, job: SmallJob, capsys: Capture, true_words: tuple[Word, ...]
) -> None:
    whole = whisperx(true_words)
    beside(job, "boat.json").write_text(whole[: int(len(whole) * share)], encoding="utf-8")
    ran = run_inline(capsys, job)
    ran.says("timings-damaged", "boat.json", "take the file away")
    assert ran.code == 1
    beside(job, "boat.json").write_text(whole, encoding="utf-8")
    assert run_inline(capsys, job).code == 0


def test_one_recording_may_be_aligned_from_its_timings(
    capsys: Capture, true_words: tuple[Word, ...], tmp_path: Path
) -> None:
    path = tmp_path / "boat.vtt"
    path.write_text(vtt(true_words), encoding="utf-8")
    track = animeme.align(BOAT, timings=path).track
    assert tuple(word.text for word in track.words) == WORDS
    assert any(phone.symbol == SILENCE for phone in track.phones)
    ran = command(capsys, "align", BOAT, path, "--json")
    assert ran.code == 0
    document: dict[str, Any] = json.loads(ran.out)
    assert [word["text"] for word in document["words"]] == list(WORDS)
    command(capsys, "align", BOAT, tmp_path / "none.vtt").says("none.vtt", "No such file")
    with pytest.raises(ValueError, match="neither"):
        animeme.align(BOAT)


def test_subtitles_of_another_time_are_named_as_the_reason(job: SmallJob, capsys: Capture) -> None:
    file = beside(job, "boat.srt")
    file.write_text(f"1\n00:00:00,000 --> 00:00:00,300\n{TEXT}\n", encoding="utf-8")
    run_inline(capsys, job)
    (finding,) = [f for f in job.findings("en/boat") if f["severity"] == "error"]
    assert finding["code"] == "align-failed"
    assert finding["place"].endswith("boat.srt")
    assert "at the times that are given" in finding["message"]
    file.unlink()
    assert run_inline(capsys, job).code == 0
