"""Mistakes in the job file: each is named by its path, all of them at once."""

from __future__ import annotations

import shutil
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pytest

from support.bad_input import expect_refused, expect_success
from support.jobs import Capture, SmallJob, animeme, run_inline


@dataclass(frozen=True)
class BadJob:
    """One mistake in a job file: table and key to set, and what must be said."""

    id: str
    table: str
    key: str
    value: Any
    words: tuple[str, ...]


BAD_JOBS = (
    BadJob("model", "model", "name", "cohen-masaro", ("model.name", "mean 'cohen-massaro'?")),
    BadJob("model-far", "model", "name", "zzz", ("model.name", "Known: bigram, cohen-massaro")),
    BadJob("aligner", "align", "aligner", "pocketsfinx", ("align.aligner", "mean 'pocketsphinx'?")),
    BadJob("rig", "characters.crab", "rig", "arkti", ("characters.crab.rig", "mean 'arkit'?")),
    BadJob(
        "rig-file",
        "characters.crab",
        "rig",
        "crab.rgi.toml",
        ("characters.crab.rig", "no such file", "crab.rgi.toml"),
    ),
    BadJob("key", "curves", "rate_hs", 60, ("curves.rate_hs", "mean 'rate_hz'?")),
    BadJob("section", "curve", "rate_hz", 60, ("curve: unknown key", "mean 'curves'?")),
    BadJob(
        "character-key",
        "characters.crab",
        "layuot",
        "per-line",
        ("characters.crab.layuot", "mean 'layout'?"),
    ),
    BadJob("job-key", "job", "nmae", "x", ("job.nmae", "mean 'name'?")),
    BadJob("word-for-number", "curves", "rate_hz", "fast", ("curves.rate_hz", "'fast'", "number")),
    BadJob("zero-rate", "curves", "rate_hz", 0, ("curves.rate_hz", "greater than 0")),
    BadJob("huge-error", "curves", "max_error", 2.0, ("curves.max_error", "0.5", "2.0")),
    BadJob("name-empty", "job", "name", "", ("job.name", "at least 1")),
    BadJob("output-list", "job", "output", ["out"], ("job.output", "string")),
    BadJob(
        "layout",
        "characters.crab",
        "layout",
        "per-scene",
        ("characters.crab.layout", "per-line", "'per-scene'"),
    ),
    BadJob("no-root", "dialogue", "root", "dialog", ("dialogue.root", "no folder 'dialog'")),
    BadJob(
        "no-asset",
        "characters.crab",
        "asset",
        "carb.glb",
        ("characters.crab.asset", "no file 'carb.glb'", "start at the job file"),
    ),
    BadJob("asset-none", "characters.crab", "asset", [], ("characters.crab.asset", "at least 1")),
    BadJob("asset-number", "characters.crab", "asset", 3, ("characters.crab.asset",)),
    BadJob(
        "asset-format",
        "characters.crab",
        "asset",
        "crab.fbx",
        ("characters.crab.asset", "no format takes '.fbx'", ".glb", ".usdc"),
    ),
    BadJob(
        "asset-folder",
        "characters.crab",
        "asset",
        "folder.glb",
        ("characters.crab.asset", "folder.glb"),
    ),
    BadJob(
        "assets-clash",
        "characters.crab",
        "asset",
        ["crab.glb", "dialogue/../crab.glb"],
        ("characters.crab.asset", "one file", "two characters"),
    ),
    BadJob(
        "path-as-name", "characters.a/b", "asset", "crab.glb", ("characters.a/b", "file's name")
    ),
    BadJob("no-model-file", "model", "file", "m.json", ("model.file", "m.json", "no such file")),
)


@pytest.mark.parametrize("case", BAD_JOBS, ids=lambda case: case.id)
def test_a_mistake_in_the_job_file_is_named_by_its_path(
    case: BadJob, job: SmallJob, capsys: Capture
) -> None:
    (job.folder / "folder.glb").mkdir()
    sound = {table: dict(keys) for table, keys in job.sections.items()}
    job.sections.setdefault(case.table, {})[case.key] = case.value
    ran = run_inline(capsys, job)
    expect_refused(job, ran, str(job.file), "1 problem\n", *case.words)

    job.sections = sound
    expect_success(job, run_inline(capsys, job))


@pytest.mark.parametrize("table", ["job", "dialogue", "characters.crab"])
def test_a_missing_section_is_named(table: str, job: SmallJob, capsys: Capture) -> None:
    del job.sections[table]
    expect_refused(job, run_inline(capsys, job), f"{table.split('.')[0]}: missing")


def test_everything_wrong_with_a_job_is_said_at_once(job: SmallJob, capsys: Capture) -> None:
    (job.folder / "model.json").write_text("{")
    (job.folder / "broken.rig.toml").write_text('schema = "animeme.rig/9"\n')
    job.sections = {
        "job": {"nam": "small"},
        "dialogue": {"root": "nowhere"},
        "align": {"aligner": "pocketsfinx"},
        "model": {"name": "cohen", "file": "model.json"},
        "curves": {"rate_hz": -1, "max_error": "tiny", "smooth": True},
        "characters.crab": {"asset": "no.glb", "rig": "broken.rig.toml", "layout": "per-scene"},
        "characters.ada": {"rig": "arkti", "lyaout": "per-line"},
        "characters.bob": {"asset": "bob.fbx"},
        "extras": {"anything": 1},
    }
    paths = (
        "job.name",
        "job.nam",
        "dialogue.root",
        "align.aligner",
        "model.name",
        "model.file",
        "curves.rate_hz",
        "curves.max_error",
        "curves.smooth",
        "characters.crab.asset",
        "characters.crab.rig",
        "characters.crab.layout",
        "characters.ada.asset",
        "characters.ada.rig",
        "characters.ada.lyaout",
        "characters.bob.asset",
        "extras",
    )
    ran = run_inline(capsys, job)
    expect_refused(job, ran, f"{len(paths)} problems", *(f"\n  {path}: " for path in paths))


def test_every_missing_asset_of_a_character_is_named(job: SmallJob, capsys: Capture) -> None:
    job.sections["characters.crab"]["asset"] = ["no.glb", "nor.usdc"]
    expect_refused(job, run_inline(capsys, job), "'no.glb'", "'nor.usdc'")


@pytest.mark.parametrize(
    ("content", "word"),
    [
        pytest.param(b"[job\nname = 1", "line 1", id="syntax"),
        pytest.param(b"[job]\nname = 'a'\nname = 'b'\n", "line 3", id="key-twice"),
        pytest.param("[job]\nname = 'größe'".encode("latin-1"), "utf-8", id="latin-1"),
        pytest.param(b"\x89PNG\r\n\x1a\n", "utf-8", id="png"),
    ],
)
def test_a_file_that_is_no_toml_is_refused(
    content: bytes, word: str, tmp_path: Path, capsys: Capture
) -> None:
    (tmp_path / "job.toml").write_bytes(content)
    ran = animeme(capsys, "run", tmp_path / "job.toml")
    ran.says("job.toml", "not readable TOML", word)
    assert ran.code == 2


@pytest.mark.parametrize("content", [b"", b"# nothing\n", b"job = 3\n"])
def test_a_job_without_anything_in_it_is_refused(
    content: bytes, tmp_path: Path, capsys: Capture
) -> None:
    (tmp_path / "job.toml").write_bytes(content)
    ran = animeme(capsys, "run", tmp_path / "job.toml")
    ran.says("  job: ", "  dialogue: missing", "  characters: missing")
    assert ran.code == 2


@pytest.mark.parametrize("keep", ["", "en", ".hidden/boat.wav", "en/readme.pdf", "stray.wav"])
def test_a_job_without_any_line_is_refused(keep: str, job: SmallJob, capsys: Capture) -> None:
    shutil.rmtree(job.dialogue)
    target = job.dialogue / keep
    if target.suffix:
        target.parent.mkdir(parents=True)
        target.touch()
    else:
        target.mkdir(parents=True)
    file = job.write()
    ran = animeme(capsys, "run", file)
    expect_refused(job, ran, "dialogue.root", "no recording", "<language>/<line>.wav")


@pytest.mark.parametrize("name", ["missing.toml", "."])
def test_a_job_file_that_is_not_there_is_refused(
    name: str, tmp_path: Path, capsys: Capture
) -> None:
    ran = animeme(capsys, "run", tmp_path / name)
    ran.says(str(tmp_path / name))
    assert ran.code == 2
    assert list(tmp_path.iterdir()) == []
