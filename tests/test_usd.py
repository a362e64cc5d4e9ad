"""The USD format, seen from outside: what plain UsdSkel plays is what went in."""

from __future__ import annotations

import hashlib
import os
import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from pxr import Gf, Sdf, Usd, UsdGeom, UsdSkel, UsdUtils, UsdValidation, Vt

from animeme.contracts import LineAnimation
from animeme.curves import CurveSet
from animeme.errors import InputError
from animeme.rig import Character
from animeme_stages.write.usd import UsdFormat

FORMAT = UsdFormat()
SHARED = Path(__file__).parents[2] / "shared" / "assets"
ICT = SHARED / "ict" / "ict_multimesh_speech.usdc"
JOINTS = ["hip", "hip/head"]
SHAPES = ["jawOpen", "mouthClose", "browUp"]
BODY_CODES = (0.0, 12.0, 48.0)


# Characters, as small as they can be


def add_mesh(stage: Usd.Stage, path: str, skeleton: str, shapes: Sequence[str]) -> UsdGeom.Mesh:
    mesh = UsdGeom.Mesh.Define(stage, path)
    mesh.CreatePointsAttr([(0, 0, 0), (1, 0, 0), (0, 1, 0)])
    mesh.CreateFaceVertexCountsAttr([3])
    mesh.CreateFaceVertexIndicesAttr([0, 1, 2])
    mesh.CreateExtentAttr([(0, 0, 0), (1, 1, 0)])
    targets = []
    for i in range(len(shapes)):
        shape = UsdSkel.BlendShape.Define(stage, f"{path}/shape{i}")
        shape.CreateOffsetsAttr([(0, 0, i + 1)] * 3)
        shape.CreatePointIndicesAttr([0, 1, 2])
        targets.append(shape.GetPath())
    binding = UsdSkel.BindingAPI.Apply(mesh.GetPrim())
    binding.CreateBlendShapesAttr(list(shapes))
    binding.CreateBlendShapeTargetsRel().SetTargets(targets)
    if skeleton:
        binding.CreateSkeletonRel().SetTargets([skeleton])
    return mesh


def add_skeleton(stage: Usd.Stage, path: str, animation: str = "") -> UsdSkel.Skeleton:
    skeleton = UsdSkel.Skeleton.Define(stage, path)
    skeleton.CreateJointsAttr(JOINTS)
    skeleton.CreateBindTransformsAttr([Gf.Matrix4d(1)] * 2)
    rest = [Gf.Matrix4d(1).SetTranslate((0, height, 0)) for height in (3.0, 4.0)]
    skeleton.CreateRestTransformsAttr(rest)
    binding = UsdSkel.BindingAPI.Apply(skeleton.GetPrim())
    if animation:
        binding.CreateAnimationSourceRel().SetTargets([animation])
    return skeleton


def add_animation(
    stage: Usd.Stage,
    path: str,
    shapes: Sequence[str] = (),
    weights: dict[float, list[float]] | list[float] | None = None,
    *,
    body: bool = True,
) -> UsdSkel.Animation:
    animation = UsdSkel.Animation.Define(stage, path)
    if body:
        animation.CreateJointsAttr(JOINTS)
        animation.CreateRotationsAttr([Gf.Quatf(1)] * 2)
        animation.CreateScalesAttr([Gf.Vec3h(1)] * 2)
        moves = animation.CreateTranslationsAttr()
        for code in BODY_CODES:
            moves.Set([Gf.Vec3f(code, 0, 0), Gf.Vec3f(0, code / 2, 1)], code)
    if shapes:
        animation.CreateBlendShapesAttr(list(shapes))
    if isinstance(weights, dict):
        for code, row in weights.items():
            animation.CreateBlendShapeWeightsAttr().Set(row, code)
    elif weights is not None:
        animation.CreateBlendShapeWeightsAttr().Set(weights)
    return animation


def new_stage(path: Path, *, default: bool = True) -> Usd.Stage:
    path.parent.mkdir(parents=True, exist_ok=True)
    stage = Usd.Stage.CreateNew(str(path))
    root = UsdSkel.Root.Define(stage, "/hero").GetPrim()
    if default:
        stage.SetDefaultPrim(root)
    UsdGeom.SetStageUpAxis(stage, "Y")
    UsdGeom.SetStageMetersPerUnit(stage, 0.01)
    return stage


def hero(
    path: Path,
    *,
    shapes: Sequence[str] = SHAPES,
    old: Sequence[str] = (),
    weights: dict[float, list[float]] | list[float] | None = None,
    animated: bool = True,
) -> Path:
    """One mesh, one skeleton, and unless told otherwise an animation of its body."""
    stage = new_stage(path)
    add_skeleton(stage, "/hero/rig", "/hero/rig/walk" if animated else "")
    if animated:
        add_animation(stage, "/hero/rig/walk", old, weights)
    add_mesh(stage, "/hero/face", "/hero/rig", shapes)
    stage.Save()
    return path


def line(
    name: str, shapes: Sequence[str], *, language: str = "en", keys: int = 20, seed: int = 0
) -> LineAnimation:
    rng = np.random.default_rng(seed)
    times_s = np.sort(rng.uniform(0.0, 2.0, keys))
    curves = CurveSet(times_s, tuple(shapes), rng.random((keys, len(shapes))))
    return LineAnimation(name, language, curves, 2.0)


# Reading with UsdSkel alone


def skeleton_query(stage: Usd.Stage, path: str) -> Any:
    cache = UsdSkel.Cache()
    for prim in stage.Traverse():
        if prim.IsA(UsdSkel.Root):
            cache.Populate(
                UsdSkel.Root(prim), Usd.TraverseInstanceProxies(Usd.PrimDefaultPredicate)
            )
    return cache.GetSkelQuery(UsdSkel.Skeleton(stage.GetPrimAtPath(path)))


def played(stage: Usd.Stage, mesh: str, times_s: Sequence[float]) -> dict[str, np.ndarray]:
    """Weights per shape as they reach the mesh, mapped to its own order by UsdSkel."""
    everywhere = Usd.TraverseInstanceProxies(Usd.PrimDefaultPredicate)
    cache = UsdSkel.Cache()
    for prim in stage.Traverse(everywhere):
        if not prim.IsA(UsdSkel.Root):
            continue
        root = UsdSkel.Root(prim)
        cache.Populate(root, everywhere)
        for binding in cache.ComputeSkelBindings(root, everywhere):
            for target in binding.GetSkinningTargets():
                if target.GetPrim().GetPath() != mesh:
                    continue
                animation = cache.GetSkelQuery(binding.GetSkeleton()).GetAnimQuery()
                order = list(target.GetBlendShapeOrder())
                mapper = UsdSkel.AnimMapper(list(animation.GetBlendShapeOrder()), order)
                rows = []
                for time_s in times_s:
                    code = time_s * stage.GetTimeCodesPerSecond()
                    values = Vt.FloatArray(animation.ComputeBlendShapeWeights(code))
                    rows.append(np.array(mapper.Remap(values, Vt.FloatArray(len(order)))))
                return dict(zip(order, np.array(rows).T, strict=True))
    raise AssertionError(f"{mesh} is not bound")


def joints(stage: Usd.Stage, skeleton: str) -> np.ndarray:
    query = skeleton_query(stage, skeleton)
    return np.array(
        [
            [np.array(matrix) for matrix in query.ComputeJointLocalTransforms(code)]
            for code in (0.0, 3.0, 12.0, 31.5, 48.0, 100.0)
        ]
    )


def assert_played(stage: Usd.Stage, mesh: str, curves: CurveSet, **copies: str) -> None:
    """Every shape of `mesh` follows its curve; `copies` are stored names of other curves."""
    times_s = np.random.default_rng(7).uniform(-0.5, 3.0, 40)
    wanted = dict(zip(curves.names, curves.sample(times_s).T, strict=True))
    for shape, weights in played(stage, mesh, times_s.tolist()).items():
        expected = wanted.get(copies.get(shape, shape), np.zeros(len(times_s)))
        np.testing.assert_allclose(weights, expected, atol=1e-5, err_msg=f"{mesh} {shape}")


def select(stage: Usd.Stage, prim: str = "/hero", **variants: str) -> None:
    for name, variant in variants.items():
        sets = stage.GetPrimAtPath(prim).GetVariantSet(name)
        assert variant in sets.GetVariantNames()
        sets.SetVariantSelection(variant)


def digest(path: Path) -> str:
    return hashlib.sha256(path.read_bytes()).hexdigest()


def write(source: Path, target: Path, *lines: LineAnimation) -> tuple[Character, Usd.Stage]:
    """Write, and check what holds for every output: nothing harmed, no new finding."""
    before = digest(source)
    character = FORMAT.load(source)
    assert FORMAT.write(character, lines, target) == (target,)
    assert digest(source) == before
    assert FORMAT.harm(character, target) == []
    assert new_findings(source, target) == set()
    assert [path.name for path in target.parent.iterdir() if path.name.startswith(".")] == []
    return character, Usd.Stage.Open(str(target))


def new_findings(source: Path, target: Path) -> set[tuple[str, str]]:
    """What USD's own validators say about `target` and did not say about `source`."""
    validators = UsdValidation.ValidationRegistry().GetOrLoadAllValidators()
    context = UsdValidation.ValidationContext(validators)

    def findings(path: Path) -> set[tuple[str, str]]:
        stage = Usd.Stage.Open(str(path))
        messages = {(e.GetIdentifier(), e.GetMessage()) for e in context.Validate(stage)}
        for name in (str(source), str(target), f"{source.parent}/", f"{target.parent}/"):
            messages = {(kind, text.replace(name, "")) for kind, text in messages}
        return messages

    return findings(target) - findings(source)


# Loading


def test_load_tells_meshes_shapes_and_rest(tmp_path: Path) -> None:
    path = hero(tmp_path / "hero.usda", old=["browUp", "jawOpen"], weights=[0.25, 0.5])
    character = FORMAT.load(path)
    (mesh,) = character.meshes
    assert (mesh.path, mesh.name, mesh.shapes) == ("/hero/face", "face", tuple(SHAPES))
    assert mesh.rest == (0.5, 0.0, 0.25)
    assert character.animations == ("walk",)
    assert (character.source, character.format) == (path, "usd")


def test_rest_is_the_first_sample(tmp_path: Path) -> None:
    old = {10.0: [0.5], 20.0: [1.0]}
    character = FORMAT.load(hero(tmp_path / "hero.usda", old=["browUp"], weights=old))
    assert character.rest_weights() == {"jawOpen": 0.0, "mouthClose": 0.0, "browUp": 0.5}


def test_numbered_copies_are_one_shape(tmp_path: Path) -> None:
    stage = new_stage(tmp_path / "hero.usda")
    add_skeleton(stage, "/hero/rig")
    add_mesh(stage, "/hero/face", "/hero/rig", ["jawOpen", "viseme1", "viseme2"])
    add_mesh(stage, "/hero/teeth", "/hero/rig", ["jawOpen2"])
    stage.Save()
    assert FORMAT.load(tmp_path / "hero.usda").shapes == ("jawOpen", "viseme1", "viseme2")


@pytest.mark.parametrize(
    ("name", "content"),
    [
        ("damaged.usda", b"#usda 1.0\n( garbage"),
        ("damaged.usdc", b"PXR-USDC" + bytes(100)),
        ("damaged.usdz", b"PK\3\4 and no more"),
        ("empty.usd", b""),
        ("song.usdc", b"RIFF....WAVE"),
    ],
)
def test_damaged_files_are_refused(
    tmp_path: Path, name: str, content: bytes, capfd: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / name).write_bytes(content)
    with pytest.raises(InputError) as caught:
        FORMAT.load(tmp_path / name)
    assert caught.value.code == "asset-unreadable"
    assert name in caught.value.place
    assert capfd.readouterr() == ("", "")


def test_truncated_crate_is_refused(tmp_path: Path) -> None:
    path = hero(tmp_path / "hero.usdc")
    path.write_bytes(path.read_bytes()[:-100])
    with pytest.raises(InputError, match="asset-unreadable"):
        FORMAT.load(path)


@pytest.mark.parametrize("missing", ["none.usda", "."])
def test_what_is_no_file_is_refused(tmp_path: Path, missing: str) -> None:
    with pytest.raises(InputError, match="asset-unreadable"):
        FORMAT.load(tmp_path / missing)


def test_without_blendshapes_refused(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="asset-no-blendshapes"):
        FORMAT.load(hero(tmp_path / "hero.usda", shapes=[]))


def test_missing_parts_are_named(tmp_path: Path) -> None:
    stage = new_stage(tmp_path / "hero.usda")
    stage.GetPrimAtPath("/hero").GetPayloads().AddPayload("./geometry.usdc")
    stage.Save()
    with pytest.raises(InputError, match=r"missing: .*geometry\.usdc.*asset-no-blendshapes"):
        FORMAT.load(tmp_path / "hero.usda")


def test_without_skeleton_refused(tmp_path: Path) -> None:
    stage = new_stage(tmp_path / "hero.usda")
    add_mesh(stage, "/hero/face", "", SHAPES)
    stage.Save()
    with pytest.raises(InputError, match=r"/hero/face .*asset-no-skeleton"):
        FORMAT.load(tmp_path / "hero.usda")


def test_instanced_skeleton_refused(tmp_path: Path) -> None:
    hero(tmp_path / "hero.usda")
    stage = Usd.Stage.CreateNew(str(tmp_path / "crowd.usda"))
    extra = stage.DefinePrim("/crowd/extra")
    extra.GetReferences().AddReference("./hero.usda")
    extra.SetInstanceable(True)
    stage.Save()
    with pytest.raises(InputError, match=r"/crowd/extra.*asset-instanced") as caught:
        FORMAT.load(tmp_path / "crowd.usda")
    assert "instanceable = false" in caught.value.action


def test_instanced_mesh_with_a_skeleton_outside_is_driven(tmp_path: Path) -> None:
    stage = Usd.Stage.CreateNew(str(tmp_path / "head.usda"))
    stage.SetDefaultPrim(UsdGeom.Xform.Define(stage, "/head").GetPrim())
    add_mesh(stage, "/head/face", "", SHAPES)
    stage.Save()
    stage = new_stage(tmp_path / "hero.usda")
    add_skeleton(stage, "/hero/rig")
    UsdSkel.BindingAPI.Apply(stage.GetPrimAtPath("/hero")).CreateSkeletonRel().SetTargets(
        ["/hero/rig"]
    )
    head = stage.DefinePrim("/hero/head", "Xform")
    head.GetReferences().AddReference("./head.usda")
    head.SetInstanceable(True)
    stage.Save()
    spoken = line("hello", SHAPES)
    _, out = write(tmp_path / "hero.usda", tmp_path / "out" / "hero.usdc", spoken)
    assert_played(out, "/hero/head/face", spoken.curves)


# Writing


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
import test_usd as t
character = t.FORMAT.load(Path(sys.argv[1]))
lines = [t.line(name, t.SHAPES[:2], seed=i) for i, name in enumerate("bca")]
t.FORMAT.write(character, lines, Path(sys.argv[2]))
"""


def test_bytes_repeat(tmp_path: Path) -> None:
    source = hero(tmp_path / "hero.usda", old=["browUp", "jawOpen"], weights=[0.5, 0.5])
    digests = set()
    for seed in ("0", "1", "2"):
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


# Languages


def assembled(source: Path, folder: Path) -> tuple[Usd.Stage, dict[tuple[str, str], LineAnimation]]:
    character = FORMAT.load(source)
    lines, files = {}, {}
    for i, language in enumerate(["pt-BR", "en", "zh-Hant-TW"]):
        spoken = [
            line(n, SHAPES[:2], language=language, seed=10 * i + k) for k, n in enumerate("xy")
        ]
        lines |= {(language, each.name): each for each in spoken}
        files[language] = folder / language / f"{source.stem}.usdc"
        FORMAT.write(character, spoken, files[language])
    target = folder / f"{source.stem}.usda"
    assert FORMAT.write_assembly(character, files, target) == (target,)
    assert FORMAT.harm(character, target) == []
    assert new_findings(source, target) == set()
    return Usd.Stage.Open(str(target)), lines


def test_assembly_switches_language_and_line(tmp_path: Path) -> None:
    source = hero(tmp_path / "hero.usda", old=["browUp"], weights={0.0: [0.0], 9.0: [1.0]})
    before = joints(Usd.Stage.Open(str(source)), "/hero/rig")
    brows = played(Usd.Stage.Open(str(source)), "/hero/face", [0.2])["browUp"]
    stage, lines = assembled(source, tmp_path / "out")
    languages = stage.GetPrimAtPath("/hero").GetVariantSet("dialogueLanguage")
    assert languages.GetVariantSelection() == "en"
    for (language, name), spoken in lines.items():
        select(stage, dialogueLanguage=language)
        select(stage, dialogueLine=name)
        weights = played(stage, "/hero/face", [0.2, 1.3])
        for i, shape in enumerate(spoken.curves.names):
            wanted = spoken.curves.sample([0.2, 1.3])[:, i]
            np.testing.assert_allclose(weights[shape], wanted, atol=1e-5)
        np.testing.assert_allclose(weights["browUp"][:1], brows, atol=1e-5)
        np.testing.assert_array_equal(joints(stage, "/hero/rig"), before)
    text = (tmp_path / "out" / "hero.usda").read_text("utf-8")
    assert "timeSamples" not in text
    assert str(tmp_path) not in text
    assert stage.GetEndTimeCode() == 48.0


def test_assembly_of_what_lies_outside_the_character(tmp_path: Path) -> None:
    """Animation inside an instance and materials elsewhere survive the reference."""
    stage = new_stage(tmp_path / "hero.usda")
    add_skeleton(stage, "/hero/rig", "/clips/first/walk")
    add_mesh(stage, "/hero/face", "/hero/rig", SHAPES)
    stage.CreateClassPrim("/proto")
    add_animation(stage, "/proto/walk", ["browUp"], [0.5])
    clip = stage.DefinePrim("/clips/first")
    clip.GetReferences().AddInternalReference("/proto")
    clip.SetInstanceable(True)
    paint = stage.DefinePrim("/looks/skin", "Material").GetPath()
    stage.GetPrimAtPath("/hero/face").CreateRelationship("look").SetTargets([paint])
    stage.Save()
    before = joints(stage, "/hero/rig")
    out, lines = assembled(tmp_path / "hero.usda", tmp_path / "out")
    for language, name in lines:
        select(out, dialogueLanguage=language)
        select(out, dialogueLine=name)
        np.testing.assert_array_equal(joints(out, "/hero/rig"), before)
        assert played(out, "/hero/face", [1.0])["browUp"] == [0.5]
    assert out.GetPrimAtPath("/hero/face").GetRelationship("look").GetTargets() == [paint]


def test_no_languages_no_assembly(tmp_path: Path) -> None:
    character = FORMAT.load(hero(tmp_path / "hero.usda"))
    assert FORMAT.write_assembly(character, {}, tmp_path / "out.usda") == ()


# Reading


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


# Harm


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


# Real assets

REFUSED = {
    "mayausd_HIK_Export.usda": "asset-no-blendshapes",
    "openusd_populate.usda": "asset-instanced",
    "tinyusdz_inbetween-blendshape-001.usda": "asset-no-blendshapes",
    "usdwg_CesiumMan.usdz": "asset-no-blendshapes",
}


def real_assets() -> list[Any]:
    params = []
    files = sorted((SHARED / "usd").glob("*.usd*")) if SHARED.exists() else []
    for path in [*files, ICT]:
        absent = pytest.mark.skipif(not path.exists(), reason=f"{path} is not here")
        params.append(pytest.param(path, marks=absent, id=path.name))
    return params


@pytest.mark.parametrize("source", real_assets())
def test_real_assets_are_written_or_refused(tmp_path: Path, source: Path) -> None:
    if code := REFUSED.get(source.name):
        with pytest.raises(InputError, match=code):
            FORMAT.load(source)
        return
    character = FORMAT.load(source)
    spoken = line("hello", character.shapes)
    _, out = write(source, tmp_path / "en" / "real.usdc", spoken)
    for mesh in character.meshes:
        assert_played(out, mesh.path, spoken.curves, **dict(character.canonical))
    before = Usd.Stage.Open(str(source))
    for prim in before.Traverse():
        if prim.IsA(UsdSkel.Skeleton):
            path = str(prim.GetPath())
            np.testing.assert_array_equal(joints(out, path), joints(before, path))
    read = FORMAT.read_animations(tmp_path / "en" / "real.usdc")["hello"]
    assert set(read.names) == set(character.shapes)
    target = tmp_path / "real.usda"
    FORMAT.write_assembly(character, {"en": tmp_path / "en" / "real.usdc"}, target)
    assert FORMAT.harm(character, target) == []
    for mesh in character.meshes:
        assert_played(
            Usd.Stage.Open(str(target)), mesh.path, spoken.curves, **dict(character.canonical)
        )


@pytest.mark.skipif(not ICT.exists(), reason=f"{ICT} is not here")
def test_ict_head() -> None:
    character = FORMAT.load(ICT)
    assert len(character.meshes) == 12
    assert len(character.shapes) == 23
    assert character.animations == ("Action",)
