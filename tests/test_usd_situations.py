"""Every way of building a USD character that studios use: it speaks, or is refused for a reason."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import pytest
from pxr import Sdf, Usd, UsdGeom, UsdSkel

from animeme.errors import InputError
from support.usd_kit import (
    FORMAT,
    SHAPES,
    add_animation,
    add_mesh,
    add_skeleton,
    assert_speaks,
    hero,
    line,
    new_stage,
    select,
    write,
)

BROWS = {0.0: [0.0], 30.0: [1.0]}
Built = Callable[[Path], Path]


def head(path: Path) -> Path:
    """A whole character to refer to."""
    return hero(path, old=["browUp"], weights=BROWS)


def speak(
    source: Path, folder: Path, drive: tuple[str, ...] = ("jawOpen", "mouthClose"), **variants: str
) -> int:
    """Write a line and an assembly, and compare both with the source; how many meshes spoke."""
    spoken = line("hello", drive)
    layer, target = folder / "out" / "en" / "o.usdc", folder / "out" / "o.usda"
    character, _ = write(source, layer, spoken)
    FORMAT.write_assembly(character, {"en": layer}, target)
    assert FORMAT.harm(character, target) == []
    compared = set()
    for file in (layer, target):
        stage = Usd.Stage.Open(str(file))
        if variants:
            select(stage, **variants)
        compared.add(assert_speaks(source, stage, character, spoken.curves))
    (number,) = compared
    return number


def referenced(folder: Path) -> Path:
    head(folder / "head.usda")
    stage = Usd.Stage.CreateNew(str(folder / "scene.usda"))
    stage.SetDefaultPrim(stage.DefinePrim("/world"))
    stage.DefinePrim("/world/bob").GetReferences().AddReference("./head.usda")
    stage.Save()
    return folder / "scene.usda"


def referenced_later_and_slower(folder: Path) -> Path:
    head(folder / "head.usda")
    stage = Usd.Stage.CreateNew(str(folder / "scene.usda"))
    stage.SetDefaultPrim(stage.DefinePrim("/world"))
    references = stage.DefinePrim("/world/bob").GetReferences()
    references.AddReference("./head.usda", "/hero", Sdf.LayerOffset(10, 2))
    stage.Save()
    return folder / "scene.usda"


def payload_with_its_own_start(folder: Path) -> Path:
    head(folder / "head.usda")
    stage = Usd.Stage.CreateNew(str(folder / "scene.usda"))
    stage.SetDefaultPrim(stage.DefinePrim("/bob"))
    stage.GetPrimAtPath("/bob").GetPayloads().AddPayload("./head.usda")
    stage.SetStartTimeCode(101)
    stage.SetEndTimeCode(200)
    stage.Save()
    return folder / "scene.usda"


def sublayer_with_offset_at_another_rate(folder: Path) -> Path:
    head(folder / "head.usda")
    stage = Usd.Stage.CreateNew(str(folder / "scene.usda"))
    stage.GetRootLayer().subLayerPaths.append("./head.usda")
    stage.GetRootLayer().subLayerOffsets[0] = Sdf.LayerOffset(24, 1)
    stage.SetDefaultPrim(stage.GetPrimAtPath("/hero"))
    stage.SetTimeCodesPerSecond(60)
    stage.Save()
    return folder / "scene.usda"


def inbetween(folder: Path) -> Path:
    path = hero(folder / "hero.usda")
    stage = Usd.Stage.Open(str(path))
    shape = UsdSkel.BlendShape(stage.GetPrimAtPath("/hero/face/shape0"))
    half = shape.CreateInbetween("half")
    half.SetWeight(0.5)
    half.SetOffsets([(0, 0, 0.3)] * 3)
    stage.Save()
    return path


def plain(path: Path) -> Usd.Stage:
    stage = new_stage(path)
    add_skeleton(stage, "/hero/rig")
    add_mesh(stage, "/hero/face", "/hero/rig", SHAPES)
    return stage


def unbound_animation(folder: Path) -> Path:
    stage = plain(folder / "hero.usda")
    add_animation(stage, "/hero/walk", ["jawOpen"], BROWS)
    stage.Save()
    return folder / "hero.usda"


def bound_to_nothing(folder: Path) -> Path:
    stage = plain(folder / "hero.usda")
    rig = UsdSkel.BindingAPI(stage.GetPrimAtPath("/hero/rig"))
    rig.CreateAnimationSourceRel().SetTargets(["/hero/nowhere"])
    stage.Save()
    return folder / "hero.usda"


def inherited_animation(folder: Path) -> Path:
    stage = plain(folder / "hero.usda")
    add_animation(stage, "/hero/walk", ["browUp"], BROWS)
    root = UsdSkel.BindingAPI.Apply(stage.GetPrimAtPath("/hero"))
    root.CreateAnimationSourceRel().SetTargets(["/hero/walk"])
    stage.Save()
    return folder / "hero.usda"


def shape_twice(folder: Path) -> Path:
    """UsdSkel moves one of the two; so do we."""
    return hero(folder / "hero.usda", shapes=[*SHAPES, "browUp"])


def names_without_shapes(folder: Path) -> Path:
    stage = plain(folder / "hero.usda")
    stage.RemovePrim("/hero/face/shape2")
    stage.Save()
    return folder / "hero.usda"


def inherited_from_a_class(folder: Path) -> Path:
    stage = Usd.Stage.CreateNew(str(folder / "hero.usda"))
    stage.CreateClassPrim("/_c")
    UsdSkel.Root.Define(stage, "/_c/hero")
    add_skeleton(stage, "/_c/hero/rig")
    add_mesh(stage, "/_c/hero/face", "/_c/hero/rig", SHAPES)
    prim = stage.DefinePrim("/hero")
    prim.GetInherits().AddInherit("/_c/hero")
    stage.SetDefaultPrim(prim)
    stage.Save()
    return folder / "hero.usda"


def without_default_prim(folder: Path) -> Path:
    stage = plain(folder / "hero.usda")
    stage.ClearDefaultPrim()
    stage.Save()
    return folder / "hero.usda"


def z_up(folder: Path) -> Path:
    path = hero(folder / "hero.usda")
    stage = Usd.Stage.Open(str(path))
    UsdGeom.SetStageUpAxis(stage, "Z")
    stage.Save()
    return path


@pytest.mark.parametrize(
    "build",
    [
        referenced,
        referenced_later_and_slower,
        payload_with_its_own_start,
        sublayer_with_offset_at_another_rate,
        inbetween,
        unbound_animation,
        bound_to_nothing,
        inherited_animation,
        shape_twice,
        names_without_shapes,
        inherited_from_a_class,
        without_default_prim,
        z_up,
    ],
    ids=lambda build: build.__name__,
)
def test_it_speaks_and_the_rest_goes_on(tmp_path: Path, build: Built) -> None:
    tmp_path.joinpath("in").mkdir()
    assert speak(build(tmp_path / "in"), tmp_path) == 1


@pytest.mark.parametrize("rate_hz", [24, 30, 60, 1000, 23.976, 29.97])
def test_any_time_codes_and_a_start_of_its_own(tmp_path: Path, rate_hz: float) -> None:
    path = head(tmp_path / "hero.usda")
    stage = Usd.Stage.Open(str(path))
    stage.SetTimeCodesPerSecond(rate_hz)
    stage.SetFramesPerSecond(rate_hz)
    stage.SetStartTimeCode(1001)
    stage.SetEndTimeCode(1100)
    stage.Save()
    assert speak(path, tmp_path) == 1


@pytest.mark.parametrize("nested_root", [True, False])
def test_nested_skeletons(tmp_path: Path, nested_root: bool) -> None:
    stage = new_stage(tmp_path / "hero.usda")
    above = "/hero/head" if nested_root else "/hero/rig"
    add_skeleton(stage, "/hero/rig")
    if nested_root:
        UsdSkel.Root.Define(stage, above)
    add_skeleton(stage, f"{above}/face_rig")
    add_mesh(stage, f"{above}/face", f"{above}/face_rig", SHAPES)
    add_mesh(stage, "/hero/body", "/hero/rig", ["jawOpen", "belly"])
    stage.Save()
    assert speak(tmp_path / "hero.usda", tmp_path) == 2


def test_skeletons_that_share_an_animation(tmp_path: Path) -> None:
    stage = new_stage(tmp_path / "hero.usda")
    add_animation(stage, "/hero/walk", ["browUp", "jawOpen"], [0.5, 0.2])
    for name in "ab":
        add_skeleton(stage, f"/hero/{name}", "/hero/walk")
        add_mesh(stage, f"/hero/mesh_{name}", f"/hero/{name}", SHAPES)
    stage.Save()
    assert speak(tmp_path / "hero.usda", tmp_path, ("jawOpen",)) == 2


def with_variants(path: Path, selected: str, *, rig_too: bool = False) -> Path:
    """The face's shapes are in the variant 'high' only, and partly in 'low'."""
    stage = new_stage(path)
    variants = stage.GetPrimAtPath("/hero").GetVariantSets().AddVariantSet("detail")
    if not rig_too:
        add_skeleton(stage, "/hero/rig")
    for name, shapes in {"none": [], "low": ["browUp"], "high": SHAPES}.items():
        variants.AddVariant(name)
        variants.SetVariantSelection(name)
        with variants.GetVariantEditContext():
            if rig_too and shapes:
                add_skeleton(stage, "/hero/rig")
            if shapes:
                add_mesh(stage, "/hero/face", "/hero/rig", shapes)
    variants.SetVariantSelection(selected)
    stage.Save()
    return path


@pytest.mark.parametrize("selected", ["none", "low", "high"])
def test_shapes_of_every_variant_are_driven(tmp_path: Path, selected: str) -> None:
    source = with_variants(tmp_path / "hero.usda", selected)
    assert set(FORMAT.load(source).shapes) == set(SHAPES)
    assert speak(source, tmp_path, detail="high") == 1
    assert speak(source, tmp_path, detail="low") == 1


def test_a_skeleton_in_another_variant_is_asked_for(tmp_path: Path) -> None:
    source = with_variants(tmp_path / "hero.usda", "none", rig_too=True)
    with pytest.raises(InputError, match=r"'high' of 'detail' on /hero.*asset-variant-unselected"):
        FORMAT.load(source)
    assert speak(with_variants(tmp_path / "hero.usda", "high", rig_too=True), tmp_path) == 1


def test_instances_take_the_animation_of_their_parent(tmp_path: Path) -> None:
    """Nothing inside an instance can be edited, but a skeleton there inherits a binding."""
    hero(tmp_path / "head.usda", animated=False)
    stage = Usd.Stage.CreateNew(str(tmp_path / "crowd.usda"))
    stage.SetDefaultPrim(UsdGeom.Xform.Define(stage, "/crowd").GetPrim())
    add_animation(stage, "/crowd/walk", ["browUp"], BROWS)
    for name in "xy":
        prim = stage.DefinePrim(f"/crowd/{name}")
        prim.GetReferences().AddReference("./head.usda")
        prim.SetInstanceable(True)
    walker = UsdSkel.BindingAPI.Apply(stage.GetPrimAtPath("/crowd/x"))
    walker.CreateAnimationSourceRel().SetTargets(["/crowd/walk"])
    stage.Save()
    assert speak(tmp_path / "crowd.usda", tmp_path, ("jawOpen",)) == 2
    out = Usd.Stage.Open(str(tmp_path / "out" / "o.usda"))
    assert all(out.GetPrimAtPath(f"/crowd/{name}").IsInstance() for name in "xy")


def test_an_instance_at_the_root_is_refused(tmp_path: Path) -> None:
    hero(tmp_path / "head.usda", animated=False)
    stage = Usd.Stage.CreateNew(str(tmp_path / "hero.usda"))
    prim = stage.DefinePrim("/hero")
    stage.SetDefaultPrim(prim)
    prim.GetReferences().AddReference("./head.usda")
    prim.SetInstanceable(True)
    stage.Save()
    with pytest.raises(InputError, match=r"root of the asset.*asset-instanced"):
        FORMAT.load(tmp_path / "hero.usda")


@pytest.mark.parametrize("field", ["timeCodesPerSecond", "framesPerSecond"])
@pytest.mark.parametrize("value", ["0", "inf", "nan"])
def test_time_without_length_is_refused(tmp_path: Path, field: str, value: str) -> None:
    path = hero(tmp_path / "hero.usda")
    text = path.read_text("utf-8")
    path.write_text(text.replace("(\n", f"(\n    {field} = {value}\n", 1), "utf-8")
    with pytest.raises(InputError, match=r"asset-time-invalid|asset-unreadable"):
        FORMAT.load(path)
