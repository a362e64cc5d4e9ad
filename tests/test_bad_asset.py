"""Damaged assets: each costs only its own character."""

from __future__ import annotations

import json
import shutil
import struct
from collections.abc import Callable
from pathlib import Path
from typing import Any

from pxr import Usd, UsdGeom

from support.bad_input import BAD, GOOD, expect_refused, expect_success
from support.jobs import SAMPLE, Capture, SmallJob, run_inline


def _cut_at(name: str, *, at: int | float) -> Callable[[Path], object]:
    """Write the first `at` bytes (or that share) of one of the sample's assets."""

    def write(path: Path) -> None:
        data = (SAMPLE / name).read_bytes()
        path.write_bytes(data[: at if isinstance(at, int) else int(at * len(data))])

    return write


def _honest_cut(path: Path) -> None:
    """A GLB that is cut off, with a header that says so."""
    data = (SAMPLE / "crab.glb").read_bytes()[:200_000]
    path.write_bytes(data[:8] + struct.pack("<I", len(data)) + data[12:])


def _glb(root: object) -> Callable[[Path], object]:
    text = root.encode() if isinstance(root, str) else json.dumps(root).encode()
    text += b" " * (-len(text) % 4)
    chunk = struct.pack("<II", len(text), 0x4E4F534A) + text
    return lambda path: path.write_bytes(b"glTF" + struct.pack("<II", 2, 12 + len(chunk)) + chunk)


def _plain_usd(path: Path) -> None:
    stage = Usd.Stage.CreateNew(str(path))
    UsdGeom.Mesh.Define(stage, "/face")
    stage.GetRootLayer().Save()


PLAIN_MESH: dict[str, Any] = {"primitives": [{"attributes": {}}]}
BAD_ASSETS = (
    *(
        ("cut.glb", _cut_at("crab.glb", at=at), "")
        for at in (0, 1, 4, 11, 12, 19, 20, 88, 0.25, 0.5, 0.9999)
    ),
    *(("cut.usdc", _cut_at("crab.usdc", at=at), "") for at in (0, 1, 8, 88, 0.25, 0.5, 0.9999)),
    ("honest.glb", _honest_cut, "leaves the file"),
    ("text.glb", _glb("{ not JSON"), "holds no JSON"),
    ("list.glb", _glb([1, 2]), "not an object"),
    ("one.glb", _glb({"asset": {"version": "1.0"}}), "only 2.x"),
    (
        "plain.glb",
        _glb({"asset": {"version": "2.0"}, "nodes": [{"mesh": 0}], "meshes": [PLAIN_MESH]}),
        "no mesh with morph targets",
    ),
    (
        "broken.glb",
        _glb({"asset": {"version": "2.0"}, "nodes": [{"mesh": 7}], "meshes": [PLAIN_MESH]}),
        "points at no mesh",
    ),
    ("empty.glb", _glb({"asset": {"version": "2.0"}}), "no mesh with morph targets"),
    ("plain.usda", _plain_usd, "no mesh has blendshapes"),
    ("text.usda", lambda path: path.write_text("#usda 1.0\ndef Mesh {"), "cannot be read as USD"),
    (
        "image.usdc",
        lambda path: path.write_bytes(b"\x89PNG\r\n\x1a\n" * 99),
        "cannot be read as USD",
    ),
)


def test_a_job_whose_every_asset_is_damaged_is_refused(job: SmallJob, capsys: Capture) -> None:
    del job.sections["characters.crab"]
    for number, (name, write, _) in enumerate(BAD_ASSETS):
        asset = job.folder / f"{number}-{name}"
        write(asset)
        job.sections[f"characters.c{number}"] = {"asset": asset.name}
    ran = run_inline(capsys, job)
    expect_refused(job, ran, f"{len(BAD_ASSETS)} problems")
    said = ran.err.splitlines()
    for number, (name, _, word) in enumerate(BAD_ASSETS):
        (problem,) = (
            line for line in said if line.split(":")[0].strip() == f"characters.c{number}"
        )
        for expected in (f"{number}-{name}", word, "xport"):
            assert expected in problem


def test_a_damaged_asset_mended_works(job: SmallJob, capsys: Capture) -> None:
    _cut_at("crab.glb", at=0.5)(job.folder / "crab.glb")
    expect_refused(job, run_inline(capsys, job), "crab.glb")
    job.asset("crab.glb")
    expect_success(job, run_inline(capsys, job))


def test_every_damaged_asset_of_a_job_is_named(job: SmallJob, capsys: Capture) -> None:
    for name in ("one", "two"):
        (job.folder / f"{name}.glb").write_bytes(b"glTF")
        job.sections[f"characters.{name}"] = {"asset": f"{name}.glb"}
    del job.sections["characters.crab"]
    expect_refused(job, run_inline(capsys, job), "2 problems", "one.glb", "two.glb", "Export")


def test_a_damaged_asset_costs_only_its_own_character(job: SmallJob, capsys: Capture) -> None:
    job.sections["characters.twin"] = {"asset": "twin.glb", "rig": "crab.rig.toml"}
    _cut_at("crab.glb", at=0.5)(job.folder / "twin.glb")
    ran = run_inline(capsys, job)
    ran.says("twin.glb", "asset-unreadable", "Export or copy the asset again")
    assert ran.code == 1
    assert job.statuses("crab") == {GOOD: "ok", BAD: "ok"}
    assert job.statuses("twin") == {GOOD: "failed", BAD: "failed"}
    assert job.report()["outputs"] == ["en/crab.glb"]
    assert not (job.output / "en" / "twin.glb").exists()

    shutil.copy(job.folder / "crab.glb", job.folder / "twin.glb")
    expect_success(job, run_inline(capsys, job))
    assert job.animations("en/twin.glb") == {"boat", "five"}


def test_a_character_with_one_damaged_asset_of_two_delivers_neither(
    job: SmallJob, capsys: Capture
) -> None:
    job.sections["characters.twin"] = {
        "asset": ["twin.glb", "twin.usdc"],
        "rig": "crab.rig.toml",
    }
    shutil.copy(job.folder / "crab.glb", job.folder / "twin.glb")
    _cut_at("crab.usdc", at=0.5)(job.folder / "twin.usdc")
    ran = run_inline(capsys, job)
    ran.says("twin.usdc", "asset-unreadable")
    assert ran.code == 1
    assert job.report()["outputs"] == ["en/crab.glb"]
    assert set(job.statuses("twin").values()) == {"failed"}
