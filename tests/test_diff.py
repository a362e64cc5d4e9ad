"""`animeme diff`: the same is the same, and what differs is named."""

from __future__ import annotations

import json
import shutil
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from animeme import registry
from animeme.contracts import LineAnimation
from animeme.curves import CurveSet
from support.deliveries import shapes, with_curves
from support.jobs import SAMPLE, Capture, Ran, animeme, run_inline, small_job
from support.schemas import validate


def told(capsys: Capture, code: int, *arguments: object) -> dict[str, Any]:
    ran = animeme(capsys, "diff", *arguments, "--json")
    assert ran.code == code, ran.err
    document: dict[str, Any] = json.loads(ran.out)
    validate("diff", document)
    assert document["exit_code"] == code
    return document


def curves(
    path: Path, *rows: tuple[float, float, float], names: tuple[str, ...] = ("a", "b")
) -> Path:
    table = [[row[0], *row[1 : 1 + len(names)]] for row in rows]
    values = np.array(table)
    document = CurveSet(values[:, 0], names, values[:, 1:]).to_document()
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(json.dumps(document), encoding="utf-8")
    return path


def test_two_curve_files(tmp_path: Path, capsys: Capture) -> None:
    first = curves(tmp_path / "a.json", (0, 0, 0), (1, 1, 0.5))
    # A key in the middle that says nothing new, then a corner that does.
    same = curves(tmp_path / "b.json", (0, 0, 0), (0.5, 0.5, 0.25), (1, 1, 0.5))
    other = curves(tmp_path / "c.json", (0, 0, 0), (0.5, 0.5, 0.45), (1, 1, 0.5))
    assert told(capsys, 0, first, same)["largest"] == 0
    (entry,) = told(capsys, 1, first, other, "--tolerance", 0.1)["animations"]
    assert (entry["shape"], entry["at_s"]) == ("b", 0.5)
    assert entry["largest"] == pytest.approx(0.2)
    assert entry["mean"] == pytest.approx(0.05)  # half of the time and half of the shapes
    assert told(capsys, 0, first, other, "--tolerance", 0.21)["totals"]["beyond"] == 0


def test_a_curve_that_only_one_file_has_is_held_against_rest(
    tmp_path: Path, capsys: Capture
) -> None:
    first = curves(tmp_path / "a.json", (0, 0, 0), (1, 1, 0.5))
    still = curves(tmp_path / "b.json", (0, 0, 0), (1, 1, 0.0))
    less = curves(tmp_path / "c.json", (0, 0, 0), (1, 1, 0), names=("a",))
    (entry,) = told(capsys, 1, first, less)["animations"]
    assert (entry["shape"], entry["largest"], entry["at_s"]) == ("b", 0.5, 1.0)
    assert told(capsys, 0, still, less)["totals"]["compared"] == 1


def test_a_run_differs_in_the_curve_that_was_broken(tmp_path: Path, capsys: Capture) -> None:
    job = small_job(tmp_path / "job", "en/boat", "en/five")
    job.asset("crab.usdc")
    job.sections["characters.crab"]["asset"] = ["crab.glb", "crab.usdc"]
    job.sections["curves"] = {"export": ["json", "csv"]}
    assert run_inline(capsys, job).code == 0
    golden = tmp_path / "golden"
    shutil.copytree(job.output, golden)
    # USD's layers find their source from where they are.
    for source in ("crab.usdc", "crab.glb"):
        shutil.copy(job.folder / source, tmp_path / source)
    totals = told(capsys, 0, golden, job.output)["totals"]
    assert totals["compared"] >= 2 * (2 + 2)  # two lines in two assets, two kinds of curve files

    broken = job.output / "curves/crab/en/five.json"
    document = json.loads(broken.read_text(encoding="utf-8"))
    shape = next(iter(document["curves"]))
    document["curves"][shape][7] += 0.25
    broken.write_text(json.dumps(document), encoding="utf-8")
    ran = animeme(capsys, "diff", golden, job.output, "--tolerance", 0.1)
    assert ran.code == 1
    says(ran, "curves/crab/en/five.json", shape, "0.25", f"{document['times_s'][7]:.3f} s")
    assert told(capsys, 0, golden, job.output, "--tolerance", 0.26)["largest"] == 0.25

    (job.output / "en/crab.glb").write_bytes(b"glTF")
    (golden / "curves/crab/en/boat.csv").unlink()
    document = told(capsys, 1, golden, job.output, "--tolerance", 1)
    assert [(entry["side"], entry["file"]) for entry in document["unread"]] == [
        ("b", "en/crab.glb")
    ]
    assert document["alone"] == [{"side": "b", "file": "curves/crab/en/boat.csv", "animation": ""}]
    ran = animeme(capsys, "diff", golden, job.output, "--tolerance", 1)
    says(ran, "en/crab.glb: cannot be read in B", "boat.csv: only in B")


@pytest.mark.parametrize("suffix", [".glb", ".usdc"])
def test_an_asset_differs_in_the_shape_that_moved(
    suffix: str, tmp_path: Path, capsys: Capture
) -> None:
    plain = SAMPLE / f"ada{suffix}"
    form = registry.format_of(plain)
    character = form.load(plain)
    still = CurveSet(np.array([0.0, 1.0]), ("jawOpen",), np.array([[0.0], [0.5]]))
    first = tmp_path / f"first{suffix}"
    form.write(character, [LineAnimation("boat", "en", still, 1.0)], first)
    second = with_curves(
        first, tmp_path / f"second{suffix}", shapes(mouthSmileLeft={0.0: 0.0, 0.4: 0.3, 1.0: 0.0})
    )
    assert told(capsys, 0, first, first)["totals"]["compared"] == 1
    (entry,) = told(capsys, 1, first, second, "--tolerance", 0.01)["animations"]
    assert entry["shape"] == "mouthSmileLeft"
    assert entry["largest"] == pytest.approx(0.3, abs=1e-5)
    assert entry["at_s"] == pytest.approx(0.4, abs=1e-5)
    assert told(capsys, 1, first, plain)["totals"]["only_a"] == 1


def test_what_cannot_be_compared_is_refused(tmp_path: Path, capsys: Capture) -> None:
    file = curves(tmp_path / "a.json", (0, 0, 0), (1, 1, 0.5))
    (tmp_path / "empty").mkdir()

    def refused(*arguments: object) -> Ran:
        ran = animeme(capsys, "diff", *arguments)
        assert (ran.code, ran.out) == (2, "")
        return ran

    says(refused(file, tmp_path / "none.json"), "none.json", "does not exist")
    says(refused(file, tmp_path / "empty"), "is a folder", "two output folders")
    says(refused(tmp_path / "empty", tmp_path / "empty"), "no curves to compare")
    says(refused(file, file, "--tolerance", "nan"), "--tolerance")
    says(refused(file, file, "--tolerance", "-1"), "--tolerance")
    says(refused(SAMPLE / "ada.glb", SAMPLE / "ada.glb"), "no curves to compare")


def says(ran: Ran, *words: str) -> None:
    assert "Traceback" not in ran.err
    for word in words:
        assert word in ran.out + ran.err
