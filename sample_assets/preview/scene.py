"""Reads glTF files: meshes in world space, targets, and animated weights."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import pygltflib
from numpy.typing import NDArray

from .raster import FloatArray, IntArray, vertex_normals
from .shade import Surface

_DTYPES = {5120: "i1", 5121: "u1", 5122: "i2", 5123: "u2", 5125: "u4", 5126: "f4"}
_WIDTHS = {"SCALAR": 1, "VEC2": 2, "VEC3": 3, "VEC4": 4, "MAT2": 4, "MAT3": 9, "MAT4": 16}

COVERS = ("EyeBlend", "EyeOcclusion", "LacrimalFluid")
"""Parts of the names of materials that lie over the eyes and are not drawn."""
Weights = Mapping[str, float] | Mapping[str, Mapping[str, float]]
"""Shape weights for all meshes, or mesh name -> shape weights."""


@dataclass(frozen=True)
class Primitive:
    """Triangles (T, 3) of one material: linear RGB colour and roughness."""

    triangles: IntArray
    colour: tuple[float, float, float]
    roughness: float
    double_sided: bool


@dataclass
class SceneMesh:
    """A mesh of a scene.

    Attributes:
        name: Name of the mesh, or of its node where the mesh has none.
        points: (V, 3) world positions.
        primitives: Triangles by material; all index ``points``.
        targets: Shape name -> (V, 3) displacements in world space.
        landmarks: Name -> vertex indices, from ``extras.landmarks``.
        node: Index of the node that carries the mesh.
    """

    name: str
    points: FloatArray
    primitives: list[Primitive]
    targets: dict[str, FloatArray]
    landmarks: dict[str, IntArray]
    node: int

    def deformed(self, weights: Mapping[str, float]) -> FloatArray:
        """Points (V, 3) with targets added; shapes that the mesh lacks are ignored."""
        points = self.points.copy()
        for name, weight in weights.items():
            if weight and name in self.targets:
                points += weight * self.targets[name]
        return points

    def surfaces(self, weights: Mapping[str, float]) -> list[Surface]:
        """What is to be drawn, with normals of the deformed mesh."""
        points = self.deformed(weights)
        if not self.primitives:
            return []
        normals = vertex_normals(points, np.concatenate([p.triangles for p in self.primitives]))
        return [
            Surface(points, p.triangles, normals, p.colour, p.roughness, p.double_sided)
            for p in self.primitives
        ]


@dataclass(frozen=True)
class WeightCurve:
    """Animated weights of one mesh: times (K,) and values (K, S), with glTF interpolation."""

    mesh: str
    shapes: tuple[str, ...]
    times: FloatArray
    values: FloatArray
    interpolation: str

    def at(self, time_s: float) -> FloatArray:
        """Weights (S,) at a time; clamped at both ends."""
        t, values = self.times, self.values
        cubic = self.interpolation == "CUBICSPLINE"
        points = values[:, 1] if cubic else values
        if len(t) == 1 or time_s <= t[0]:
            return np.asarray(points[0])
        if time_s >= t[-1]:
            return np.asarray(points[-1])
        k = int(np.searchsorted(t, time_s, side="right")) - 1
        span = t[k + 1] - t[k]
        u = (time_s - t[k]) / span
        if self.interpolation == "STEP":
            return np.asarray(points[k])
        if not cubic:
            return np.asarray((1 - u) * points[k] + u * points[k + 1])
        start = (2 * u**3 - 3 * u**2 + 1) * points[k] + span * (u**3 - 2 * u**2 + u) * values[k, 2]
        end = (3 * u**2 - 2 * u**3) * points[k + 1] + span * (u**3 - u**2) * values[k + 1, 0]
        return np.asarray(start + end)


@dataclass
class Scene:
    """All meshes of a file and its animated weights."""

    meshes: list[SceneMesh]
    animations: dict[str, list[WeightCurve]] = field(default_factory=dict)

    def mesh(self, name: str) -> SceneMesh:
        """The mesh of that name."""
        return next(mesh for mesh in self.meshes if mesh.name == name)

    def deform(self, weights: Weights) -> dict[str, FloatArray]:
        """Mesh name -> points (V, 3) under some shape weights."""
        return {mesh.name: mesh.deformed(weights_of(weights, mesh.name)) for mesh in self.meshes}

    def weights_at(self, animation_name: str, time_s: float) -> dict[str, dict[str, float]]:
        """Mesh name -> shape -> weight of an animation at a time in seconds."""
        return {
            curve.mesh: dict(zip(curve.shapes, curve.at(time_s).tolist(), strict=True))
            for curve in self.animations[animation_name]
        }

    def bounds(self) -> tuple[FloatArray, FloatArray]:
        """Least and greatest coordinates (3,) of all meshes at rest."""
        points = np.concatenate([mesh.points for mesh in self.meshes])
        return points.min(0), points.max(0)


def weights_of(weights: Weights, mesh: str) -> dict[str, float]:
    """The shape weights for one mesh."""
    own: dict[str, float] = {}
    for name, value in weights.items():
        if isinstance(value, Mapping):
            if name == mesh:
                own.update(value)
        else:
            own[name] = value
    return own


class _Reader:
    """Decodes accessors of a file."""

    def __init__(self, path: Path) -> None:
        loaded = pygltflib.GLTF2().load(str(path))
        if loaded is None:
            raise ValueError(f"{path} is not a glTF file")
        self.gltf: Any = loaded
        self.buffers = [self._bytes(path, buffer) for buffer in self.gltf.buffers]

    def _bytes(self, path: Path, buffer: Any) -> bytes:
        if buffer.uri is None:
            return bytes(self.gltf.binary_blob() or b"")
        if buffer.uri.startswith("data:"):
            return bytes(self.gltf.get_data_from_buffer_uri(buffer.uri))
        return bytes((path.parent / buffer.uri).read_bytes())

    def _raw(self, view: int, offset: int, code: int, width: int, count: int) -> NDArray[Any]:
        v = self.gltf.bufferViews[view]
        dtype = np.dtype("<" + _DTYPES[code])
        stride = v.byteStride or dtype.itemsize * width
        start = (v.byteOffset or 0) + offset
        data = np.ndarray(
            (count, width), dtype, self.buffers[v.buffer], start, (stride, dtype.itemsize)
        )
        return data.copy()

    def accessor(self, index: int) -> NDArray[Any]:
        """Values (N, C) of an accessor; normalised integers become floats."""
        a = self.gltf.accessors[index]
        width = _WIDTHS[a.type]
        if a.bufferView is None:
            values = np.zeros((a.count, width), "<" + _DTYPES[a.componentType])
        else:
            values = self._raw(a.bufferView, a.byteOffset or 0, a.componentType, width, a.count)
        if a.sparse is not None:
            i, v = a.sparse.indices, a.sparse.values
            at = self._raw(i.bufferView, i.byteOffset or 0, i.componentType, 1, a.sparse.count)
            new = self._raw(v.bufferView, v.byteOffset or 0, a.componentType, width, a.sparse.count)
            values[at[:, 0]] = new
        if a.normalized:
            values = np.maximum(values / np.iinfo(values.dtype).max, -1.0)
        return values


def load_scene(path: str | Path) -> Scene:
    """Read a ``.glb`` or ``.gltf`` file.

    Skins are ignored: meshes appear in their bind pose. Of several meshes with one name the
    later ones get a number.
    """
    reader = _Reader(Path(path))
    gltf = reader.gltf
    meshes: list[SceneMesh] = []
    scene = gltf.scenes[gltf.scene or 0]
    stack = [(node, np.eye(4)) for node in reversed(scene.nodes)]
    while stack:
        index, above = stack.pop()
        node = gltf.nodes[index]
        matrix = above @ _local(node)
        stack += [(child, matrix) for child in reversed(node.children or [])]
        if node.mesh is not None:
            # A skinned mesh is placed by its joints, not by its node.
            world = np.eye(4) if node.skin is not None else matrix
            meshes.append(_mesh(reader, index, world, {m.name for m in meshes}))
    return Scene(meshes, _animations(reader, meshes))


def _local(node: Any) -> FloatArray:
    """Matrix (4, 4) of a node, for column vectors."""
    if node.matrix is not None:
        return np.array(node.matrix, dtype=np.float64).reshape(4, 4).T
    x, y, z, w = node.rotation or (0.0, 0.0, 0.0, 1.0)
    matrix = np.eye(4)
    matrix[:3, :3] = [
        [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
        [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
        [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
    ]
    matrix[:3, :3] *= np.asarray(node.scale or (1.0, 1.0, 1.0))
    matrix[:3, 3] = node.translation or (0.0, 0.0, 0.0)
    return matrix


def _mesh(reader: _Reader, index: int, world: FloatArray, taken: set[str]) -> SceneMesh:
    """Read the mesh of a node; primitives that share positions share vertices."""
    node = reader.gltf.nodes[index]
    mesh = reader.gltf.meshes[node.mesh]
    name = mesh.name or node.name or f"mesh{node.mesh}"
    while name in taken:
        name += "_1"
    extras = mesh.extras or {}
    count = len(mesh.primitives[0].targets or [])
    names = list(extras.get("targetNames") or [f"target{k}" for k in range(count)])
    blocks: dict[int, int] = {}
    points: list[FloatArray] = []
    deltas: list[list[FloatArray]] = [[] for _ in names]
    primitives = []
    for primitive in mesh.primitives:
        at = primitive.attributes.POSITION
        if at not in blocks:
            blocks[at] = sum(map(len, points))
            points.append(reader.accessor(at).astype(np.float64) @ world[:3, :3].T + world[:3, 3])
            for k, target in enumerate((primitive.targets or [])[: len(names)]):
                deltas[k].append(_delta(reader, target, world, len(points[-1])))
        if primitive.mode in (None, 4) and not _is_cover(reader, primitive):
            primitives.append(_primitive(reader, primitive, blocks[at], len(points[-1])))
    targets = {n: np.concatenate(d) for n, d in zip(names, deltas, strict=True) if d}
    landmarks = {
        key: np.atleast_1d(np.asarray(value, dtype=np.int64))
        for key, value in (extras.get("landmarks") or {}).items()
    }
    return SceneMesh(name, np.concatenate(points), primitives, targets, landmarks, index)


def _is_cover(reader: _Reader, primitive: Any) -> bool:
    """Whether a primitive is a see-through cover, most of which are exported as opaque."""
    if primitive.material is None:
        return False
    name = reader.gltf.materials[primitive.material].name or ""
    return any(part in name for part in COVERS)


def _delta(reader: _Reader, target: Any, world: FloatArray, count: int) -> FloatArray:
    """Displacements (V, 3) of one target."""
    at = target.get("POSITION") if isinstance(target, dict) else target.POSITION
    if at is None:
        return np.zeros((count, 3))
    return np.asarray(reader.accessor(at).astype(np.float64) @ world[:3, :3].T)


def _primitive(reader: _Reader, primitive: Any, start: int, count: int) -> Primitive:
    """Triangles and material of a primitive whose vertices begin at ``start``."""
    if primitive.indices is None:
        indices = np.arange(count)
    else:
        indices = reader.accessor(primitive.indices)[:, 0].astype(np.int64)
    colour, rough, double = (0.8, 0.8, 0.8), 0.6, False
    if primitive.material is not None:
        material = reader.gltf.materials[primitive.material]
        pbr = material.pbrMetallicRoughness
        double = bool(material.doubleSided)
        if pbr is not None:
            r, g, b = (pbr.baseColorFactor or (1.0, 1.0, 1.0, 1.0))[:3]
            colour = (float(r), float(g), float(b))
            rough = 1.0 if pbr.roughnessFactor is None else float(pbr.roughnessFactor)
    return Primitive(indices.reshape(-1, 3) + start, colour, rough, double)


def _animations(reader: _Reader, meshes: list[SceneMesh]) -> dict[str, list[WeightCurve]]:
    """The weight channels of all animations."""
    by_node = {mesh.node: mesh for mesh in meshes}
    found: dict[str, list[WeightCurve]] = {}
    for number, animation in enumerate(reader.gltf.animations or []):
        curves = found.setdefault(animation.name or f"animation{number}", [])
        for channel in animation.channels:
            mesh = by_node.get(channel.target.node)
            if channel.target.path != "weights" or mesh is None:
                continue
            sampler = animation.samplers[channel.sampler]
            times = reader.accessor(sampler.input)[:, 0].astype(np.float64)
            values = reader.accessor(sampler.output).astype(np.float64).ravel()
            kind = sampler.interpolation or "LINEAR"
            shape = (len(times), 3, -1) if kind == "CUBICSPLINE" else (len(times), -1)
            curves.append(
                WeightCurve(mesh.name, tuple(mesh.targets), times, values.reshape(shape), kind)
            )
    return found
