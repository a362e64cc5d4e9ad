"""Viewing copies of USD: meshes, blendshapes and colours of a stage as a GLB."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from pxr import Gf, Usd, UsdGeom, UsdShade, UsdSkel

from animeme import registry
from animeme.files import anywhere
from animeme_stages.ingest.usd import open_stage, usd_errors
from animeme_stages.ingest.usd_meshes import EVERYWHERE, skinning_targets
from animeme_stages.review.view import MeshView, View, is_cover
from animeme_stages.review.view_gltf import pack

Floats = NDArray[np.float32]
Ints = NDArray[np.int64]
_FLOAT, _UINT = 5126, 5125
# Colour of what has none, linear RGB.
_GREY = (0.55, 0.5, 0.47)


def view_usd(path: Path) -> View:
    """The viewing copy of a USD file: every visible mesh as it is bound, with its blendshapes.

    Skeletons stay as they are bound, textures and subdivision are left out.

    Raises:
        InputError: it cannot be read.
    """
    character = registry.format_named("usd").load(path, within=anywhere(path))
    stage = open_stage(path)
    spoken = {mesh.path: mesh.shapes for mesh in character.meshes}
    with usd_errors(path):
        made = _Maker(stage, spoken, character.canonical)
        return View(made.glb(), tuple(made.views), 1, tuple(made.notes))


class _Maker:
    """Gathers the meshes of a stage into a glTF document."""

    def __init__(
        self,
        stage: Usd.Stage,
        spoken: Mapping[str, tuple[str, ...]],
        canonical: Mapping[str, str],
    ) -> None:
        self._spoken, self._canonical = spoken, canonical
        self._root: dict[str, Any] = {
            name: [] for name in ("nodes", "meshes", "materials", "accessors", "bufferViews")
        }
        self._data = bytearray()
        self._materials: dict[tuple[float, ...], int] = {}
        self._cache = UsdGeom.XformCache(Usd.TimeCode.EarliestTime())
        self._skins = _skins(stage)
        self._upright = _upright(stage)
        self.views: list[MeshView] = []
        self.notes: list[str] = []
        for prim in Usd.PrimRange.Stage(stage, EVERYWHERE):
            if prim.IsA(UsdGeom.Mesh) and _is_seen(UsdGeom.Imageable(prim)):
                self._mesh(UsdGeom.Mesh(prim))

    def glb(self) -> bytes:
        """The document."""
        nodes = list(range(len(self._root["nodes"])))
        head = {"asset": {"version": "2.0"}, "scene": 0, "scenes": [{"nodes": nodes}]}
        return pack(head | self._root, bytes(self._data))

    def _mesh(self, mesh: UsdGeom.Mesh) -> None:
        early = Usd.TimeCode.EarliestTime()
        points = np.array(mesh.GetPointsAttr().Get(early) or (), np.float64).reshape(-1, 3)
        counts = np.array(mesh.GetFaceVertexCountsAttr().Get(early) or (), np.int64)
        corners = np.array(mesh.GetFaceVertexIndicesAttr().Get(early) or (), np.int64)
        sound = len(points) and len(counts) and counts.sum() == len(corners)
        if not sound or corners.min() < 0 or corners.max() >= len(points):
            return
        matrix = self._placed(mesh)
        world = (points @ matrix[:3, :3] + matrix[3, :3]).astype(np.float32)
        flipped = mesh.GetOrientationAttr().Get() == UsdGeom.Tokens.leftHanded
        triangles, faces = _fan(counts, corners, flipped != (np.linalg.det(matrix[:3, :3]) < 0))
        attributes = {
            "POSITION": self._floats(world, bounds=True),
            "NORMAL": self._floats(_normals(world, triangles)),
        }
        path = str(mesh.GetPath())
        shapes = self._shapes(mesh, self._spoken.get(path, ()))
        targets = [
            {"POSITION": self._offsets(at, moves @ matrix[:3, :3], len(points))}
            for _, at, moves in shapes
        ]
        primitives = []
        for colour, chosen in self._parts(mesh, len(counts)):
            own = triangles if chosen is None else triangles[np.isin(faces, chosen)]
            if len(own):
                primitive: dict[str, Any] = {
                    "attributes": attributes,
                    "indices": self._indices(own.reshape(-1)),
                    "material": self._material(colour),
                }
                primitives.append(primitive | ({"targets": targets} if targets else {}))
        if not primitives:
            return
        number = len(self._root["nodes"])
        self._root["nodes"].append({"mesh": number, "name": mesh.GetPrim().GetName()})
        self._root["meshes"].append({"primitives": primitives})
        if targets:
            names = tuple(self._canonical.get(name, name) for name, *_ in shapes)
            self.views.append(MeshView(number, names, (0.0,) * len(names)))

    def _placed(self, mesh: UsdGeom.Mesh) -> NDArray[np.float64]:
        """Matrix from the mesh's points to the picture, for row vectors."""
        prim = mesh.GetPrim()
        local = self._cache.GetLocalToWorldTransform(prim)
        if prim.GetPath() in self._skins:  # placed by its skeleton, not by its own transform
            skeleton, bind = self._skins[prim.GetPath()]
            local = bind * self._cache.GetLocalToWorldTransform(skeleton)
        return np.array(local, dtype=np.float64) @ self._upright

    def _shapes(
        self, mesh: UsdGeom.Mesh, wanted: tuple[str, ...]
    ) -> list[tuple[str, Ints, Floats]]:
        """Name, moved points and their offsets of each blendshape."""
        binding = UsdSkel.BindingAPI(mesh.GetPrim())
        names = [str(name) for name in binding.GetBlendShapesAttr().Get() or ()]
        paths = binding.GetBlendShapeTargetsRel().GetTargets()
        found: dict[str, tuple[str, Ints, Floats]] = {}
        count = len(mesh.GetPointsAttr().Get(Usd.TimeCode.EarliestTime()))
        for name, path in zip(names, paths, strict=False):
            shape = UsdSkel.BlendShape(mesh.GetPrim().GetStage().GetPrimAtPath(path))
            if not shape or name not in wanted or name in found:
                continue
            moves = np.array(shape.GetOffsetsAttr().Get() or (), np.float32).reshape(-1, 3)
            at = np.array(shape.GetPointIndicesAttr().Get() or (), np.int64)
            at = at if len(at) else np.arange(len(moves))
            if len(at) == len(moves) and (not len(at) or (at.min() >= 0 and at.max() < count)):
                found[name] = (name, at, moves)
                if shape.GetInbetweens():
                    self._note("In-between shapes are not shown.")
        return list(found.values())

    def _parts(
        self, mesh: UsdGeom.Mesh, faces: int
    ) -> Iterator[tuple[tuple[float, ...], Ints | None]]:
        """Colour and faces of each part of a mesh; None for all of them."""
        binding = UsdShade.MaterialBindingAPI(mesh.GetPrim())
        subsets = binding.GetMaterialBindSubsets()
        taken = np.zeros(faces, bool)
        for subset in subsets:
            at = np.array(subset.GetIndicesAttr().Get() or (), np.int64)
            at = at[(at >= 0) & (at < faces)]
            taken[at] = True
            yield self._colour(subset.GetPrim(), mesh), at
        if not subsets:
            yield self._colour(mesh.GetPrim(), mesh), None
        elif not taken.all():
            yield self._colour(mesh.GetPrim(), mesh), np.flatnonzero(~taken)

    def _colour(self, prim: Usd.Prim, mesh: UsdGeom.Mesh) -> tuple[float, ...]:
        """Base colour, opacity and roughness; linear."""
        material, _ = UsdShade.MaterialBindingAPI(prim).ComputeBoundMaterial()
        if material and is_cover(material.GetPrim().GetName()):
            return (0.0, 0.0, 0.0, 0.0, 1.0)
        surface = material.ComputeSurfaceSource()[0] if material else None
        if surface:
            colour = _value(surface, "diffuseColor")
            if isinstance(colour, Gf.Vec3f):
                opacity, rough = _value(surface, "opacity"), _value(surface, "roughness")
                alpha = opacity if isinstance(opacity, float) else 1.0
                return (*map(float, colour), alpha, rough if isinstance(rough, float) else 0.6)
            self._note("Textures of USD are not shown.")
        shown = mesh.GetDisplayColorAttr().Get()
        colour = tuple(map(float, shown[0])) if shown else _GREY
        return (*colour, 1.0, 0.6)

    def _material(self, colour: tuple[float, ...]) -> int:
        if colour not in self._materials:
            self._materials[colour] = len(self._root["materials"])
            *rgba, rough = colour
            pbr = {"baseColorFactor": rgba, "metallicFactor": 0.0, "roughnessFactor": rough}
            clear = {"alphaMode": "BLEND"} if rgba[3] < 1.0 else {}
            self._root["materials"].append(
                {"pbrMetallicRoughness": pbr, "doubleSided": True, **clear}
            )
        return self._materials[colour]

    def _floats(self, rows: Floats, *, bounds: bool = False) -> int:
        rows = np.ascontiguousarray(rows, np.float32)
        accessor = {
            "bufferView": self._bytes(rows.tobytes()),
            "componentType": _FLOAT, "count": len(rows), "type": "VEC3",
        }  # fmt: skip
        if bounds:
            accessor |= {"min": rows.min(0).tolist(), "max": rows.max(0).tolist()}
        return self._accessor(accessor)

    def _offsets(self, at: Ints, moves: NDArray[np.floating[Any]], count: int) -> int:
        """A sparse accessor of displacements."""
        order = np.argsort(at, kind="stable")
        at, moves = at[order], moves[order]
        kept = np.append(np.diff(at) > 0, True) & (np.abs(moves).max(1, initial=0.0) > 0)
        at, moves = at[kept].astype(np.uint32), moves[kept].astype(np.float32)
        low = moves.min(0, initial=0.0).tolist()
        high = moves.max(0, initial=0.0).tolist()
        accessor: dict[str, Any] = {
            "componentType": _FLOAT, "count": count, "type": "VEC3", "min": low, "max": high,
        }  # fmt: skip
        if len(at):
            accessor["sparse"] = {
                "count": len(at),
                "indices": {"bufferView": self._bytes(at.tobytes()), "componentType": _UINT},
                "values": {"bufferView": self._bytes(moves.tobytes())},
            }
        return self._accessor(accessor)

    def _indices(self, corners: Ints) -> int:
        view = self._bytes(corners.astype(np.uint32).tobytes())
        return self._accessor(
            {"bufferView": view, "componentType": _UINT, "count": len(corners), "type": "SCALAR"}
        )

    def _accessor(self, accessor: dict[str, Any]) -> int:
        self._root["accessors"].append(accessor)
        return len(self._root["accessors"]) - 1

    def _bytes(self, data: bytes) -> int:
        self._data += b"\0" * (-len(self._data) % 4)
        self._root["bufferViews"].append(
            {"buffer": 0, "byteOffset": len(self._data), "byteLength": len(data)}
        )
        self._data += data
        return len(self._root["bufferViews"]) - 1

    def _note(self, text: str) -> None:
        if text not in self.notes:
            self.notes.append(text)


def _skins(stage: Usd.Stage) -> dict[Any, tuple[Usd.Prim, Gf.Matrix4d]]:
    """Skinned mesh → its skeleton, and the transform that its points were bound in."""
    return {
        query.GetPrim().GetPath(): (skeleton, query.GetGeomBindTransform())
        for skeleton, query in skinning_targets(stage)
        if query.HasJointInfluences()
    }


def _upright(stage: Usd.Stage) -> NDArray[np.float64]:
    """Matrix that puts +Y up, for row vectors."""
    matrix = np.eye(4)
    if UsdGeom.GetStageUpAxis(stage) == UsdGeom.Tokens.z:
        matrix[:3, :3] = [[1, 0, 0], [0, 0, -1], [0, 1, 0]]
    return matrix


def _is_seen(prim: UsdGeom.Imageable) -> bool:
    hidden = prim.ComputeVisibility() == UsdGeom.Tokens.invisible
    return not hidden and prim.ComputePurpose() in (UsdGeom.Tokens.default_, UsdGeom.Tokens.render)


def _value(surface: UsdShade.Shader, name: str) -> Any:
    """An input's value, None where a texture or nothing gives it."""
    given = surface.GetInput(name)
    if not given:
        return None
    sources = given.GetValueProducingAttributes()
    if not sources:
        return None
    kind = UsdShade.Utils.GetType(sources[0].GetName())
    return None if kind == UsdShade.AttributeType.Output else sources[0].Get()


def _fan(counts: Ints, corners: Ints, flipped: bool) -> tuple[Ints, Ints]:
    """Polygons as triangles (T, 3), and the face that each is of."""
    starts = np.cumsum(counts) - counts
    pieces = np.maximum(counts - 2, 0)
    faces = np.repeat(np.arange(len(counts)), pieces)
    number = np.arange(pieces.sum()) - np.repeat(np.cumsum(pieces) - pieces, pieces)
    first = starts[faces]
    triangles = np.stack([first, first + number + 1, first + number + 2], axis=1)
    return corners[triangles[:, ::-1] if flipped else triangles], faces


def _normals(points: Floats, triangles: Ints) -> Floats:
    """Smooth normals (V, 3), weighted by area."""
    a, b, c = (points[triangles[:, corner]].astype(np.float64) for corner in range(3))
    faces = np.cross(b - a, c - a)
    total = np.zeros((len(points), 3))
    for corner in range(3):
        np.add.at(total, triangles[:, corner], faces)
    length = np.linalg.norm(total, axis=1, keepdims=True)
    total[length[:, 0] == 0] = (0.0, 0.0, 1.0)
    return (total / np.where(length > 0, length, 1.0)).astype(np.float32)
