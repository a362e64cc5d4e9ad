"""Output folders that cannot be written, and what must never be overwritten."""

from __future__ import annotations

import shutil
from collections.abc import Callable

import pytest
from pxr import Sdf

from support.bad_input import expect_refused, expect_success
from support.jobs import SAMPLE, Capture, SmallJob, run_inline


@pytest.mark.parametrize(
    "output",
    [
        pytest.param("occupied", id="is-a-file"),
        pytest.param("occupied/below", id="below-a-file"),
        pytest.param("occupied/far/below", id="far-below-a-file"),
        pytest.param("/proc/animeme", id="proc"),
    ],
)
def test_an_output_folder_that_cannot_be_made_is_refused(
    output: str, job: SmallJob, capsys: Capture
) -> None:
    (job.folder / "occupied").write_text("mine")
    job.sections["job"]["output"] = output
    ran = run_inline(capsys, job)
    expect_refused(job, ran, output, "cannot be written", "Choose another output folder")

    job.sections["job"]["output"] = "out"
    expect_success(job, run_inline(capsys, job))


@pytest.mark.parametrize("name", ["en", "alignments"])
def test_a_file_in_the_way_of_an_output_folder_fails_the_lines(
    name: str, job: SmallJob, capsys: Capture
) -> None:
    """A file where a folder belongs is nobody's fault but the folder's: no report to us."""
    job.output.mkdir()
    (job.output / name).write_text("mine")
    ran = run_inline(capsys, job)
    ran.says("cannot be written", name, "Choose another output folder")
    assert "please report it" not in ran.err
    assert ran.code == 1
    assert set(job.statuses().values()) == {"failed"}
    assert (job.output / name).read_text() == "mine"

    (job.output / name).unlink()
    expect_success(job, run_inline(capsys, job))


@pytest.mark.parametrize("name", ["run.jsonl", "report.json", "junit.xml"])
def test_a_folder_in_the_way_of_a_report_is_named(
    name: str, job: SmallJob, capsys: Capture
) -> None:
    (job.output / name).mkdir(parents=True)
    ran = run_inline(capsys, job)
    ran.says(name, "cannot be written", "Choose another output folder")
    assert ran.code == 2
    (job.output / name).rmdir()
    expect_success(job, run_inline(capsys, job))


def _glb_in_language_folder(job: SmallJob) -> str:
    (job.folder / "en").mkdir()
    shutil.move(job.folder / "crab.glb", job.folder / "en" / "crab.glb")
    return "en/crab.glb"


def _usda_beside_the_job(job: SmallJob) -> str:
    Sdf.Layer.FindOrOpen(str(SAMPLE / "crab.usdc")).Export(str(job.folder / "crab.usda"))
    return "crab.usda"


@pytest.mark.parametrize("place", [_glb_in_language_folder, _usda_beside_the_job])
def test_an_asset_is_never_overwritten(
    place: Callable[[SmallJob], str], job: SmallJob, capsys: Capture
) -> None:
    asset = place(job)
    job.sections["characters.crab"]["asset"] = asset
    job.sections["job"]["output"] = "."
    before = (job.folder / asset).read_bytes()
    ran = run_inline(capsys, job, sources_kept=False)
    assert (job.folder / asset).read_bytes() == before
    ran.says(asset)
    assert ran.code == 2
