"""Runs that take up what earlier ones did: exactly what has changed is done again."""

from __future__ import annotations

import json
import os
import shutil
import sqlite3
import struct
from collections.abc import Callable
from contextlib import closing
from pathlib import Path

import pytest

from animeme.batch import run
from animeme.work import Progress
from support.jobs import SAMPLE, Capture, SmallJob, animeme, run_inline, small_job
from support.schemas import validate
from support.stores import EVERY_STEP, made, rehearsed, results, written

LINES = ("en/boat", "en/five")


@pytest.fixture
def done(tmp_path: Path, capsys: Capture) -> SmallJob:
    """A job of two lines that has been run."""
    job = small_job(tmp_path / "job", *LINES)
    assert run_inline(capsys, job).code == 0
    assert made(job) == dict.fromkeys(LINES, EVERY_STEP)
    return job


def test_a_run_with_nothing_changed_does_nothing_and_says_the_same(
    done: SmallJob, capsys: Capture
) -> None:
    first = results(done)
    ran = run_inline(capsys, done)
    assert ran.code == 0
    assert made(done) == {key: set() for key in LINES}
    assert written(done) == set()
    assert results(done) == first
    ran.says("2 of 2 lines and 1 of 1 files were there already")


def test_what_another_version_noted_of_a_job_is_found_out_anew(
    done: SmallJob, capsys: Capture
) -> None:
    for path in (Path(os.environ["ANIMEME_CACHE"]) / "index").glob("*.sqlite"):
        with closing(sqlite3.connect(path)) as index, index:
            change = "UPDATE notes SET value = replace(value, '\"suffix\"', '\"ending\"')"
            assert index.execute(f"{change} WHERE value LIKE '%\"suffix\"%'").rowcount == 1
    for _ in range(2):
        assert run_inline(capsys, done).code == 0
        assert made(done) == {key: set() for key in LINES}


def louder(job: SmallJob) -> None:
    """Change one sample of a recording."""
    path = job.dialogue / "en/boat.wav"
    data = bytearray(path.read_bytes())
    (sample,) = struct.unpack_from("<h", data, 4000)
    struct.pack_into("<h", data, 4000, sample + 40)
    path.write_bytes(data)


def other_text(job: SmallJob) -> None:
    path = job.dialogue / "en/boat.txt"
    path.write_text(path.read_text(encoding="utf-8").strip() + " now\n", encoding="utf-8")


def timings(job: SmallJob) -> None:
    alignment = (job.output / "alignments/en/boat.json").read_text(encoding="utf-8")
    (job.dialogue / "en/boat.json").write_text(alignment, encoding="utf-8")


def other_model(job: SmallJob) -> None:
    job.sections["model"] = {"name": "cohen-massaro"}


def other_rate(job: SmallJob) -> None:
    job.sections["curves"] = {"rate_hz": 50.0}


def other_bound(job: SmallJob) -> None:
    job.sections["curves"] = {"max_error": 0.01}


def other_rig(job: SmallJob) -> None:
    path = job.folder / "crab.rig.toml"
    text = path.read_text(encoding="utf-8")
    assert "gain = " in text
    number = text.split("gain = ")[1].split()[0].rstrip(",}]")
    path.write_text(text.replace(f"gain = {number}", "gain = 0.37", 1), encoding="utf-8")


def same_rig_otherwise_written(job: SmallJob) -> None:
    path = job.folder / "crab.rig.toml"
    path.write_text("# the crab's\n" + path.read_text(encoding="utf-8"), encoding="utf-8")


ONE_LINE = {"en/boat": EVERY_STEP, "en/five": set[str]()}


@pytest.mark.parametrize(
    ("change", "expected", "cause"),
    [
        (louder, ONE_LINE, "audio"),
        (other_text, ONE_LINE, "text"),
        (timings, ONE_LINE, "timings"),
        (other_model, {key: {"synthesize", "retarget"} for key in LINES}, "model"),
        (other_rate, {key: {"synthesize", "retarget"} for key in LINES}, "curve settings"),
        (other_bound, {key: {"retarget"} for key in LINES}, "curve settings"),
        (other_rig, {key: {"retarget"} for key in LINES}, "rig"),
    ],
)
def test_a_change_does_again_what_depends_on_it_and_nothing_else(
    change: Callable[[SmallJob], None],
    expected: dict[str, set[str]],
    cause: str,
    done: SmallJob,
    capsys: Capture,
) -> None:
    change(done)
    told = rehearsed(capsys, done)
    stale = {line for line, steps in expected.items() if steps}
    assert {entry["line"] for entry in told["lines"]} == stale
    assert all(cause in entry["causes"] for entry in told["lines"])
    assert told["files"] == ["en/crab.glb"]

    assert run_inline(capsys, done).code == 0
    found = made(done)
    # With timings of its own the line's phones, and so its curves, may come out as they were.
    found = {line: steps if line in stale else set() for line, steps in found.items()}
    if change is timings:
        assert "align" in found["en/boat"]
    else:
        assert found == expected
    after = results(done)
    fresh = run_inline(capsys, done, "--no-cache", "--output", done.output)
    assert fresh.code == 0
    assert results(done) == after


def test_a_document_that_says_the_same_changes_nothing(done: SmallJob, capsys: Capture) -> None:
    same_rig_otherwise_written(done)
    assert run_inline(capsys, done).code == 0
    assert made(done) == {key: set() for key in LINES}
    assert written(done) == set()


def test_a_lexicon_does_those_lines_again_that_have_its_words(
    done: SmallJob, capsys: Capture
) -> None:
    lexicon = done.folder / "own.dict"
    lexicon.write_text("crustacean  K R AH S T EY SH AH N\n", encoding="utf-8")
    done.sections["align"] = {"lexicon": lexicon.name}
    assert rehearsed(capsys, done)["lines"] == []
    assert run_inline(capsys, done).code == 0
    assert made(done) == {key: set() for key in LINES}

    lexicon.write_text("five  F IY V\n", encoding="utf-8")
    assert rehearsed(capsys, done)["lines"] == [{"line": "en/five", "causes": ["lexicon"]}]
    assert run_inline(capsys, done).code == 0
    assert made(done)["en/boat"] == set()
    assert "align" in made(done)["en/five"]

    lexicon.write_text("five  F IY V\nhermit  HH ER M IH T\n", encoding="utf-8")
    assert run_inline(capsys, done).code == 0
    assert made(done) == {key: set() for key in LINES}


def test_results_are_taken_up_in_another_folder_by_another_output(
    done: SmallJob, tmp_path: Path, capsys: Capture
) -> None:
    other = SmallJob(tmp_path / "elsewhere", done.sections)
    shutil.copytree(done.folder, other.folder, ignore=shutil.ignore_patterns("out"))
    assert run_inline(capsys, other).code == 0
    assert made(other) == {key: set() for key in LINES}
    assert results(other) == results(done)


@pytest.mark.parametrize("how", ["deleted", "changed", "cut short"])
@pytest.mark.parametrize("file", ["en/crab.glb", "alignments/en/boat.json"])
def test_an_output_that_somebody_touched_is_put_right(
    how: str, file: str, done: SmallJob, capsys: Capture
) -> None:
    first, path = results(done), done.output / file
    if how == "deleted":
        path.unlink()
    elif how == "changed":
        path.write_bytes(path.read_bytes()[:-1] + b" ")
    else:
        path.write_bytes(path.read_bytes()[:100])
    assert run_inline(capsys, done).code == 0
    assert results(done) == first
    assert made(done) == {key: set() for key in LINES}


@pytest.mark.parametrize("executor", ["inline", "local"])  # one looks at files while it works
def test_of_a_file_per_line_those_are_written_that_change_or_are_not_there(
    executor: str, tmp_path: Path, capsys: Capture
) -> None:
    job = small_job(tmp_path / "job", "en/boat", "en/five", "en/moon", "en/think")
    job.asset("crab.usdc")
    job.sections["characters.crab"] |= {"asset": ["crab.glb", "crab.usdc"], "layout": "per-line"}
    assert run_inline(capsys, job).code == 0
    first = results(job)
    other_text(job)
    (job.output / "en/crab/five.glb").unlink()
    (job.output / "en/crab/moon.usdc").write_bytes(b"")
    ran = run_inline(capsys, job, "--executor", executor)
    ran.says("3 of 4 lines and 4 of 8 files were there already")
    again = {f"en/crab/{name}" for name in ("boat.glb", "boat.usdc", "five.glb", "moon.usdc")}
    assert written(job) == again
    files = [path for path in first if path.startswith("en/crab/")]
    assert len(files) == 8
    other = {path for path in files if results(job)[path] != first[path]}
    assert other == {"en/crab/boat.glb", "en/crab/boat.usdc"}


def test_a_file_that_cannot_be_written_keeps_no_other_asset_from_its_line(
    tmp_path: Path, capsys: Capture
) -> None:
    job = small_job(tmp_path / "job", *LINES)
    job.asset("crab.usdc")
    job.sections["characters.crab"] |= {"asset": ["crab.glb", "crab.usdc"], "layout": "per-line"}
    (job.output / "en/crab/boat.glb/in the way").mkdir(parents=True)
    for _ in range(2):
        assert run_inline(capsys, job).code == 1
        assert job.statuses() == {"en/boat": "failed", "en/five": "ok"}
        files = {path.name for path in (job.output / "en/crab").iterdir() if path.is_file()}
        assert files == {"boat.usdc", "five.glb", "five.usdc"}
    assert written(job) == {"en/crab/boat.glb"}


def test_files_of_an_asset_that_was_replaced_meanwhile_are_not_taken_for_its_own(
    tmp_path: Path, capsys: Capture
) -> None:
    job = small_job(tmp_path / "job", *LINES)
    job.sections["characters.crab"]["layout"] = "per-line"
    assert run_inline(capsys, job).code == 0
    first = results(job)
    shutil.rmtree(job.output)
    asset = job.folder / "crab.glb"
    old = asset.read_bytes()

    told: list[Progress] = []

    def replace_asset(event: Progress) -> None:
        told.extend([event] if event.stage == "assets" else [])
        if len(told) == 2 and asset.read_bytes() == old:  # files have been looked for, not written
            asset.write_bytes(old.replace(b'"generator"', b'"Generator"'))
            assert asset.read_bytes() != old

    report = run(job.file, listener=replace_asset)
    assert [finding.code for finding in report.findings] == ["source-changed"]
    assert results(job)["en/crab/five.glb"] != first["en/crab/five.glb"]
    asset.write_bytes(old)
    assert run_inline(capsys, job).code == 0
    assert results(job) == first


def test_the_working_folder_may_be_the_output_folder(
    tmp_path: Path, capsys: Capture, monkeypatch: pytest.MonkeyPatch
) -> None:
    job = small_job(tmp_path / "job", "en/boat")
    file = job.write()
    (tmp_path / "here").mkdir()
    monkeypatch.chdir(tmp_path / "here")
    for known in (0, 1):
        ran = animeme(
            capsys, "run", file, "--output", ".", "--fail-on", "info", "--executor", "inline"
        )
        assert ran.code == 0, ran.err
        ran.says(f"{known} of 1 lines and {known} of 1 files were there already")
        assert Path("en/crab.glb").is_file()


def test_a_store_that_is_damaged_or_gone_costs_time_and_nothing_else(
    done: SmallJob, cache: Path, capsys: Capture
) -> None:
    first = results(done)
    entries = sorted(path for path in (cache / "store").rglob("*") if path.is_file())
    assert len(entries) > 6
    for number, path in enumerate(entries):
        data = path.read_bytes()
        path.write_bytes([data[: len(data) // 2], b"", data[:-1] + b"?"][number % 3])
    shutil.rmtree(done.output)
    assert run_inline(capsys, done).code == 0
    assert results(done) == first
    assert animeme(capsys, "cache", "verify").code == 0

    shutil.rmtree(cache)
    shutil.rmtree(done.output)
    assert run_inline(capsys, done).code == 0
    assert made(done) == dict.fromkeys(LINES, EVERY_STEP)
    assert results(done) == first


def test_what_is_wrong_with_a_line_is_said_again_word_for_word(
    tmp_path: Path, capsys: Capture
) -> None:
    job = small_job(tmp_path / "job", "en/boat", "en/five", "en/moon")
    (job.dialogue / "en/five.wav").write_bytes(b"RIFF")
    text = (job.dialogue / "en/moon.txt").read_text(encoding="utf-8")
    (job.dialogue / "en/moon.txt").write_text(f"Rhinoceros {text}", encoding="utf-8")
    assert run_inline(capsys, job).code == 1
    first = results(job)
    assert job.statuses()["en/five"] == "failed"
    assert run_inline(capsys, job).code == 1
    assert made(job) == {key: set() for key in ("en/boat", "en/five", "en/moon")}
    assert results(job) == first
    shutil.copy(SAMPLE / "dialogue/en/five.wav", job.dialogue / "en/five.wav")
    assert run_inline(capsys, job).code == 0
    assert job.statuses()["en/five"] == "ok"


def test_without_a_cache_everything_is_done_and_nothing_kept(
    tmp_path: Path, cache: Path, capsys: Capture
) -> None:
    job = small_job(tmp_path / "job")
    for _ in range(2):
        assert run_inline(capsys, job, "--no-cache").code == 0
        assert made(job) == {"en/boat": EVERY_STEP}
    assert [path for path in cache.rglob("*") if path.is_file()] == []


def test_a_job_may_name_its_store_and_the_command_line_another(
    tmp_path: Path, cache: Path, capsys: Capture
) -> None:
    job = small_job(tmp_path / "job")
    job.sections["job"]["cache"] = "../shared store"
    assert run_inline(capsys, job).code == 0
    assert any((tmp_path / "shared store").iterdir())
    assert not (cache / "store").exists()
    assert run_inline(capsys, job, "--cache", tmp_path / "third").code == 0
    assert made(job) == {"en/boat": EVERY_STEP}
    blocked = tmp_path / "file"
    blocked.touch()
    ran = animeme(capsys, "run", job.file, "--cache", blocked)
    ran.says(str(blocked), "--no-cache", "store-unwritable")
    assert ran.code == 2


def test_a_new_line_is_new_and_a_line_that_went_is_gone(done: SmallJob, capsys: Capture) -> None:
    done.line("en/moon", like="en/moon")
    assert rehearsed(capsys, done)["lines"] == [{"line": "en/moon", "causes": ["new"]}]
    assert run_inline(capsys, done).code == 0
    assert done.animations() == {"boat", "five", "moon"}
    for suffix in (".wav", ".txt"):
        (done.dialogue / f"en/moon{suffix}").unlink()
    assert run_inline(capsys, done).code == 0
    assert done.animations() == {"boat", "five"}


def test_shards_and_a_merge_give_the_bytes_of_one_run(
    tmp_path: Path, cache: Path, capsys: Capture
) -> None:
    job = small_job(tmp_path / "job", "en/boat", "en/five", "en/moon", "de/boat")
    lines = 0
    for number in (1, 2):
        ran = animeme(
            capsys, "run", job.write(), "--executor", "inline", "--shard", f"{number}/2", "--json"
        )
        assert ran.code == 0, ran.err
        lines += json.loads(ran.out)["totals"]["ok"]
        assert not job.output.exists()
    assert lines == 4
    ran = animeme(capsys, "merge", job.file, "--executor", "inline", "--json")
    assert ran.code == 0, ran.err
    assert json.loads(ran.out)["known_lines"] == 4
    merged = results(job)
    shutil.rmtree(job.output)
    assert run_inline(capsys, job, "--no-cache").code == 0
    assert results(job) == merged
    bad = animeme(capsys, "run", job.file, "--shard", "3/2")
    bad.says("I/N")
    assert bad.code == 2


def test_the_cache_commands_count_check_and_shrink(done: SmallJob, capsys: Capture) -> None:
    told = animeme(capsys, "cache", "stat", "--json")
    document = json.loads(told.out)
    validate("cache", document)
    assert document["results"] == 7  # three steps of two lines, one file
    assert document["bytes"] > 1000
    half = animeme(capsys, "cache", "gc", "--max-size", document["bytes"] // 2, "--json")
    validate("cache", json.loads(half.out))
    assert json.loads(half.out)["bytes"] <= document["bytes"] // 2
    assert animeme(capsys, "cache", "gc", "--max-size", "0").code == 0
    assert json.loads(animeme(capsys, "cache", "stat", "--json").out)["results"] == 0
    first = results(done)
    shutil.rmtree(done.output)
    assert run_inline(capsys, done).code == 0
    assert results(done) == first
    bad = animeme(capsys, "cache", "gc", "--max-size", "lots")
    bad.says("20G")
    assert bad.code == 2
