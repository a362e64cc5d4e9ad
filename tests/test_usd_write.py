"""Lines into USD: what a plain runtime plays."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from pxr import Sdf, Usd, UsdGeom, UsdSkel, UsdUtils

from animeme.errors import InputError
from support.usd_kit import (
    FORMAT,
    SHAPES,
    add_animation,
    add_mesh,
    add_skeleton,
    assembled,
    assert_played,
    digest,
    hero,
    joints,
    line,
    new_stage,
    played,
    select,
    skeleton_query,
    write,
)


@pytest.mark.parametrize("suffix", [".usda", ".usdc", ".usd"])
@pytest.mark.parametrize("animated", [True, False])
def test_what_plays_is_what_was_given(tmp_path: Path, suffix: str, animated: bool) -> None:
    source = hero(tmp_path / "hero.usda", animated=animated)
    spoken = line("hello", SHAPES[:2])
    target = tmp_path / "out" / "en" / f"hero{suffix}"
    _, stage = write(source, target, spoken)
    assert_played(stage, "/hero/face", spoken.curves)
    assert target.read_bytes().startswith(b"#usda" if suffix == ".usda" else b"PXR-USDC")


def test_shapes_are_matched_by_name(tmp_path: Path) -> None:
    stage = new_stage(tmp_path / "hero.usda")
    add_skeleton(stage, "/hero/rig")
    add_mesh(stage, "/hero/face", "/hero/rig", SHAPES)
    add_mesh(stage, "/hero/teeth", "/hero/rig", ["mouthClose2", "jawOpen2"])
    add_mesh(stage, "/hero/tongue", "/hero/rig", ["jawOpen.003", "browUp"])
    stage.Save()
    spoken = line("hello", SHAPES[::-1])
    _, out = write(tmp_path / "hero.usda", tmp_path / "out.usdc", spoken)
    assert_played(out, "/hero/face", spoken.curves)
    assert_played(out, "/hero/teeth", spoken.curves, mouthClose2="mouthClose", jawOpen2="jawOpen")
    assert_played(out, "/hero/tongue", spoken.curves, **{"jawOpen.003": "jawOpen"})
    (read,) = FORMAT.read_animations(tmp_path / "out.usdc").values()
    assert set(read.names) == set(SHAPES)


@pytest.mark.parametrize(
    ("codes_per_s", "frames_per_s", "effective"),
    [
        (24.0, None, 24.0),
        (30.0, 30.0, 30.0),
        (60.0, None, 60.0),
        (None, 25.0, 25.0),
        (None, None, 24.0),
    ],
)
def test_time_is_kept(
    tmp_path: Path, codes_per_s: float | None, frames_per_s: float | None, effective: float
) -> None:
    path = hero(tmp_path / "hero.usda")
    stage = Usd.Stage.Open(str(path))
    layer = stage.GetRootLayer()
    for key, value in (("timeCodesPerSecond", codes_per_s), ("framesPerSecond", frames_per_s)):
        if value is None:
            layer.pseudoRoot.ClearInfo(key)
        else:
            layer.pseudoRoot.SetInfo(key, value)
    stage.SetStartTimeCode(10)
    stage.SetEndTimeCode(20)
    stage.Save()
    before = joints(stage, "/hero/rig")
    spoken = line("hello", SHAPES)
    _, out = write(path, tmp_path / "out" / "hero.usdc", spoken)
    assert out.GetTimeCodesPerSecond() == effective
    assert out.GetRootLayer().HasTimeCodesPerSecond()
    assert (out.GetStartTimeCode(), out.GetEndTimeCode()) == (0.0, 2.0 * effective)
    assert_played(out, "/hero/face", spoken.curves)
    np.testing.assert_array_equal(joints(out, "/hero/rig"), before)


def test_stage_metadata_is_repeated(tmp_path: Path) -> None:
    path = hero(tmp_path / "chars" / "hero.usda")
    (tmp_path / "chars" / "colour.ocio").touch()
    stage = Usd.Stage.Open(str(path))
    UsdGeom.SetStageUpAxis(stage, "Z")
    UsdGeom.SetStageMetersPerUnit(stage, 0.0254)
    stage.SetColorConfiguration(Sdf.AssetPath("./colour.ocio"))
    stage.GetRootLayer().customLayerData = {"studio": {"show": "größer"}}
    stage.GetRootLayer().documentation = "made by hand"
    stage.SetEndTimeCode(500)
    stage.Save()
    _, out = write(path, tmp_path / "out" / "en" / "hero.usda", line("hello", SHAPES))
    assert UsdGeom.GetStageUpAxis(out) == "Z"
    assert UsdGeom.GetStageMetersPerUnit(out) == 0.0254
    assert out.GetDefaultPrim().GetPath() == "/hero"
    assert out.GetEndTimeCode() == 500
    assert out.GetMetadata("documentation") == "made by hand"
    assert out.GetMetadata("customLayerData") == {"studio": {"show": "größer"}}
    assert out.GetColorConfiguration().path == "../../chars/colour.ocio"


def test_body_goes_on_moving(tmp_path: Path) -> None:
    source = hero(tmp_path / "hero.usda")
    before = joints(Usd.Stage.Open(str(source)), "/hero/rig")
    _, out = write(source, tmp_path / "out.usdc", line("a", SHAPES), line("b", SHAPES, seed=1))
    for variant in ("a", "b"):
        select(out, dialogueLine=variant)
        np.testing.assert_array_equal(joints(out, "/hero/rig"), before)
    assert np.ptp(before, axis=0).any()


def test_without_animation_the_body_rests(tmp_path: Path) -> None:
    source = hero(tmp_path / "hero.usda", animated=False)
    _, out = write(source, tmp_path / "out.usdc", line("hello", SHAPES))
    transforms = joints(out, "/hero/rig")
    np.testing.assert_array_equal(transforms, joints(Usd.Stage.Open(str(source)), "/hero/rig"))
    assert transforms[0, 1, 3, 1] == 4.0


def test_other_shapes_of_the_old_animation_go_on(tmp_path: Path) -> None:
    old = {0.0: [0.0, 0.5, 0.1], 6.0: [1.0, 0.5, 0.3], 30.0: [0.25, 0.5, 0.2]}
    source = hero(tmp_path / "hero.usda", old=["browUp", "jawOpen", "unowned"], weights=old)
    spoken = line("hello", ["jawOpen"])
    _, out = write(source, tmp_path / "out.usdc", spoken)
    times_s = np.linspace(-0.5, 3.0, 50).tolist()
    now = played(out, "/hero/face", times_s)
    before = played(Usd.Stage.Open(str(source)), "/hero/face", times_s)
    np.testing.assert_allclose(now["browUp"], before["browUp"], atol=1e-6)
    np.testing.assert_allclose(now["jawOpen"], spoken.curves.sample(times_s)[:, 0], atol=1e-6)
    assert "unowned" in skeleton_query(out, "/hero/rig").GetAnimQuery().GetBlendShapeOrder()


def test_constant_shapes_need_no_further_keys(tmp_path: Path) -> None:
    old = {float(code): [0.75, 0.0] for code in range(100)}
    source = hero(tmp_path / "hero.usda", old=["browUp", "jawOpen"], weights=old)
    spoken = line("hello", ["jawOpen"], keys=7)
    _, out = write(source, tmp_path / "out.usdc", spoken)
    assert played(out, "/hero/face", [1.0])["browUp"] == [0.75]
    weights = UsdSkel.Animation(out.GetPrimAtPath("/hero/Dialogue/hello"))
    assert weights.GetBlendShapeWeightsAttr().GetNumTimeSamples() == 7


def test_old_weights_that_do_not_fit_are_left_alone(tmp_path: Path) -> None:
    source = hero(tmp_path / "hero.usda", old=["browUp", "jawOpen"], weights=[1.0])
    spoken = line("hello", ["jawOpen"])
    character = FORMAT.load(source)
    FORMAT.write(character, [spoken], tmp_path / "out.usdc")
    assert character.rest_weights()["browUp"] == 0.0
    assert_played(Usd.Stage.Open(str(tmp_path / "out.usdc")), "/hero/face", spoken.curves)


@pytest.mark.parametrize("shared_root", [True, False])
def test_two_skeletons(tmp_path: Path, shared_root: bool) -> None:
    stage = new_stage(tmp_path / "hero.usda", default=shared_root)
    other = "/hero/pet" if shared_root else "/pet"
    UsdSkel.Root.Define(stage, other)
    for path in ("/hero", other):
        add_skeleton(stage, f"{path}/rig", f"{path}/rig/walk")
    add_animation(stage, "/hero/rig/walk", ["browUp"], [0.5])
    add_animation(stage, f"{other}/rig/walk", body=False)
    add_mesh(stage, "/hero/face", "/hero/rig", SHAPES)
    add_mesh(stage, f"{other}/face", f"{other}/rig", ["jawOpen", "earUp"])
    stage.Save()
    before = joints(stage, "/hero/rig")
    lines = [line("a", ["jawOpen", "earUp"]), line("b", ["earUp", "jawOpen"], seed=1)]
    _, out = write(tmp_path / "hero.usda", tmp_path / "out.usdc", *lines)
    for spoken in lines:
        for prim in ["/hero"] if shared_root else ["/hero", "/pet"]:
            select(out, prim, dialogueLine=spoken.name)
        assert_played(out, f"{other}/face", spoken.curves)
        weights = played(out, "/hero/face", [0.3, 1.1])
        np.testing.assert_allclose(
            weights["jawOpen"],
            spoken.curves.sample([0.3, 1.1])[:, spoken.curves.names.index("jawOpen")],
            atol=1e-5,
        )
        assert weights["browUp"].tolist() == [0.5, 0.5]
        np.testing.assert_array_equal(joints(out, "/hero/rig"), before)
    read = FORMAT.read_animations(tmp_path / "out.usdc")
    times_s = [0.1, 0.9, 1.7]
    for spoken in lines:
        curves = read[spoken.name]
        for i, shape in enumerate(spoken.curves.names):
            got = curves.sample(times_s)[:, curves.names.index(shape)]
            np.testing.assert_allclose(got, spoken.curves.sample(times_s)[:, i], atol=1e-5)


def test_lines_are_chosen_by_variant(tmp_path: Path) -> None:
    names = ["line-01", "1st", "größe", "active", "a b", "a-b", "café.wav", "привет"]
    lines = [line(name, SHAPES, seed=i) for i, name in enumerate(names)]
    _, out = write(hero(tmp_path / "hero.usda"), tmp_path / "out.usda", *lines)
    variants = out.GetPrimAtPath("/hero").GetVariantSet("dialogueLine")
    assert sorted(variants.GetVariantNames()) == sorted(
        ["line_01", "_1st", "größe", "active_1", "a_b", "a_b_1", "café_wav", "привет"]
    )
    assert variants.GetVariantSelection() == "_1st"  # "1st" sorts first
    by_name = {spoken.name: spoken for spoken in lines}
    for variant in variants.GetVariantNames():
        select(out, dialogueLine=variant)
        data = out.GetPrimAtPath("/hero/Dialogue/active").GetCustomData()["animeme"]
        assert data["language"] == "en"
        assert data["duration_s"] == 2.0
        assert_played(out, "/hero/face", by_name[data["line"]].curves)
    read = FORMAT.read_animations(tmp_path / "out.usda")
    assert set(read) == set(names)
    for name, curves in read.items():
        np.testing.assert_allclose(curves.times_s, by_name[name].curves.times_s, atol=1e-12)


def test_a_taken_name_is_not_reused(tmp_path: Path) -> None:
    path = hero(tmp_path / "hero.usda")
    stage = Usd.Stage.Open(str(path))
    UsdGeom.Cube.Define(stage, "/hero/Dialogue")
    stage.Save()
    spoken = line("hello", SHAPES)
    _, out = write(path, tmp_path / "out.usdc", spoken)
    assert out.GetPrimAtPath("/hero/Dialogue").GetTypeName() == "Cube"
    assert out.GetPrimAtPath("/hero/Dialogue_1/hello")
    assert_played(out, "/hero/face", spoken.curves)


def test_foreign_variant_set_of_our_name_refused(tmp_path: Path) -> None:
    path = hero(tmp_path / "hero.usda")
    stage = Usd.Stage.Open(str(path))
    stage.GetPrimAtPath("/hero").GetVariantSets().AddVariantSet("dialogueLine")
    stage.Save()
    with pytest.raises(InputError, match="asset-name-taken"):
        FORMAT.write(FORMAT.load(path), [line("a", SHAPES)], tmp_path / "out.usdc")


def test_an_instanceable_character_does_not_become_an_instance(tmp_path: Path) -> None:
    """USD makes an instance of an instanceable prim once it has a variant set or reference."""
    path = hero(tmp_path / "hero.usda")
    stage = Usd.Stage.Open(str(path))
    stage.GetPrimAtPath("/hero").SetInstanceable(True)
    stage.Save()
    out, lines = assembled(path, tmp_path / "out")
    assert not out.GetPrimAtPath("/hero").IsInstance()
    select(out, dialogueLanguage="en", dialogueLine="y")
    weights = played(out, "/hero/face", [1.0])
    wanted = lines["en", "y"].curves.sample([1.0])[0]
    np.testing.assert_allclose([weights[name][0] for name in SHAPES[:2]], wanted, atol=1e-5)


def test_our_own_output_is_a_source_too(tmp_path: Path) -> None:
    old = {0.0: [0.0, 0.5], 30.0: [0.25, 0.5]}
    source = hero(tmp_path / "hero.usda", old=["browUp", "jawOpen"], weights=old)
    before = joints(Usd.Stage.Open(str(source)), "/hero/rig")
    write(source, tmp_path / "first.usdc", line("a", ["jawOpen"]), line("b", ["jawOpen"]))
    again = line("a", ["jawOpen", "mouthClose"], seed=5)
    new = line("c", ["mouthClose"], seed=6)
    _, out = write(tmp_path / "first.usdc", tmp_path / "second.usdc", again, new)
    assert FORMAT.load(tmp_path / "first.usdc").rest_weights() == FORMAT.load(source).rest_weights()
    brows = played(Usd.Stage.Open(str(source)), "/hero/face", [0.0, 0.7])["browUp"]
    for spoken in (again, new):
        select(out, dialogueLine=spoken.name)
        weights = played(out, "/hero/face", [0.0, 0.7])
        for i, shape in enumerate(spoken.curves.names):
            np.testing.assert_allclose(
                weights[shape], spoken.curves.sample([0.0, 0.7])[:, i], atol=1e-5
            )
        np.testing.assert_allclose(weights["browUp"], brows, atol=1e-6)
        np.testing.assert_array_equal(joints(out, "/hero/rig"), before)
    assert set(FORMAT.read_animations(tmp_path / "second.usdc")) == {"a", "b", "c", "walk"}


def test_usdz_source(tmp_path: Path) -> None:
    hero(tmp_path / "inner.usda")
    assert UsdUtils.CreateNewUsdzPackage(str(tmp_path / "inner.usda"), str(tmp_path / "hero.usdz"))
    spoken = line("hello", SHAPES)
    _, out = write(tmp_path / "hero.usdz", tmp_path / "out" / "en" / "hero.usdc", spoken)
    assert_played(out, "/hero/face", spoken.curves)
    assert list(out.GetRootLayer().subLayerPaths) == ["../../hero.usdz"]


def test_the_delivery_may_move(tmp_path: Path) -> None:
    """No absolute path: source and output are found again when both move."""
    source = hero(tmp_path / "here" / "héros @1" / "hero.usda")
    spoken = line("hello", SHAPES)
    write(source, tmp_path / "here" / "out" / "en" / "hero.usda", spoken)
    text = (tmp_path / "here" / "out" / "en" / "hero.usda").read_text("utf-8")
    assert str(tmp_path) not in text
    (tmp_path / "here").rename(tmp_path / "there")
    stage = Usd.Stage.Open(str(tmp_path / "there" / "out" / "en" / "hero.usda"))
    assert_played(stage, "/hero/face", spoken.curves)


SCRIPT = """
import sys
sys.path.insert(0, sys.argv[3])
from pathlib import Path
import support.usd_kit as t
character = t.FORMAT.load(Path(sys.argv[1]))
lines = [t.line(name, t.SHAPES[:2], seed=i) for i, name in enumerate("bca")]
t.FORMAT.write(character, lines, Path(sys.argv[2]))
"""


def test_bytes_repeat(tmp_path: Path) -> None:
    source = hero(tmp_path / "hero.usda", old=["browUp", "jawOpen"], weights=[0.5, 0.5])
    digests = set()
    for seed in ("0", "1"):
        target = tmp_path / f"out{seed}" / "hero.usdc"
        command = [
            sys.executable,
            "-c",
            SCRIPT,
            str(source),
            str(target),
            str(Path(__file__).parent),
        ]
        subprocess.run(command, check=True, env={**os.environ, "PYTHONHASHSEED": seed})
        digests.add(digest(target))
    assert len(digests) == 1


def test_faults_of_the_caller(tmp_path: Path) -> None:
    character = FORMAT.load(hero(tmp_path / "hero.usda"))
    target = tmp_path / "out.usdc"
    with pytest.raises(ValueError, match="noseUp"):
        FORMAT.write(character, [line("hello", ["noseUp"])], target)
    with pytest.raises(ValueError, match="distinct"):
        FORMAT.write(character, [line("a", SHAPES), line("a", SHAPES)], target)
    with pytest.raises(ValueError, match="no lines"):
        FORMAT.write(character, [], target)
    assert not target.exists()


def test_unwritable_target(tmp_path: Path) -> None:
    character = FORMAT.load(hero(tmp_path / "hero.usda"))
    (tmp_path / "out").write_text("a file, not a folder")
    with pytest.raises(InputError, match="output-unwritable"):
        FORMAT.write(character, [line("a", SHAPES)], tmp_path / "out" / "hero.usdc")


def test_an_open_stage_sees_the_new_file(tmp_path: Path) -> None:
    source = hero(tmp_path / "hero.usda")
    _, held = write(source, tmp_path / "out.usdc", line("a", SHAPES))
    again = line("a", SHAPES, seed=9)
    _, out = write(source, tmp_path / "out.usdc", again)
    assert held.GetPrimAtPath("/hero/Dialogue/a")
    assert_played(out, "/hero/face", again.curves)
