"""Runs that take up what earlier ones did: voices, models of characters, files by hand, exports."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path

import pytest

from support.jobs import Capture, SmallJob, digests, run_inline, small_job
from support.stores import EVERY_STEP, made, rehearsed, results, written

LINES = ("en/boat", "de/boat")
EDITS = """
schema = "animeme.edits/1"
made_for_text = "quite another line"
[[edit]]
do = "offset"
control = "jawOpen"
by = {by}
from = 0.5
to = 1.0
[[edit]]
do = "mute"
control = "jawOpen"
from = 1.0
to = 1.2
character = "lobster"
"""
DRAWN = "time_s,MawGape\n0.0,0.0\n0.5,{by}\n2.5,0.0\n"
BIGRAMS = {"schema": "animeme.bigrams/1", "extends": "facefx"}
FILES = {"en/crab.glb", "de/crab.glb", "en/hermit.glb", "de/hermit.glb"}
HERMIT = {"en/hermit.glb", "de/hermit.glb"}


@pytest.fixture
def done(tmp_path: Path, capsys: Capture) -> SmallJob:
    """Two characters that speak two lines, run once; the hermit has a model of its own."""
    job = small_job(tmp_path / "job", *LINES)
    job.sections["characters.hermit"] = {"asset": "crab.glb", "rig": "hermit.rig.toml"}
    job.sections["characters.hermit.model"] = {"file": "own.json"}
    job.sections["align"] = {"voices": "voices"}
    rig = (job.folder / "crab.rig.toml").read_text(encoding="utf-8")
    (job.folder / "hermit.base.toml").write_text(rig, encoding="utf-8")
    write(
        job,
        "hermit.rig.toml",
        'schema = "animeme.rig/2"\nname = "hermit"\nextends = "hermit.base.toml"\n',
    )
    write(job, "base.json", json.dumps({**BIGRAMS, "speed": 12.0}))
    write(job, "own.json", json.dumps({**BIGRAMS, "extends": "base.json"}))
    (job.folder / "voices").mkdir()
    assert run_inline(capsys, job).code == 0
    assert made(job) == dict.fromkeys(LINES, EVERY_STEP)
    return job


def write(job: SmallJob, name: str, text: str) -> None:
    (job.folder / name).write_text(text, encoding="utf-8")


def voice(job: SmallJob) -> None:
    write(job, "voices/de.voice", "no voice")


def edits(job: SmallJob) -> None:
    write(job, "dialogue/en/boat.edits.toml", EDITS.replace("{by}", "0.2"))


def edits_of_one(job: SmallJob) -> None:
    write(job, "dialogue/en/boat.hermit.edits.toml", EDITS.replace("{by}", "0.2"))


def drawn(job: SmallJob) -> None:
    write(job, "dialogue/en/boat.curves.csv", DRAWN.replace("{by}", "0.4"))


def own_model(job: SmallJob) -> None:
    job.sections["characters.hermit.model"] = {"name": "cohen-massaro"}


def base_of_own_model(job: SmallJob) -> None:
    write(job, "base.json", json.dumps({**BIGRAMS, "speed": 9.0}))


def base_of_rig(job: SmallJob) -> None:
    path = job.folder / "hermit.base.toml"
    text = path.read_text(encoding="utf-8")
    path.write_text(text.replace("gain = 1.4", "gain = 1.2", 1), encoding="utf-8")


def preroll(job: SmallJob) -> None:
    job.sections["curves"] = {"preroll_s": 0.25}


def frame_rate(job: SmallJob) -> None:
    job.sections["curves"] = {"keys": "uniform", "frame_rate": 24}


def offset(job: SmallJob) -> None:
    job.sections["curves"] = {"offset_s": 0.1}


def both(*steps: str) -> dict[str, set[str]]:
    return {line: set(steps) for line in LINES}


ENGLISH = {"en/crab.glb", "en/hermit.glb"}
CASES: dict[str, tuple[Callable[[SmallJob], None], dict[str, set[str]], set[str], str]] = {
    "voice": (voice, {"en/boat": set(), "de/boat": {"align"}}, set(), "voice"),
    "edits": (edits, {"en/boat": {"retarget"}, "de/boat": set()}, ENGLISH, "edits by hand"),
    "edits of one": (
        edits_of_one,
        {"en/boat": {"retarget"}, "de/boat": set()},
        {"en/hermit.glb"},
        "edits by hand",
    ),
    "drawn": (drawn, {"en/boat": {"retarget"}, "de/boat": set()}, ENGLISH, "curves by hand"),
    "own model": (own_model, both("synthesize", "retarget"), HERMIT, "model"),
    "base of own model": (base_of_own_model, both("synthesize", "retarget"), HERMIT, "model"),
    "base of rig": (base_of_rig, both("retarget"), HERMIT, "rig"),
    "pre-roll": (preroll, both("synthesize", "retarget"), FILES, "curve settings"),
    "frame rate": (frame_rate, both("retarget"), FILES, "curve settings"),
    "offset": (offset, both("retarget"), FILES, "curve settings"),
}


@pytest.mark.slow
@pytest.mark.parametrize("case", CASES)
def test_a_change_does_again_what_depends_on_it_and_nothing_else(
    case: str, done: SmallJob, capsys: Capture
) -> None:
    change, steps, files, cause = CASES[case]
    first = digests(done.output)
    change(done)
    told = rehearsed(capsys, done)
    stale = {line for line, anew in steps.items() if anew}
    assert {entry["line"] for entry in told["lines"]} == stale
    assert all(cause in entry["causes"] for entry in told["lines"])

    code = run_inline(capsys, done).code
    assert code == (1 if case == "voice" else 0)
    assert made(done) == steps
    assert written(done) == files
    assert digests(done.output) != first
    after = results(done)

    # Nothing is left to do, and what was said of the edits is said again.
    assert run_inline(capsys, done).code == code
    assert made(done) == both()
    assert written(done) == set()
    assert results(done) == after

    assert run_inline(capsys, done, "--no-cache").code == code
    assert results(done) == after


@pytest.mark.slow
def test_what_was_done_by_hand_is_kept_and_can_be_taken_back(
    done: SmallJob, capsys: Capture
) -> None:
    first = results(done)
    edits(done)
    assert run_inline(capsys, done).code == 0
    codes = {finding["code"] for finding in done.findings("en/boat")}
    assert {"edits-text-changed", "edit-character-unknown"} <= codes
    edited = results(done)
    write(done, "dialogue/en/boat.edits.toml", EDITS.replace("{by}", "0.3"))
    assert run_inline(capsys, done).code == 0
    assert made(done)["en/boat"] == {"retarget"}
    assert results(done) != edited
    (done.dialogue / "en/boat.edits.toml").unlink()
    assert run_inline(capsys, done).code == 0
    assert made(done) == both()
    assert results(done) == first

    drawn(done)
    own_model(done)
    assert run_inline(capsys, done).code == 0
    # No model moves what was drawn.
    assert made(done) == {"en/boat": {"retarget"}, "de/boat": {"synthesize", "retarget"}}


@pytest.mark.slow
def test_curve_files_are_made_again_where_they_are_missing(done: SmallJob, capsys: Capture) -> None:
    done.sections["curves"] = {"export": ["csv"]}
    assert run_inline(capsys, done).code == 0
    assert made(done) == both()
    assert written(done) == FILES
    first = results(done)
    assert run_inline(capsys, done).code == 0
    assert written(done) == set()
    assert results(done) == first
    (file,) = done.output.glob("curves/crab/en/boat*")
    file.unlink()
    assert run_inline(capsys, done).code == 0
    assert written(done) == {"en/crab.glb"}
    assert results(done) == first


@pytest.mark.slow
def test_a_package_is_made_again_where_a_recording_in_it_changed(
    tmp_path: Path, capsys: Capture
) -> None:
    job = small_job(tmp_path / "job", *LINES)
    job.asset("crab.usdc")
    job.sections["characters.crab"] |= {"asset": "crab.usdc", "usdz": True}
    assert run_inline(capsys, job).code == 0
    first = results(job)
    assert "crab.usdz" in first
    assert run_inline(capsys, job).code == 0
    assert written(job) == set()
    assert results(job) == first

    # The same sound, so nothing else changes.
    audio = job.dialogue / "en/boat.wav"
    audio.write_bytes(audio.read_bytes() + b"LIST\x04\x00\x00\x00INFO")
    assert run_inline(capsys, job).code == 0
    after = results(job)
    assert after["crab.usdz"] != first["crab.usdz"]
    assert run_inline(capsys, job, "--no-cache").code == 0
    assert results(job) == after
