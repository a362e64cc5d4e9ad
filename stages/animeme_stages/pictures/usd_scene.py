"""Meshes of USD: polygons, blendshapes with inbetweens, skins at rest and plain colours."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
from pxr import Ar, Gf, Usd, UsdGeom, UsdShade, UsdSkel

from animeme.errors import InputError
from animeme.rig import Character
from animeme_stages.ingest.usd import open_stage, usd_errors
from animeme_stages.ingest.usd_meshes import EVERYWHERE
from animeme_stages.pictures import textures
from animeme_stages.pictures.raster import Floats, Indices, Singles
from animeme_stages.pictures.scene import (
    CLAY,
    Colour,
    Material,
    Primitive,
    SceneMesh,
    Target,
    is_cover,
    require_finite,
    skinned,
    welded,
)

_BROKEN = (IndexError, MemoryError, TypeError, ValueError)


def read_meshes(character: Character) -> Iterator[SceneMesh]:
    """Every mesh on the stage that is rendered.

    Raises:
        InputError: ``asset-unreadable``: a mesh is broken.
    """
    path = character.source
    stage = open_stage(path)
    with usd_errors(path):
        try:
            yield from _Reader(character, stage).meshes()
        except _BROKEN as error:
            raise InputError(
                "asset-unreadable",
                f"has a mesh that cannot be followed ({error!s:.120})",
                place=str(path),
                action="Export the asset anew, and check that it opens in usdview.",
            ) from error


class _Reader:
    """One stage, turned so that +Y is up."""

    def __init__(self, character: Character, stage: Usd.Stage) -> None:
        self.character, self.stage = character, stage
        time = Usd.TimeCode(stage.GetStartTimeCode()) if stage.HasAuthoredTimeCodeRange() else None
        self.time = time or Usd.TimeCode.EarliestTime()
        self.places = UsdGeom.XformCache(self.time)
        self.skeletons = UsdSkel.Cache()
        self.upright = np.eye(4)
        if UsdGeom.GetStageUpAxis(stage) == UsdGeom.Tokens.z:
            self.upright[1:3, 1:3] = [[0.0, 1.0], [-1.0, 0.0]]

    def meshes(self) -> Iterator[SceneMesh]:
        """Every mesh that is visible and no guide or proxy."""
        for prim in Usd.PrimRange.Stage(self.stage, EVERYWHERE):
            if prim.IsA(UsdSkel.Root):
                self.skeletons.Populate(UsdSkel.Root(prim), EVERYWHERE)
        for prim in Usd.PrimRange.Stage(self.stage, EVERYWHERE):
            if not prim.IsA(UsdGeom.Mesh):
                continue
            mesh = UsdGeom.Mesh(prim)
            hidden = mesh.ComputeVisibility(self.time) == UsdGeom.Tokens.invisible
            shown = mesh.ComputePurpose() in (UsdGeom.Tokens.default_, UsdGeom.Tokens.render)
            if shown and not hidden and mesh.GetPointsAttr().Get(self.time):
                yield self._mesh(mesh)

    def _mesh(self, mesh: UsdGeom.Mesh) -> SceneMesh:
        prim = mesh.GetPrim()
        points = np.array(mesh.GetPointsAttr().Get(self.time), dtype=np.float64)
        counts = np.array(mesh.GetFaceVertexCountsAttr().Get(self.time), dtype=np.int64)
        corners = np.array(mesh.GetFaceVertexIndicesAttr().Get(self.time), dtype=np.int64)
        if counts.sum() != len(corners) or (corners >= len(points)).any() or (corners < 0).any():
            raise ValueError(f"{prim.GetPath()}: faces of vertices that are not there")
        targets = self._targets(prim, len(points))
        points, targets = self._placed(prim, points, targets)
        require_finite(points, *(target.offsets for target in targets.values()))
        uv, split = self._uv(prim, corners, len(points))
        origin = np.arange(len(points)) if split is None else split[0]
        corner_vertex = corners if split is None else split[1]
        triangle_corners, face = _fans(counts)
        if mesh.GetOrientationAttr().Get() == UsdGeom.Tokens.leftHanded:
            triangle_corners = triangle_corners[:, ::-1]
        primitives = [
            Primitive(corner_vertex[triangle_corners[np.isin(face, faces)]], material)
            for faces, material in self._materials(mesh, len(counts))
        ]
        return SceneMesh(
            prim.GetName(),
            points[origin],
            primitives,
            {name: Target(t.weights, t.offsets[:, origin]) for name, t in targets.items()},
            {},
            welded(points[origin]),
            uv,
            self._tint(mesh, len(points), origin),
        )

    def _targets(self, prim: Usd.Prim, count: int) -> dict[str, Target]:
        """Blendshapes by canonical name, in the mesh's space."""
        query = UsdSkel.BlendShapeQuery(UsdSkel.BindingAPI(prim))
        names = UsdSkel.BindingAPI(prim).GetBlendShapesAttr().Get() or []
        found: dict[str, Target] = {}
        for index, name in enumerate(map(str, names)):
            if index >= query.GetNumBlendShapes():
                break
            shape = query.GetBlendShape(index)
            canonical = self.character.canonical.get(name)
            if canonical is None or canonical in found or not shape:
                continue
            at = np.array(shape.GetPointIndicesAttr().Get() or (), dtype=np.int64)
            poses = [(1.0, shape.GetOffsetsAttr().Get())]
            for between in shape.GetInbetweens():
                weight = between.GetWeight()
                if weight not in (None, 0.0, 1.0):
                    poses.append((float(weight), between.GetOffsets()))
            poses.sort(key=lambda pose: pose[0])
            offsets = np.zeros((len(poses), count, 3))
            for k, (_, stored) in enumerate(poses):
                values = np.array(stored or (), dtype=np.float64).reshape(-1, 3)
                if len(values) == (len(at) or count):
                    offsets[k, at if len(at) else slice(None)] = values
            found[canonical] = Target(tuple(weight for weight, _ in poses), offsets)
        return found

    def _placed(
        self, prim: Usd.Prim, points: Floats, targets: dict[str, Target]
    ) -> tuple[Floats, dict[str, Target]]:
        """Points and displacements in world space, as the skeleton stands when the stage starts."""
        local = np.array(self.places.GetLocalToWorldTransform(prim)).T
        skin = self.skeletons.GetSkinningQuery(prim)
        skeleton = UsdSkel.BindingAPI(prim).GetInheritedSkeleton() if skin else None
        query = self.skeletons.GetSkelQuery(skeleton) if skeleton else None
        offsets = [target.offsets for target in targets.values()]
        if skin and query and skin.HasJointInfluences():
            posed = query.ComputeSkinningTransforms(self.time)
            influences = skin.ComputeVaryingJointInfluences(len(points), self.time)
            if posed and influences:
                mapper = skin.GetJointMapper()
                posed = mapper.RemapTransforms(posed) if mapper else posed
                joints = np.array(influences[0], dtype=np.int64).reshape(len(points), -1)
                shares = np.array(influences[1], dtype=np.float64).reshape(len(points), -1)
                bind = np.array(skin.GetGeomBindTransform(self.time)).T
                matrices = np.array(posed, dtype=np.float64).transpose(0, 2, 1) @ bind
                points, offsets = skinned(points, offsets, joints, shares, matrices)
                # What is skinned lives in the skeleton's space.
                local = np.array(self.places.GetLocalToWorldTransform(query.GetPrim())).T
        world = self.upright @ local
        turn = world[:3, :3].T
        placed = {
            name: Target(target.weights, offset @ turn)
            for (name, target), offset in zip(targets.items(), offsets, strict=True)
        }
        return points @ turn + world[:3, 3], placed

    def _uv(
        self, prim: Usd.Prim, corners: Indices, count: int
    ) -> tuple[Singles | None, tuple[Indices, Indices] | None]:
        """Texture coordinates, and how vertices are split at their seams.

        Returns:
            (V, 2) with v down, or None; vertices (V,) that they were split from and those of each
            corner (C,), or None where none was split.
        """
        primvar = UsdGeom.PrimvarsAPI(prim).FindPrimvarWithInheritance("st")
        flat = primvar.ComputeFlattened(self.time) if primvar else None
        values = np.array(flat if flat is not None else (), dtype=np.float32)
        if values.ndim != 2 or values.shape[1] != 2:
            return None, None
        values = values * np.array([1, -1], np.float32) + np.array([0, 1], np.float32)
        if len(values) == count:
            return values, None
        if len(values) != len(corners):
            return None, None
        keys = np.stack([corners, *np.round(values.T * 65536).astype(np.int64)], axis=1)
        _, first, inverse = np.unique(keys, axis=0, return_index=True, return_inverse=True)
        return values[first], (corners[first], inverse.reshape(-1))

    def _tint(self, mesh: UsdGeom.Mesh, count: int, origin: Indices) -> Singles | None:
        """Colours per vertex, where the mesh has them."""
        primvar = mesh.GetDisplayColorPrimvar()
        if primvar.GetInterpolation() not in (UsdGeom.Tokens.vertex, UsdGeom.Tokens.varying):
            return None
        values = np.array(primvar.ComputeFlattened(self.time) or (), dtype=np.float32)
        return values[origin] if values.shape == (count, 3) else None

    def _materials(self, mesh: UsdGeom.Mesh, count: int) -> Iterator[tuple[Indices, Material]]:
        """Faces, and the material that they have."""
        left = np.ones(count, dtype=bool)
        for subset in UsdShade.MaterialBindingAPI(mesh).GetMaterialBindSubsets():
            faces = np.array(subset.GetIndicesAttr().Get(self.time) or (), dtype=np.int64)
            faces = faces[(faces >= 0) & (faces < count)]
            left[faces] = False
            if material := self._material(subset.GetPrim(), mesh):
                yield faces, material
        if left.any() and (material := self._material(mesh.GetPrim(), mesh)):
            yield np.flatnonzero(left), material

    def _material(self, prim: Usd.Prim, mesh: UsdGeom.Mesh) -> Material | None:
        """The material bound to `prim`, None if what has it is not drawn."""
        both = bool(mesh.GetDoubleSidedAttr().Get())
        bound = UsdShade.MaterialBindingAPI(prim).ComputeBoundMaterial()[0]
        if bound and is_cover(bound.GetPrim().GetName()):
            return None
        surface = bound.ComputeSurfaceSource()[0] if bound else None
        if surface and surface.GetIdAttr().Get() == "UsdPreviewSurface":
            colour, texture = _input(surface, "diffuseColor", (0.18, 0.18, 0.18))
            rough, _ = _input(surface, "roughness", 0.5)
            opacity, holes = _input(surface, "opacity", 1.0)
            if holes is None and opacity < 0.5:
                return None
            return Material(_colour(colour), float(rough), both, texture)
        primvar = mesh.GetDisplayColorPrimvar()
        shown = primvar.Get(self.time) if primvar else None
        if shown and primvar.GetInterpolation() == UsdGeom.Tokens.constant:
            return Material(_colour(shown[0]), double_sided=both)
        tinted = shown and primvar.GetInterpolation() in ("vertex", "varying")
        return Material((1.0, 1.0, 1.0) if tinted else CLAY, double_sided=both)


def _colour(value: Any) -> Colour:
    red, green, blue = (float(part) for part in value)
    return red, green, blue


def _fans(counts: Indices) -> tuple[Indices, Indices]:
    """Polygons cut into triangles: corners (T, 3), and the face (T,) that each is of."""
    starts = np.cumsum(counts) - counts
    pieces = np.maximum(counts - 2, 0)
    face = np.repeat(np.arange(len(counts)), pieces)
    step = np.arange(len(face)) - np.repeat(np.cumsum(pieces) - pieces, pieces)
    first = starts[face]
    return np.stack([first, first + step + 1, first + step + 2], axis=1), face


def _input(shader: UsdShade.Shader, name: str, missing: Any) -> tuple[Any, Singles | None]:
    """Value of a shader's input, and the texture that it reads instead."""
    found = shader.GetInput(name)
    if not found:
        return missing, None
    for attribute in found.GetValueProducingAttributes():
        source = UsdShade.Shader(attribute.GetPrim())
        if source and source.GetIdAttr().Get() == "UsdUVTexture":
            file = source.GetInput("file")
            texture = _texture(file.Get() if file else None)
            plain = CLAY if name == "diffuseColor" else missing
            white = (1.0, 1.0, 1.0) if name == "diffuseColor" else missing
            return (plain if texture is None else white), texture
        value = attribute.Get()
        if isinstance(value, Gf.Vec3f | float | int):
            return value, None
    return missing, None


def _texture(asset: Any) -> Singles | None:
    """The image behind an asset path, None if it cannot be read."""
    resolved = getattr(asset, "resolvedPath", "")
    if not Path(Ar.SplitPackageRelativePathOuter(resolved)[0]).is_file():
        return None
    opened = Ar.GetResolver().OpenAsset(Ar.ResolvedPath(resolved))
    return textures.decoded(bytes(opened.GetBuffer())) if opened else None
