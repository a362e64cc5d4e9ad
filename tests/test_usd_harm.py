"""Reading animations back, and seeing every harm."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from pxr import Gf, Sdf, Usd, UsdGeom, UsdSkel

from animeme.curves import CurveSet
from animeme.errors import InputError
from support.usd_kit import (
    FORMAT,
    SHAPES,
    add_animation,
    add_mesh,
    add_skeleton,
    hero,
    line,
    new_stage,
    write,
)


def test_read_foreign_animations(tmp_path: Path) -> None:
    stage = new_stage(tmp_path / "hero.usda")
    stage.SetTimeCodesPerSecond(48)
    add_skeleton(stage, "/hero/rig")
    add_mesh(stage, "/hero/face", "/hero/rig", SHAPES)
    add_mesh(stage, "/hero/teeth", "/hero/rig", ["jawOpen2", "mouthClose2"])
    names = ["jawOpen", "jawOpen2", "mouthClose", "mouthClose2"]
    add_animation(stage, "/hero/still", names, [0.5, 0.5, 0.25, 0.75])
    add_animation(stage, "/hero/one/Anim", ["jawOpen"], {24.0: [0.0], 96.0: [1.0]})
    add_animation(stage, "/hero/two/Anim", ["other"], {0.0: [0.5]})
    add_animation(stage, "/hero/body")
    stage.Save()
    read = FORMAT.read_animations(tmp_path / "hero.usda")
    assert set(read) == {"still", "/hero/one/Anim", "/hero/two/Anim"}
    assert read["still"] == CurveSet(
        np.zeros(1), ("jawOpen", "mouthClose", "mouthClose2"), np.array([[0.5, 0.25, 0.75]])
    )
    assert read["/hero/one/Anim"].times_s.tolist() == [0.5, 2.0]


@pytest.mark.parametrize("weights", [[0.5], [0.5, float("nan")], {0.0: [1.0, 0.0], 9.0: [1.0]}])
def test_weights_that_do_not_fit(tmp_path: Path, weights: Any) -> None:
    """A line's are reported; of other animations, UsdSkel and we read what fits."""
    source = hero(tmp_path / "hero.usda", old=["browUp", "jawOpen"], weights=weights)
    fitting = FORMAT.read_animations(source)
    assert [curves.weights.shape for curves in fitting.values()] in ([], [(1, 2)])
    _, out = write(source, tmp_path / "out.usda", line("hello", SHAPES))
    spoken = UsdSkel.Animation(out.GetPrimAtPath("/hero/Dialogue/hello"))
    spoken.GetBlendShapeWeightsAttr().Clear()
    for code, row in (weights if isinstance(weights, dict) else {0.0: weights}).items():
        spoken.GetBlendShapeWeightsAttr().Set([*row, 0.0], code)
    out.Save()
    with pytest.raises(InputError, match=r"/hero/Dialogue/hello.*asset-animation-invalid"):
        FORMAT.read_animations(tmp_path / "out.usda")


def spoil_points(stage: Usd.Stage) -> None:
    stage.GetPrimAtPath("/hero/face").GetAttribute("points").Set([(9, 9, 9)] * 3)


def spoil_body(stage: Usd.Stage) -> None:
    line_prim = UsdSkel.Animation(stage.GetPrimAtPath("/hero/Dialogue/hello"))
    line_prim.GetTranslationsAttr().Set([Gf.Vec3f(0)] * 2, 0.0)


def drop_body(stage: Usd.Stage) -> None:
    stage.GetPrimAtPath("/hero/Dialogue/hello").GetReferences().ClearReferences()


def drop_shapes(stage: Usd.Stage) -> None:
    line_prim = UsdSkel.Animation(stage.GetPrimAtPath("/hero/Dialogue/hello"))
    line_prim.GetBlendShapesAttr().Set(["jawOpen"])


def hide_mesh(stage: Usd.Stage) -> None:
    stage.GetPrimAtPath("/hero/face").SetActive(False)


def retarget_mesh(stage: Usd.Stage) -> None:
    stage.GetPrimAtPath("/hero/face").GetRelationship("skel:skeleton").SetTargets(["/hero"])


def retype(stage: Usd.Stage) -> None:
    stage.GetPrimAtPath("/hero").SetTypeName("Xform")


def annotate(stage: Usd.Stage) -> None:
    stage.GetPrimAtPath("/hero").SetCustomDataByKey("seen", True)


def add_prim(stage: Usd.Stage) -> None:
    UsdGeom.Cube.Define(stage, "/hero/cube")


def override_in_variant(stage: Usd.Stage) -> None:
    variants = stage.GetPrimAtPath("/hero").GetVariantSet("dialogueLine")
    with variants.GetVariantEditContext():
        stage.GetPrimAtPath("/hero/face").SetCustomDataByKey("seen", True)


def turn_over(stage: Usd.Stage) -> None:
    UsdGeom.SetStageUpAxis(stage, "Z")


def speed_up(stage: Usd.Stage) -> None:
    stage.SetTimeCodesPerSecond(60)


def shorten(stage: Usd.Stage) -> None:
    stage.SetEndTimeCode(1)


def shift(stage: Usd.Stage) -> None:
    stage.GetRootLayer().subLayerOffsets[0] = Sdf.LayerOffset(5)


def hide_source(stage: Usd.Stage) -> None:
    stage.GetRootLayer().subLayerPaths.insert(0, "./other.usda")


def drop_source(stage: Usd.Stage) -> None:
    stage.GetRootLayer().subLayerPaths.clear()


@pytest.mark.parametrize(
    ("spoil", "said"),
    [
        (spoil_points, "/hero/face.points is overridden"),
        (spoil_body, "lost the translations"),
        (drop_body, "lost the joints"),
        (drop_shapes, "lost the shapes browUp"),
        (hide_mesh, "/hero/face"),
        (retarget_mesh, "/hero/face.skel:skeleton is overridden"),
        (retype, "defined anew"),
        (annotate, "/hero has its customData overridden"),
        (add_prim, "/hero/cube is not in the source"),
        (override_in_variant, "/hero/face has its customData overridden"),
        (turn_over, "up axis"),
        (speed_up, "time codes per second"),
        (shorten, "time range"),
        (shift, "shifted or stretched"),
        (hide_source, "./other.usda hides"),
        (drop_source, "not among the sublayers"),
    ],
)
def test_harm_is_seen(tmp_path: Path, spoil: Any, said: str) -> None:
    source = hero(tmp_path / "hero.usda", old=["browUp"], weights=[0.5])
    stage = Usd.Stage.Open(str(source))
    stage.SetEndTimeCode(90)
    stage.Save()
    Usd.Stage.CreateNew(str(tmp_path / "other.usda")).Save()
    character, out = write(source, tmp_path / "out.usda", line("hello", ["jawOpen"]))
    spoil(out)
    out.Save()
    assert any(said in harm for harm in FORMAT.harm(character, tmp_path / "out.usda"))


def test_harm_of_a_damaged_output(tmp_path: Path) -> None:
    character = FORMAT.load(hero(tmp_path / "hero.usda"))
    (tmp_path / "out.usdc").write_bytes(b"PXR-USDC")
    with pytest.raises(InputError, match=r"out.usdc.*asset-unreadable"):
        FORMAT.harm(character, tmp_path / "out.usdc")
