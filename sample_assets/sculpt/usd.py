"""Writes a character as OpenUSD with UsdSkel."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from pxr import Gf, Sdf, Usd, UsdGeom, UsdShade, UsdSkel, Vt

from .mesh import Character, JointAnimation, Material, Mesh

FRAMES_PER_SECOND = 24.0


def write_usd(character: Character, path: Path) -> None:
    """Write a character into a ``.usdc`` file."""
    # Authored into an anonymous layer first: the file then holds no traces of the order of edits.
    stage = Usd.Stage.CreateInMemory()
    UsdGeom.SetStageUpAxis(stage, UsdGeom.Tokens.y)
    UsdGeom.SetStageMetersPerUnit(stage, 1.0)
    stage.SetTimeCodesPerSecond(FRAMES_PER_SECOND)
    stage.SetFramesPerSecond(FRAMES_PER_SECOND)
    root = UsdSkel.Root.Define(stage, f"/{character.name}")
    stage.SetDefaultPrim(root.GetPrim())
    top = root.GetPath()
    skeleton = _skeleton(stage, character, top)
    materials = _materials(stage, character, top)
    for mesh in character.meshes:
        _mesh(stage, mesh, character, top, skeleton, materials)
    for animation in character.animations:
        _animation(stage, character, animation, top)
    if character.animations:
        binding = UsdSkel.BindingAPI.Apply(skeleton.GetPrim())
        binding.CreateAnimationSourceRel().SetTargets([top.AppendChild("idle")])
        last = max(float(a.times[-1]) for a in character.animations)
        stage.SetStartTimeCode(0.0)
        stage.SetEndTimeCode(round(last * FRAMES_PER_SECOND))
    extent = [np.concatenate([m.points for m in character.meshes])]
    low, high = extent[0].min(0), extent[0].max(0)
    root.CreateExtentAttr(Vt.Vec3fArray([Gf.Vec3f(*low.tolist()), Gf.Vec3f(*high.tolist())]))
    stage.GetRootLayer().documentation = "animeme contributors, MIT"
    if not stage.GetRootLayer().Export(str(path)):
        raise OSError(f"cannot write {path}")


def _joint_paths(character: Character) -> list[str]:
    """Joint paths from the root, such as ``root/neck/head``."""
    paths: list[str] = []
    for joint in character.joints:
        above = f"{paths[joint.parent]}/" if joint.parent >= 0 else ""
        paths.append(above + joint.name)
    return paths


def _locals(character: Character) -> list[Gf.Vec3d]:
    """Translation of each joint from its parent."""
    result = []
    for joint in character.joints:
        origin = character.joints[joint.parent].position if joint.parent >= 0 else (0.0, 0.0, 0.0)
        local = [round(a - b, 6) + 0.0 for a, b in zip(joint.position, origin, strict=True)]
        result.append(Gf.Vec3d(*local))
    return result


def _skeleton(stage: Usd.Stage, character: Character, top: Sdf.Path) -> UsdSkel.Skeleton:
    """The skeleton with its bind and rest poses."""
    skeleton = UsdSkel.Skeleton.Define(stage, top.AppendChild("Skeleton"))
    skeleton.CreateJointsAttr(Vt.TokenArray(_joint_paths(character)))
    bind = [Gf.Matrix4d().SetTranslate(Gf.Vec3d(*j.position)) for j in character.joints]
    rest = [Gf.Matrix4d().SetTranslate(local) for local in _locals(character)]
    skeleton.CreateBindTransformsAttr(Vt.Matrix4dArray(bind))
    skeleton.CreateRestTransformsAttr(Vt.Matrix4dArray(rest))
    return skeleton


def _materials(
    stage: Usd.Stage, character: Character, top: Sdf.Path
) -> dict[str, UsdShade.Material]:
    """Preview surfaces for all materials, in order of first use."""
    scope = UsdGeom.Scope.Define(stage, top.AppendChild("Materials"))
    found: dict[str, UsdShade.Material] = {}
    for mesh in character.meshes:
        for part in mesh.parts:
            if part.material.name not in found:
                found[part.material.name] = _material(stage, part.material, scope.GetPath())
    return found


def _material(stage: Usd.Stage, material: Material, scope: Sdf.Path) -> UsdShade.Material:
    """One material with a preview surface."""
    prim = UsdShade.Material.Define(stage, scope.AppendChild(material.name))
    shader = UsdShade.Shader.Define(stage, prim.GetPath().AppendChild("Surface"))
    shader.CreateIdAttr("UsdPreviewSurface")
    colour = Gf.Vec3f(*material.colour)
    shader.CreateInput("diffuseColor", Sdf.ValueTypeNames.Color3f).Set(colour)
    shader.CreateInput("roughness", Sdf.ValueTypeNames.Float).Set(material.roughness)
    output = shader.CreateOutput("surface", Sdf.ValueTypeNames.Token)
    prim.CreateSurfaceOutput().ConnectToSource(output)
    return prim


def _mesh(
    stage: Usd.Stage,
    mesh: Mesh,
    character: Character,
    top: Sdf.Path,
    skeleton: UsdSkel.Skeleton,
    materials: dict[str, UsdShade.Material],
) -> None:
    """A skinned mesh with its blendshapes and one subset of faces per material."""
    geometry = UsdGeom.Mesh.Define(stage, top.AppendChild(mesh.name))
    triangles = mesh.triangles()
    points = Vt.Vec3fArray.FromNumpy(mesh.points.astype(np.float32))
    geometry.CreatePointsAttr(points)
    geometry.CreateFaceVertexCountsAttr(Vt.IntArray([3] * len(triangles)))
    geometry.CreateFaceVertexIndicesAttr(Vt.IntArray.FromNumpy(triangles.ravel().astype(np.int32)))
    geometry.CreateSubdivisionSchemeAttr(UsdGeom.Tokens.none)
    geometry.CreateExtentAttr(UsdGeom.PointBased.ComputeExtent(points))
    geometry.CreateNormalsAttr(
        Vt.Vec3fArray.FromNumpy(np.round(mesh.normals(), 4).astype(np.float32))
    )
    geometry.SetNormalsInterpolation(UsdGeom.Tokens.vertex)
    colours = np.concatenate([[p.material.colour] * len(p.triangles) for p in mesh.parts])
    display = geometry.CreateDisplayColorPrimvar(UsdGeom.Tokens.uniform)
    display.Set(Vt.Vec3fArray.FromNumpy(colours.astype(np.float32)))
    _subsets(geometry, mesh, materials)
    _skin(geometry, mesh, skeleton)
    _blendshapes(stage, geometry, mesh)


def _subsets(geometry: UsdGeom.Mesh, mesh: Mesh, materials: dict[str, UsdShade.Material]) -> None:
    """Bind materials: directly if there is one, else to subsets of faces."""
    if len(mesh.parts) == 1:
        material = materials[mesh.parts[0].material.name]
        UsdShade.MaterialBindingAPI.Apply(geometry.GetPrim()).Bind(material)
        return
    start = 0
    for part in mesh.parts:
        faces = Vt.IntArray(list(range(start, start + len(part.triangles))))
        start += len(part.triangles)
        subset = UsdGeom.Subset.CreateGeomSubset(
            geometry,
            part.material.name,
            UsdGeom.Tokens.face,
            faces,
            "materialBind",
            UsdGeom.Tokens.partition,
        )
        material = materials[part.material.name]
        UsdShade.MaterialBindingAPI.Apply(subset.GetPrim()).Bind(material)


def _skin(geometry: UsdGeom.Mesh, mesh: Mesh, skeleton: UsdSkel.Skeleton) -> None:
    """Bind the mesh to the skeleton."""
    binding = UsdSkel.BindingAPI.Apply(geometry.GetPrim())
    joints, weights = mesh.strongest_joints()
    width = joints.shape[1]
    binding.CreateJointIndicesPrimvar(False, width).Set(
        Vt.IntArray.FromNumpy(joints.ravel().astype(np.int32))
    )
    binding.CreateJointWeightsPrimvar(False, width).Set(
        Vt.FloatArray.FromNumpy(weights.ravel().astype(np.float32))
    )
    binding.CreateGeomBindTransformAttr(Gf.Matrix4d(1.0))
    binding.CreateSkeletonRel().SetTargets([skeleton.GetPath()])


def _blendshapes(stage: Usd.Stage, geometry: UsdGeom.Mesh, mesh: Mesh) -> None:
    """Add the targets as blendshapes with sparse offsets."""
    if not mesh.targets:
        return
    paths = []
    for name, delta in mesh.targets.items():
        path = geometry.GetPath().AppendChild(name)
        shape = UsdSkel.BlendShape.Define(stage, path)
        moved = np.flatnonzero(np.abs(delta).max(1) > 0)
        shape.CreateOffsetsAttr(Vt.Vec3fArray.FromNumpy(delta[moved].astype(np.float32)))
        shape.CreatePointIndicesAttr(Vt.IntArray.FromNumpy(moved.astype(np.int32)))
        paths.append(path)
    binding = UsdSkel.BindingAPI(geometry.GetPrim())
    binding.CreateBlendShapesAttr(Vt.TokenArray(list(mesh.targets)))
    binding.CreateBlendShapeTargetsRel().SetTargets(paths)


def _animation(
    stage: Usd.Stage, character: Character, animation: JointAnimation, top: Sdf.Path
) -> None:
    """A joint animation; joints without rotations of their own are left out."""
    prim = UsdSkel.Animation.Define(stage, top.AppendChild(animation.name))
    names = [joint.name for joint in character.joints]
    index = [i for i, name in enumerate(names) if name in animation.rotations]
    joint_paths = _joint_paths(character)
    prim.CreateJointsAttr(Vt.TokenArray([joint_paths[i] for i in index]))
    places = _locals(character)
    prim.CreateTranslationsAttr(Vt.Vec3fArray([Gf.Vec3f(places[i]) for i in index]))
    prim.CreateScalesAttr(Vt.Vec3hArray([Gf.Vec3h(1.0, 1.0, 1.0)] * len(index)))
    rotations = prim.CreateRotationsAttr()
    for k, time in enumerate(animation.times.tolist()):
        quaternions = []
        for i in index:
            x, y, z, w = animation.rotations[names[i]][k].tolist()
            quaternions.append(Gf.Quatf(w, x, y, z))
        rotations.Set(Vt.QuatfArray(quaternions), round(time * FRAMES_PER_SECOND))
