"""``animeme run``, from outside: what goes where, and what people and programs are told."""

from __future__ import annotations

import contextlib
import json
import os
import pty
import shutil
import subprocess
import tomllib
from pathlib import Path

import pytest

from support.jobs import (
    CONSOLE,
    SAMPLE,
    Capture,
    Ran,
    SmallJob,
    animeme,
    console,
    digests,
    run_inline,
    small_job,
)
from support.schemas import validate

# What `run --json` says beyond the report.
EFFORT = {
    *("output", "wall_s", "cpu_s", "real_time_factor", "known_lines", "files", "known_files"),
    *("step_s", "step_results"),
}


def job_of_two(folder: Path) -> SmallJob:
    """Both characters in both formats, three languages, two lines in one of them."""
    job = small_job(folder, "en/boat", "en/five", "de/boat", "es/boat")
    job.asset("crab.usdc")
    job.sections["characters.crab"]["asset"] = ["crab.glb", "crab.usdc"]
    job.sections["characters.ada"] = {
        "asset": [job.asset(f"ada.{s}").name for s in ("glb", "usdc")]
    }
    job.write()
    return job


@pytest.fixture(scope="session")
def two(tmp_path_factory: pytest.TempPathFactory) -> SmallJob:
    return job_of_two(tmp_path_factory.mktemp("two") / "job")


@pytest.fixture(scope="session")
def ran_in_two(two: SmallJob) -> Ran:
    """The job of two, run as a nightly job would: its own process, two workers, JSON."""
    return console("run", two.file, "--workers", 2, "--json")


def test_run_prints_one_json_document_and_nothing_else(ran_in_two: Ran, two: SmallJob) -> None:
    assert ran_in_two.code == 0
    document = json.loads(ran_in_two.out)
    assert document["output"] == str(two.output)
    assert document["wall_s"] > 0
    assert document["cpu_s"] > 0
    report = {key: value for key, value in document.items() if key not in EFFORT}
    validate("report", report)
    assert report == two.report()


def test_run_tells_people_on_stderr(ran_in_two: Ran, two: SmallJob) -> None:
    ran_in_two.says("lines: 4/4", "assets: 12/12", "| en | crab | 2 | 2 | 0 | 0 |")
    ran_in_two.says("de/crab.usdc", f"Everything is in {two.output}")
    assert (two.output / "summary.md").read_text(encoding="utf-8") in ran_in_two.err


def test_run_writes_what_its_help_promises(ran_in_two: Ran, two: SmallJob) -> None:
    assert ran_in_two.code == 0
    delivered = [f"{who}.usda" for who in ("ada", "crab")] + [
        f"{language}/{who}.{suffix}"
        for language in ("de", "en", "es")
        for who in ("ada", "crab")
        for suffix in ("glb", "usdc")
    ]
    assert two.report()["outputs"] == sorted(delivered)
    alignments = [
        f"alignments/{line}.json" for line in ("de/boat", "en/boat", "en/five", "es/boat")
    ]
    reports = ["junit.xml", "report.json", "report.sarif", "run.jsonl", "summary.md"]
    assert sorted(digests(two.output)) == sorted([*delivered, *alignments, *reports])
    assert two.animations("en/ada.glb") == two.animations("en/ada.usdc") == {"boat", "five"}


def test_documents_of_a_run_keep_to_their_schemas(ran_in_two: Ran, two: SmallJob) -> None:
    assert ran_in_two.code == 0
    validate("report", two.report())
    validate("job", tomllib.loads(two.file.read_text(encoding="utf-8")))
    for path in two.output.glob("alignments/*/*.json"):
        validate("alignment", json.loads(path.read_text(encoding="utf-8")))


@pytest.mark.parametrize(
    "options",
    [
        pytest.param(("--workers", "1"), id="one-worker"),
        pytest.param(("--executor", "inline"), id="inline"),
    ],
)
def test_every_executor_writes_the_same_bytes(
    options: tuple[str, ...], ran_in_two: Ran, two: SmallJob, tmp_path: Path, capsys: Capture
) -> None:
    # As deep as the other output, and in the same folder, so that relative paths agree.
    output = two.folder / options[-1]
    try:
        ran = animeme(capsys, "run", two.file, "--output", output, *options)
        assert ran.code == ran_in_two.code == 0
        first, second = digests(two.output), digests(output)
    finally:
        shutil.rmtree(output, ignore_errors=True)
    del first["run.jsonl"], second["run.jsonl"]
    assert second == first


def test_a_second_run_over_the_first_writes_the_same_bytes(tmp_path: Path, capsys: Capture) -> None:
    job = small_job(tmp_path / "job", "en/boat", "de/boat")
    assert run_inline(capsys, job).code == 0
    first = digests(job.output)
    assert run_inline(capsys, job).code == 0
    second = digests(job.output)
    del first["run.jsonl"], second["run.jsonl"]
    assert second == first


def test_a_line_to_review_fails_the_run_only_where_asked(tmp_path: Path, capsys: Capture) -> None:
    job = small_job(tmp_path / "job", "en/boat", "en/moon")
    text = (SAMPLE / "dialogue/en/moon.txt").read_text(encoding="utf-8")
    (job.dialogue / "en/moon.txt").write_text(f"Rhinoceros {text}", encoding="utf-8")
    plain = run_inline(capsys, job)
    assert plain.code == 0
    assert job.statuses() == {"en/boat": "ok", "en/moon": "review"}
    plain.says("en/moon", "may differ", "'rhinoceros'", "Listen to the line")
    assert job.animations() == {"boat", "moon"}

    strict = run_inline(capsys, job, "--fail-on", "warning")
    assert strict.code == 1
    assert job.report()["exit_code"] == 1
    assert job.statuses() == {"en/boat": "ok", "en/moon": "review"}

    job.line("en/moon", like="en/moon")
    assert run_inline(capsys, job, "--fail-on", "warning").code == 0


def test_output_on_the_command_line_goes_before_the_jobs(tmp_path: Path, capsys: Capture) -> None:
    job = small_job(tmp_path / "job")
    elsewhere = tmp_path / "else where"
    assert run_inline(capsys, job, "--output", elsewhere).code == 0
    assert (elsewhere / "en" / "crab.glb").is_file()
    assert not job.output.exists()


def test_per_line_layout_writes_a_file_per_line(tmp_path: Path, capsys: Capture) -> None:
    job = small_job(tmp_path / "job", "en/boat", "en/five")
    job.line("en/scene 1/take.2", like="en/moon")
    job.asset("crab.usdc")
    job.sections["characters.crab"] |= {"layout": "per-line", "asset": ["crab.glb", "crab.usdc"]}
    assert run_inline(capsys, job).code == 0
    lines = ("boat", "five", "scene 1/take.2")
    expected = sorted(f"en/crab/{line}.{suffix}" for line in lines for suffix in ("glb", "usdc"))
    assert job.report()["outputs"] == expected
    assert all((job.output / path).is_file() for path in expected)
    for line in lines:
        assert len(job.animations(f"en/crab/{line}.glb")) == 1
        (entry,) = [e for e in job.report()["lines"] if e["line"] == f"en/{line}"]
        assert entry["outputs"] == [f"en/crab/{line}.{suffix}" for suffix in ("glb", "usdc")]


def test_a_line_in_a_characters_folder_is_spoken_by_nobody_else(
    tmp_path: Path, capsys: Capture
) -> None:
    job = small_job(tmp_path / "job", "en/boat")
    job.line("en/twin/five", like="en/five")
    shutil.copy(job.folder / "crab.glb", job.folder / "twin.glb")
    job.sections["characters.twin"] = {"asset": "twin.glb", "rig": "crab.rig.toml"}
    assert run_inline(capsys, job).code == 0
    assert job.animations("en/crab.glb") == {"boat"}
    assert job.animations("en/twin.glb") == {"boat", "five"}


def test_names_and_texts_may_be_in_any_script(tmp_path: Path) -> None:
    job = small_job(tmp_path / "größe 日本", "en/boat")
    job.line("en/Schöne Grüße 🎬", like="en/five")
    text = "“Five” 🐟 little fishes — it’s… said!\n"
    (job.dialogue / "en/Schöne Grüße 🎬.txt").write_text(text, encoding="utf-8")
    original = (SAMPLE / "dialogue/en/five.txt").read_text(encoding="utf-8")
    (job.dialogue / "en/moon 月.txt").write_text(f"“{original.strip()}” 🎬", encoding="utf-8")
    shutil.copy(SAMPLE / "dialogue/en/five.wav", job.dialogue / "en/moon 月.wav")
    ran = console("run", job.write(), "--workers", 1, "--json")
    ran.says("größe 日本")
    assert ran.code in (0, 1)
    assert job.statuses()["en/moon 月"] == "ok"
    assert {"boat", "moon 月"} <= job.animations()
    assert json.loads(ran.out)["lines"][-1]["line"] == "en/moon 月"
    job.assert_tidy()


def test_json_reaches_a_pipe_of_any_encoding(tmp_path: Path) -> None:
    job = small_job(tmp_path / "日本")
    env = {"PYTHONIOENCODING": "latin-1", "PYTHONUTF8": "0"}
    ran = console("run", job.write(), "--workers", 1, "--json", env=env)
    ran.says("Everything is in")
    assert ran.code == 0
    assert json.loads(ran.out)["output"] == str(job.output)


def test_a_terminal_gets_a_progress_bar(tmp_path: Path) -> None:
    job = small_job(tmp_path / "job")
    ours, terminal = pty.openpty()
    command = [str(CONSOLE), "run", str(job.write()), "--executor", "inline"]
    with subprocess.Popen(command, stdin=terminal, stdout=terminal, stderr=terminal) as process:
        os.close(terminal)
        shown = b""
        with open(ours, "rb", buffering=0) as stream, contextlib.suppress(OSError):
            while part := stream.read(4096):  # fails where the other end is closed
                shown += part
    text = shown.decode("utf-8")
    assert process.returncode == 0
    assert "Traceback" not in text
    assert "1/1" in text
    assert "Everything is in" in text
