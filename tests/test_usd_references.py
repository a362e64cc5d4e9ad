"""What a USD asset may pull in: layers of its own folder, nothing else."""

from __future__ import annotations

import zipfile
from pathlib import Path

import pytest
from pxr import Sdf, Usd, UsdUtils

from animeme.errors import InputError
from support.jobs import Capture, run_inline, small_job
from support.usd_kit import FORMAT, hero

OUTSIDE = [
    "http://example.com/prop.usda",
    "https://example.com/prop.usdc",
    "omniverse://server/prop.usd",
    "file:///etc/prop.usda",
    "//server/share/prop.usda",
    "\\\\server\\share\\prop.usda",
    "C:/props/prop.usda",
    "/etc/prop.usda",
    "~/prop.usda",
    "../prop.usda",
    "./sub/../../prop.usda",
    "sub/../../prop.usda",
]


def refer(path: Path, asset: str, how: str) -> Path:
    """A character that also pulls in `asset`."""
    hero(path)
    layer = Sdf.Layer.FindOrOpen(str(path))
    prop = Sdf.CreatePrimInLayer(layer, "/hero/prop")
    prop.specifier = Sdf.SpecifierDef
    if how == "sublayer":
        layer.subLayerPaths.append(asset)
    elif how == "reference":
        prop.referenceList.Prepend(Sdf.Reference(asset))
    elif how == "payload":
        prop.payloadList.Prepend(Sdf.Payload(asset))
    elif how == "variant":
        variants = Sdf.VariantSetSpec(prop, "look")
        Sdf.VariantSpec(variants, "dear").primSpec.referenceList.Prepend(Sdf.Reference(asset))
    elif how == "clip":
        clips = {"assetPaths": Sdf.AssetPathArray([Sdf.AssetPath(asset)]), "primPath": "/prop"}
        prop.SetInfo("clips", {"default": clips})
    else:
        prop.SetInfo("clips", {"default": {"templateAssetPath": asset, "primPath": "/prop"}})
    layer.Save()
    return path


@pytest.mark.parametrize("asset", OUTSIDE)
def test_references_to_the_outside_are_refused(tmp_path: Path, asset: str) -> None:
    path = refer(tmp_path / "hero.usda", asset, "reference")
    with pytest.raises(InputError) as caught:
        FORMAT.load(path)
    assert caught.value.code == "asset-uri-refused"
    assert repr(asset) in caught.value.problem


@pytest.mark.parametrize(
    "how", ["sublayer", "reference", "payload", "variant", "clip", "clip template"]
)
def test_however_it_is_pulled_in(tmp_path: Path, how: str) -> None:
    (tmp_path / "in" / "sub").mkdir(parents=True)
    inside = refer(tmp_path / "in" / "hero.usda", "./sub/prop.usda", how)
    assert FORMAT.load(inside).shapes
    outside = refer(tmp_path / "in" / "villain.usda", "../prop.usda", how)
    with pytest.raises(InputError, match="asset-uri-refused"):
        FORMAT.load(outside)


def test_nothing_outside_is_even_opened(tmp_path: Path) -> None:
    Usd.Stage.CreateNew(str(tmp_path / "prop.usda")).Save()
    (tmp_path / "in").mkdir()
    path = refer(tmp_path / "in" / "hero.usda", "../prop.usda", "reference")
    with pytest.raises(InputError, match="asset-uri-refused"):
        FORMAT.load(path)
    assert Sdf.Layer.Find(str(tmp_path / "prop.usda")) is None


def test_layers_below_layers_are_looked_at(tmp_path: Path) -> None:
    (tmp_path / "sub").mkdir()
    refer(tmp_path / "sub" / "prop.usda", "../../prop.usda", "payload")
    path = refer(tmp_path / "hero.usda", "./sub/prop.usda", "reference")
    with pytest.raises(InputError, match=r"sub/prop\.usda: .*asset-uri-refused"):
        FORMAT.load(path)


def test_a_link_that_leaves_the_folder_is_refused(tmp_path: Path) -> None:
    hero(tmp_path / "out" / "prop.usda")
    path = refer(tmp_path / "in" / "hero.usda", "./prop.usda", "reference")
    (tmp_path / "in" / "prop.usda").symlink_to(tmp_path / "out" / "prop.usda")
    with pytest.raises(InputError, match="asset-uri-refused"):
        FORMAT.load(path)


def test_layers_in_circles(tmp_path: Path) -> None:
    refer(tmp_path / "prop.usda", "./hero.usda", "reference")
    assert FORMAT.load(refer(tmp_path / "hero.usda", "./prop.usda", "reference")).shapes


def test_packages_refer_within(tmp_path: Path) -> None:
    Usd.Stage.CreateNew(str(tmp_path / "prop.usda")).Save()
    inner = refer(tmp_path / "inner.usda", "./prop.usda", "reference")
    assert UsdUtils.CreateNewUsdzPackage(str(inner), str(tmp_path / "hero.usdz"))
    assert FORMAT.load(tmp_path / "hero.usdz").shapes


def test_what_is_missing_is_no_refusal(tmp_path: Path) -> None:
    assert FORMAT.load(refer(tmp_path / "a.usda", "./missing.usda", "payload")).shapes
    assert FORMAT.load(refer(tmp_path / "b.usda", "library/missing.usda", "payload")).shapes


def test_a_job_may_name_a_larger_folder(tmp_path: Path, capsys: Capture) -> None:
    """Studios keep what characters share above them."""
    job = small_job(tmp_path)
    job.timed_line()
    job.asset("crab.usdc").rename(tmp_path / "shared.usdc")
    (tmp_path / "show" / "crab").mkdir(parents=True)
    stage = Usd.Stage.CreateNew(str(tmp_path / "show" / "crab" / "crab.usda"))
    UsdUtils.CopyLayerMetadata(
        Sdf.Layer.FindOrOpen(str(tmp_path / "shared.usdc")), stage.GetRootLayer()
    )
    stage.GetRootLayer().subLayerPaths.append("../../shared.usdc")
    stage.Save()
    crab = job.sections["characters.crab"]
    crab["asset"] = "show/crab/crab.usda"
    run_inline(capsys, job).says("shared.usdc", "asset_root")
    crab["asset_root"] = "show"
    run_inline(capsys, job).says("shared.usdc", "is not below")
    crab |= {"asset_root": ".", "usdz": True}
    assert run_inline(capsys, job).code == 0
    assert job.animations("en/crab.usda") >= {"boat"}
    with zipfile.ZipFile(job.output / "crab.usdz") as package:
        assert {"source/shared.usdc", "source/show/crab/crab.usda"} <= set(package.namelist())
    assert job.animations("crab.usdz") >= {"boat"}
    crab["asset_root"] = "out"
    run_inline(capsys, job).says("characters.crab.asset_root", "is not below it")
