"""Meshes of glTF: primitives, morph targets, skins at rest and base colours."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from animeme.errors import InputError
from animeme.rig import Character
from animeme_stages.ingest.glb import open_container, unreadable
from animeme_stages.ingest.gltf_data import Buffers
from animeme_stages.pictures import textures
from animeme_stages.pictures.raster import Floats, Indices, Singles
from animeme_stages.pictures.scene import (
    Material,
    Primitive,
    SceneMesh,
    Target,
    is_cover,
    require_finite,
    skinned,
    welded,
)

_BROKEN = (
    AttributeError, IndexError, KeyError, MemoryError, OverflowError, TypeError, ValueError,
)  # fmt: skip
_COMPRESSED = ("KHR_draco_mesh_compression", "EXT_meshopt_compression", "KHR_meshopt_compression")
_TRIANGLES, _STRIP, _FAN = 4, 5, 6
# Below this, what is blended without a texture is glass.
_GLASS = 0.5


def read_meshes(character: Character) -> Iterator[SceneMesh]:
    """Every mesh in the file's scene.

    Raises:
        InputError: ``picture-compressed``; ``asset-unreadable``: a mesh is broken.
    """
    container = open_container(character.source)
    try:
        yield from _Reader(character, Buffers(container)).meshes()
    except _BROKEN as error:
        raise unreadable(
            character.source, f"has a mesh that cannot be followed ({error!r:.120})"
        ) from error


class _Reader:
    """One file and what was read of it.

    Args:
        character: whose it is.
        buffers: its data.
    """

    def __init__(self, character: Character, buffers: Buffers) -> None:
        self.character, self.buffers = character, buffers
        self.root = buffers.container.json
        self._materials: dict[int | None, Material | None] = {}
        self._worlds = _worlds(self.root)

    def meshes(self) -> Iterator[SceneMesh]:
        """Every mesh that a node of the scene shows."""
        for index in self._worlds:
            node = self.root["nodes"][index]
            if "mesh" in node:
                mesh = self._mesh(index, node, self.root["meshes"][node["mesh"]])
                if mesh is not None:
                    yield mesh

    def _mesh(
        self, index: int, node: Mapping[str, Any], mesh: Mapping[str, Any]
    ) -> SceneMesh | None:
        """The mesh of a node; primitives with the same attributes share vertices."""
        own = next((m for m in self.character.meshes if m.path == f"/nodes/{index}"), None)
        names = [self.character.canonical[shape] for shape in own.shapes] if own else []
        blocks: dict[tuple[Any, ...], tuple[int, _Block]] = {}
        primitives, start = [], 0
        for primitive in mesh["primitives"]:
            if primitive.get("mode", _TRIANGLES) not in (_TRIANGLES, _STRIP, _FAN):
                continue
            self._refuse_compressed(primitive)
            key = tuple(sorted(primitive["attributes"].items()))
            if key not in blocks:
                blocks[key] = start, self._block(primitive, index, len(names))
                start += len(blocks[key][1].points)
            first, block = blocks[key]
            material = self._material(primitive.get("material"))
            if material is not None:
                triangles = self._triangles(primitive, len(block.points)) + first
                primitives.append(Primitive(triangles, material))
        if not blocks:
            return None
        parts = [block for _, block in blocks.values()]
        offsets = np.concatenate([part.offsets for part in parts], axis=1)
        points = np.concatenate([part.points for part in parts])
        extras = mesh.get("extras")
        marks = extras.get("landmarks") if isinstance(extras, dict) else None
        return SceneMesh(
            str(mesh.get("name") or node.get("name") or f"mesh {node['mesh']}"),
            points,
            primitives,
            {name: Target((1.0,), offsets[k : k + 1]) for k, name in enumerate(names)},
            dict(zip(names, own.rest, strict=True)) if own else {},
            welded(points, _joined([part.normals for part in parts], parts, 0.0)),
            _joined([part.uv for part in parts], parts, 0.0),
            _joined([part.tint for part in parts], parts, 1.0),
            {name: np.atleast_1d(np.asarray(at, np.int64)) for name, at in (marks or {}).items()},
        )

    def _block(self, primitive: Mapping[str, Any], index: int, count: int) -> _Block:
        """Vertices of a primitive, placed in the world, with `count` targets."""
        values, attributes = self.buffers.values, primitive["attributes"]
        local = values(attributes["POSITION"]).astype(np.float64)
        if local.shape[1] != 3:
            raise ValueError("positions that are no points")
        moved = np.zeros((count, *local.shape))
        for k, target in enumerate(primitive.get("targets", [])[:count]):
            if "POSITION" in target:
                moved[k] = values(target["POSITION"])
        points, offsets = self._placed(local, moved, index, attributes)
        require_finite(points, offsets)

        def optional(name: str, width: int) -> Singles | None:
            if name not in attributes:
                return None
            found = values(attributes[name]).astype(np.float32)[:, :width]
            return found if found.shape == (len(local), width) else None

        chosen = self.root["materials"][primitive["material"]] if "material" in primitive else {}
        uv = optional(f"TEXCOORD_{textures.channel_of(chosen)}", 2)
        return _Block(points, offsets, optional("NORMAL", 3), uv, optional("COLOR_0", 3))

    def _placed(
        self, local: Floats, moved: Floats, index: int, attributes: Mapping[str, int]
    ) -> tuple[Floats, Floats]:
        """Points and displacements in world space."""
        skin = self.root["nodes"][index].get("skin")
        if skin is None or "JOINTS_0" not in attributes:
            # A skinned mesh is placed by its joints, not by its node.
            world = self._worlds[index] if skin is None else np.eye(4)
            turn = world[:3, :3].T
            return local @ turn + world[:3, 3], moved @ turn
        values = self.buffers.values
        sets = [k for k in range(4) if f"JOINTS_{k}" in attributes]
        joints = np.concatenate([values(attributes[f"JOINTS_{k}"]) for k in sets], axis=1)
        shares = np.concatenate([values(attributes[f"WEIGHTS_{k}"]) for k in sets], axis=1)
        described = self.root["skins"][skin]
        poses = np.stack([self._worlds.get(j, np.eye(4)) for j in described["joints"]])
        if "inverseBindMatrices" in described:
            stored = values(described["inverseBindMatrices"]).astype(np.float64)
            poses = poses @ stored.reshape(-1, 4, 4).transpose(0, 2, 1)
        points, (offsets,) = skinned(
            local, [moved], joints.astype(np.int64), shares.astype(np.float64), poses
        )
        return points, offsets

    def _triangles(self, primitive: Mapping[str, Any], count: int) -> Indices:
        """Vertex indices (T, 3) of a primitive of `count` vertices."""
        if "indices" in primitive:
            indices = self.buffers.values(primitive["indices"])[:, 0].astype(np.int64)
        else:
            indices = np.arange(count)
        if len(indices) and not 0 <= indices.min() <= indices.max() < count:
            raise IndexError("triangles of vertices that are not there")
        mode = primitive.get("mode", _TRIANGLES)
        if mode == _TRIANGLES:
            return np.asarray(indices[: len(indices) // 3 * 3].reshape(-1, 3))
        steps = np.arange(max(len(indices) - 2, 0))
        if mode == _FAN:
            return np.stack([indices[steps + 1], indices[steps + 2], indices[steps * 0]], axis=1)
        odd = steps % 2
        return np.stack(
            [indices[steps], indices[steps + 1 + odd], indices[steps + 2 - odd]], axis=1
        )

    def _material(self, index: int | None) -> Material | None:
        """A material, None if what has it is not drawn."""
        if index not in self._materials:
            described = {} if index is None else self.root["materials"][index]
            self._materials[index] = self._read_material(described)
        return self._materials[index]

    def _read_material(self, described: Mapping[str, Any]) -> Material | None:
        if not described:
            return Material()
        plain = described.get("pbrMetallicRoughness", {})
        factor = [float(part) for part in plain.get("baseColorFactor", (1.0, 1.0, 1.0, 1.0))]
        mode = described.get("alphaMode", "OPAQUE")
        image = plain.get("baseColorTexture")
        if is_cover(str(described.get("name", ""))) or (
            mode == "BLEND" and image is None and factor[3] < _GLASS
        ):
            return None
        texture = None if image is None else textures.of_gltf(self.buffers, image["index"])
        if image is not None and texture is None and factor[:3] == [1.0, 1.0, 1.0]:
            return Material(double_sided=bool(described.get("doubleSided")))
        # What is blended is drawn where it covers more than half.
        cutoff = None if mode == "OPAQUE" else float(described.get("alphaCutoff", 0.5))
        return Material(
            (factor[0], factor[1], factor[2]),
            float(plain.get("roughnessFactor", 1.0)),
            bool(described.get("doubleSided", False)),
            texture,
            cutoff if texture is not None else None,
        )

    def _refuse_compressed(self, primitive: Mapping[str, Any]) -> None:
        """Make sure that a primitive's data can be read.

        Raises:
            InputError: ``picture-compressed``.
        """
        used = set(primitive.get("extensions", {}))
        accessors = [*primitive["attributes"].values(), primitive.get("indices")]
        for index in accessors:
            view = None if index is None else self.root["accessors"][index].get("bufferView")
            if view is not None:
                used |= set(self.root["bufferViews"][view].get("extensions", {}))
        for name in _COMPRESSED:
            if name in used:
                raise InputError(
                    "picture-compressed",
                    f"has meshes compressed with {name}, which cannot be drawn",
                    place=str(self.character.source),
                    action="Draw an uncompressed copy: gltf-transform copy decompresses it.",
                )


@dataclass(frozen=True, eq=False)
class _Block:
    """Vertices: points (V, 3), offsets (S, V, 3), and what else is known about each of them."""

    points: Floats
    offsets: Floats
    normals: Singles | None
    uv: Singles | None
    tint: Singles | None


def _joined(
    columns: Sequence[Singles | None], parts: Sequence[_Block], missing: float
) -> Singles | None:
    """Values of all blocks, `missing` where one has none; None if no block has any."""
    known = [column for column in columns if column is not None]
    if not known:
        return None
    width = known[0].shape[1]
    filled = [
        np.full((len(part.points), width), missing, np.float32) if column is None else column
        for column, part in zip(columns, parts, strict=True)
    ]
    return np.concatenate(filled)


def _worlds(root: Mapping[str, Any]) -> dict[int, Floats]:
    """Node → matrix (4, 4) from its space to the world's, of all nodes in the scene."""
    nodes = root.get("nodes", [])
    below = {child for node in nodes for child in node.get("children", [])}
    scenes = root.get("scenes")
    roots = (
        scenes[root.get("scene", 0)].get("nodes", [])
        if scenes
        else [index for index in range(len(nodes)) if index not in below]
    )
    found: dict[int, Floats] = {}
    stack = [(index, np.eye(4)) for index in reversed(roots)]
    while stack:
        index, above = stack.pop()
        if index in found:  # a node of two parents is against the standard, a circle too
            continue
        found[index] = above @ _local(nodes[index])
        stack += [(child, found[index]) for child in reversed(nodes[index].get("children", []))]
    return found


def _local(node: Mapping[str, Any]) -> Floats:
    """Matrix (4, 4) of a node, for column vectors."""
    if "matrix" in node:
        return np.array(node["matrix"], dtype=np.float64).reshape(4, 4).T
    x, y, z, w = (float(part) for part in node.get("rotation", (0.0, 0.0, 0.0, 1.0)))
    matrix = np.eye(4)
    matrix[:3, :3] = [
        [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
        [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
        [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
    ]
    matrix[:3, :3] *= np.array(node.get("scale", (1.0, 1.0, 1.0)), dtype=np.float64)
    matrix[:3, 3] = node.get("translation", (0.0, 0.0, 0.0))
    return matrix
