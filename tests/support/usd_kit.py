"""Tiny USD characters, and what UsdSkel and UsdValidation say of files, without our reader."""

from __future__ import annotations

import hashlib
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from pxr import Gf, Usd, UsdGeom, UsdSkel, UsdValidation, Vt

from animeme.contracts import LineAnimation
from animeme.curves import CurveSet
from animeme.rig import Character
from animeme_stages.write.usd import UsdFormat

FORMAT = UsdFormat()
SHARED = Path(__file__).parents[3] / "shared" / "assets"
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
                if not animation:
                    return dict.fromkeys(order, np.zeros(len(times_s)))
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


def assert_speaks(source: Path, stage: Usd.Stage, character: Character, curves: CurveSet) -> int:
    """Driven shapes follow their curves, the other shapes and all joints do as in `source`.

    Returns how many meshes were compared: those that the variants selected on `stage` have.
    """
    before = Usd.Stage.Open(str(source))
    times_s = np.random.default_rng(7).uniform(-0.5, 3.0, 30).tolist()
    wanted = dict(zip(curves.names, curves.sample(times_s).T, strict=True))
    everywhere = Usd.TraverseInstanceProxies(Usd.PrimDefaultPredicate)
    prims = {str(prim.GetPath()): prim for prim in stage.Traverse(everywhere)}
    compared = 0
    for mesh in character.meshes:
        if mesh.path not in prims or not prims[mesh.path].GetAttribute("skel:blendShapes"):
            continue
        compared += 1
        was: dict[str, np.ndarray] = {}
        old = before.GetPrimAtPath(mesh.path)
        if old and old.GetAttribute("skel:blendShapes"):
            was = played(before, mesh.path, times_s)
        for shape, weights in played(stage, mesh.path, times_s).items():
            name = character.canonical.get(shape, shape)
            expected = wanted.get(name, was.get(shape, np.zeros(len(times_s))))
            np.testing.assert_allclose(weights, expected, atol=1e-5, err_msg=f"{mesh.path} {shape}")
    for prim in before.Traverse(everywhere):
        if prim.IsA(UsdSkel.Skeleton) and UsdSkel.Skeleton(prim).GetJointsAttr().Get():
            path = str(prim.GetPath())
            np.testing.assert_array_equal(joints(stage, path), joints(before, path))
    return compared


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
        packed = f"[source/{source.name}]"
        for name in (str(source), str(target), packed, f"{source.parent}/", f"{target.parent}/"):
            messages = {(kind, text.replace(name, "")) for kind, text in messages}
        return messages

    return findings(target) - findings(source)


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
