"""`animeme run` for some of the lines: what is worked on, what is written, what stays."""

from __future__ import annotations

import shutil
from pathlib import Path
from typing import Any

import pytest

from animeme import registry
from support.jobs import Capture, Ran, SmallJob, animeme, digests, run_inline, small_job
from support.stores import EVERY_STEP, made, rehearsed, results

LINES = ("en/boat", "en/five", "de/boat")
REPORTS = {"report.json", "summary.md", "junit.xml", "report.sarif", "run.jsonl"}


@pytest.fixture
def done(tmp_path: Path, capsys: Capture) -> SmallJob:
    job = small_job(tmp_path / "job", *LINES)
    assert run_inline(capsys, job).code == 0
    return job


def say(job: SmallJob, line: str, more: str = "now") -> None:
    """Change a line's text, and so what is made of it."""
    path = job.dialogue / f"{line}.txt"
    path.write_text(path.read_text(encoding="utf-8").strip() + f" {more}\n", encoding="utf-8")


def lines_of(job: SmallJob) -> dict[str, set[str]]:
    """Line in the report → codes of its findings."""
    return {
        entry["line"]: {finding["code"] for finding in entry["findings"]}
        for entry in job.report()["lines"]
    }


def as_if_whole(capsys: Capture, job: SmallJob) -> dict[str, str]:
    """What a run of everything leaves that keeps no store, and has no output to begin with."""
    shutil.rmtree(job.output)
    assert run_inline(capsys, job, "--no-cache").code == 0
    return results(job)


def curves(job: SmallJob) -> dict[str, Any]:
    """Weights by animation."""
    path = job.output / "en/crab.glb"
    return {name: c.weights for name, c in registry.format_of(path).read_animations(path).items()}


def test_only_selected_lines_are_worked_on(done: SmallJob, capsys: Capture) -> None:
    before, animated = results(done), curves(done)
    for line in LINES:
        say(done, line)
    said = rehearsed(capsys, done, "--lines", "en/boat")
    assert [entry["line"] for entry in said["lines"]] == ["en/boat"]
    assert said["outdated"] == [{"line": "en/five", "causes": ["text"]}]
    assert said["files"] == ["en/crab.glb"]

    ran = run_inline(capsys, done, "--lines", "en/boat")
    assert ran.code == 0
    assert made(done) == {"en/boat": {"align", "synthesize", "retarget"}, "en/five": set()}
    codes = lines_of(done)
    assert "line-outdated" in codes["en/five"]
    assert "line-outdated" not in codes["en/boat"]
    assert set(codes) == {"en/boat", "en/five"}, "the report is about the files that were written"
    ran.says("1 of 3 lines were asked for (lines en/boat), which share their files with 1 more")
    after = results(done)
    changed = {name for name, digest in after.items() if before[name] != digest}
    assert changed - REPORTS == {"en/crab.glb", "alignments/en/boat.json"}
    assert curves(done)["boat"].shape != animated["boat"].shape
    assert (curves(done)["five"] == animated["five"]).all()

    # The line that stays does so again; then all is as if nobody had selected anything.
    said = rehearsed(capsys, done, "--lines", "en/boat")
    assert (said["lines"], said["files"]) == ([], [])
    assert run_inline(capsys, done, "--lines", "en/boat").code == 0
    assert (curves(done)["five"] == animated["five"]).all()
    assert "line-outdated" in lines_of(done)["en/five"]
    assert run_inline(capsys, done).code == 0
    assert made(done) == {"en/boat": set(), "en/five": EVERY_STEP, "de/boat": EVERY_STEP}
    assert "line-outdated" not in lines_of(done)["en/five"]
    assert results(done) == as_if_whole(capsys, done)


@pytest.mark.slow
def test_languages_come_one_by_one_into_the_file_that_joins_them(
    tmp_path: Path, capsys: Capture
) -> None:
    job = small_job(tmp_path / "job", "en/boat", "de/boat")
    job.sections["characters.crab"] |= {"asset": job.asset("crab.usdc").name, "usdz": True}
    assert run_inline(capsys, job, "--language", "English").code == 0
    layer = (job.output / "en/crab.usdc").read_bytes()
    joined = (job.output / "crab.usda").read_text(encoding="utf-8")
    assert ('"en"' in joined, '"de"' in joined) == (True, False)
    assert not (job.output / "alignments/de").exists()
    say(job, "en/boat")
    assert run_inline(capsys, job, "--language", "de").code == 0
    joined = (job.output / "crab.usda").read_text(encoding="utf-8")
    assert ('"en"' in joined, '"de"' in joined) == (True, True)
    assert (job.output / "en/crab.usdc").read_bytes() == layer
    assert "output-stale" not in {f["code"] for f in job.report()["findings"]}
    assert set(lines_of(job)) == {"de/boat"}
    assert run_inline(capsys, job).code == 0
    assert results(job) == as_if_whole(capsys, job)


@pytest.mark.slow
def test_one_character_of_two_that_say_the_same(tmp_path: Path, capsys: Capture) -> None:
    job = small_job(tmp_path / "job", "en/boat", "en/five")
    job.sections["characters.ada"] = {"asset": job.asset("ada.glb").name}
    assert run_inline(capsys, job, "--character", "ada").code == 0
    assert sorted(path.name for path in (job.output / "en").iterdir()) == ["ada.glb"]
    assert {entry["character"] for entry in job.report()["lines"]} == {"ada"}
    assert run_inline(capsys, job).code == 0
    crab = (job.output / "en/crab.glb").read_bytes()
    say(job, "en/boat")
    assert run_inline(capsys, job, "--character", "ada", "--lines", "*boat").code == 0
    assert (job.output / "en/crab.glb").read_bytes() == crab
    assert run_inline(capsys, job).code == 0
    assert results(job) == as_if_whole(capsys, job)


def test_what_nothing_is_known_of_is_done_too(tmp_path: Path, capsys: Capture) -> None:
    job = small_job(tmp_path / "job", *LINES)
    changes = tmp_path / "changes.txt"
    changes.write_text("docs/readme.md\njob/dialogue/en/boat.txt\n", encoding="utf-8")
    ran = run_inline(capsys, job, "--changed", changes)
    assert ran.code == 0
    assert made(job) == {"en/boat": EVERY_STEP, "en/five": EVERY_STEP}
    assert "line-added" in lines_of(job)["en/five"]
    assert not (job.output / "de").exists()

    changes.write_text("", encoding="utf-8")
    before = digests(job.output)
    ran = run_inline(capsys, job, "--changed", changes)
    assert ran.code == 0
    ran.says("0 of 3 lines were asked for")
    after = digests(job.output)
    assert {name for name in before if after[name] != before[name]} <= REPORTS


def refused(capsys: Capture, job: SmallJob, *options: object) -> Ran:
    ran = animeme(capsys, "run", job.write(), "--executor", "inline", *options)
    assert ran.code == 2
    return ran


def test_what_cannot_be_selected_is_refused(tmp_path: Path, capsys: Capture) -> None:
    job = small_job(tmp_path / "job", "en/boat")
    refused(capsys, job, "--language", "fr").says("no line fits language fr", "animeme lines")
    refused(capsys, job, "--lines", "act9/*").says("no line fits lines act9/*")
    refused(capsys, job, "--changed", tmp_path / "none.txt").says("none.txt", "cannot be read")
    assert not job.output.exists()
