"""Writes a character as binary glTF 2.0."""

from __future__ import annotations

import json
import struct
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .mesh import Character, FloatArray, Mesh

Json = dict[str, Any]

FLOAT, U8, U16 = 5126, 5121, 5123
ARRAY_BUFFER, ELEMENT_BUFFER = 34962, 34963
_TYPES = {1: "SCALAR", 2: "VEC2", 3: "VEC3", 4: "VEC4", 16: "MAT4"}
_CODES: dict[int, str] = {FLOAT: "<f4", U8: "<u1", U16: "<u2"}
COPYRIGHT = "animeme contributors, MIT"
GENERATOR = "animeme sample_assets/build.py"


class _Buffer:
    """Collects the binary chunk, its views and its accessors."""

    def __init__(self) -> None:
        self.data = bytearray()
        self.views: list[Json] = []
        self.accessors: list[Json] = []

    def view(self, values: NDArray[Any], code: int, target: int | None) -> int:
        """Append values as a new buffer view, aligned to four bytes."""
        raw = np.ascontiguousarray(values.astype(_CODES[code])).tobytes()
        view: Json = {"buffer": 0, "byteOffset": len(self.data), "byteLength": len(raw)}
        if target is not None:
            view["target"] = target
        self.data += raw + b"\0" * (-len(raw) % 4)
        self.views.append(view)
        return len(self.views) - 1

    def accessor(
        self, values: NDArray[Any], code: int, target: int | None = None, bounds: bool = False
    ) -> int:
        """Append values (N,) or (N, C) and return the index of their accessor."""
        width = 1 if values.ndim == 1 else values.shape[1]
        accessor: Json = {
            "bufferView": self.view(values, code, target),
            "componentType": code,
            "count": len(values),
            "type": _TYPES[width],
        }
        if bounds:
            accessor.update(_bounds(values.reshape(len(values), -1)))
        self.accessors.append(accessor)
        return len(self.accessors) - 1

    def sparse(self, values: FloatArray) -> int:
        """Append displacements (N, 3), storing only those that are not zero."""
        moved = np.flatnonzero(np.abs(values).max(1) > 0)
        accessor: Json = {"componentType": FLOAT, "count": len(values), "type": "VEC3"}
        accessor.update(_bounds(values))
        if len(moved):
            accessor["sparse"] = {
                "count": len(moved),
                "indices": {"bufferView": self.view(moved, U16, None), "componentType": U16},
                "values": {"bufferView": self.view(values[moved], FLOAT, None)},
            }
        self.accessors.append(accessor)
        return len(self.accessors) - 1


def _bounds(values: NDArray[Any]) -> Json:
    """Bounds of (N, C) values as they are after rounding to single precision."""
    single = values.astype(np.float32)
    return {"min": single.min(0).tolist(), "max": single.max(0).tolist()}


def _mesh(buffer: _Buffer, mesh: Mesh, materials: list[str]) -> Json:
    """A mesh whose primitives share their vertices and differ in indices and material."""
    joints, weights = mesh.strongest_joints()
    attributes = {
        "POSITION": buffer.accessor(mesh.points, FLOAT, ARRAY_BUFFER, bounds=True),
        "NORMAL": buffer.accessor(_unit(np.round(mesh.normals(), 4)), FLOAT, ARRAY_BUFFER),
        "JOINTS_0": buffer.accessor(joints, U8, ARRAY_BUFFER),
        "WEIGHTS_0": buffer.accessor(_exact_sum(weights), FLOAT, ARRAY_BUFFER),
    }
    morphs = [{"POSITION": buffer.sparse(delta)} for delta in mesh.targets.values()]
    primitives = []
    for part in mesh.parts:
        indices = buffer.accessor(part.triangles.ravel(), U16, ELEMENT_BUFFER)
        primitive: Json = {
            "attributes": attributes,
            "indices": indices,
            "material": materials.index(part.material.name),
        }
        if morphs:
            primitive["targets"] = morphs
        primitives.append(primitive)
    result: Json = {"name": mesh.name, "primitives": primitives}
    extras: Json = {}
    if morphs:
        result["weights"] = [0.0] * len(morphs)
        extras["targetNames"] = list(mesh.targets)
    if mesh.landmarks:
        extras["landmarks"] = mesh.landmarks
    if extras:
        result["extras"] = extras
    return result


def _unit(vectors: FloatArray) -> FloatArray:
    """Rounded normals brought back to length one."""
    return np.asarray(vectors / np.linalg.norm(vectors, axis=1, keepdims=True))


def _exact_sum(weights: FloatArray) -> FloatArray:
    """Weights whose sum is one in single precision too."""
    single = weights.astype(np.float32)
    single[:, 0] = np.float32(1.0) - single[:, 1:].sum(1, dtype=np.float32)
    return single.astype(np.float64)


def _materials(character: Character) -> list[Json]:
    """All materials, each once, in order of first use."""
    found: dict[str, Json] = {}
    for mesh in character.meshes:
        for part in mesh.parts:
            m = part.material
            entry: Json = {
                "name": m.name,
                "pbrMetallicRoughness": {
                    "baseColorFactor": [*m.colour, 1.0],
                    "metallicFactor": 0.0,
                    "roughnessFactor": m.roughness,
                },
            }
            if m.double_sided:
                entry["doubleSided"] = True
            found.setdefault(m.name, entry)
    return list(found.values())


def _joint_nodes(character: Character, first: int) -> list[Json]:
    """Nodes of the joints; the first one gets the index ``first``."""
    nodes: list[Json] = []
    for i, joint in enumerate(character.joints):
        origin = character.joints[joint.parent].position if joint.parent >= 0 else (0.0, 0.0, 0.0)
        local = [round(a - b, 6) + 0.0 for a, b in zip(joint.position, origin, strict=True)]
        node: Json = {"name": joint.name, "translation": local}
        children = [first + k for k, other in enumerate(character.joints) if other.parent == i]
        if children:
            node["children"] = children
        nodes.append(node)
    return nodes


def _animations(buffer: _Buffer, character: Character, first: int) -> list[Json]:
    """Rotation channels of the joint animations."""
    names = [joint.name for joint in character.joints]
    result: list[Json] = []
    for animation in character.animations:
        times = buffer.accessor(animation.times, FLOAT, bounds=True)
        samplers: list[Json] = []
        channels: list[Json] = []
        for name, rotations in animation.rotations.items():
            output = buffer.accessor(rotations, FLOAT)
            channels.append(
                {
                    "sampler": len(samplers),
                    "target": {"node": first + names.index(name), "path": "rotation"},
                }
            )
            samplers.append({"input": times, "interpolation": "LINEAR", "output": output})
        result.append({"name": animation.name, "channels": channels, "samplers": samplers})
    return result


def write_glb(character: Character, path: Path) -> None:
    """Write a character into a ``.glb`` file."""
    buffer = _Buffer()
    materials = _materials(character)
    names = [m["name"] for m in materials]
    meshes = [_mesh(buffer, mesh, names) for mesh in character.meshes]
    first = len(meshes)
    joints = _joint_nodes(character, first)
    inverse = np.tile(np.eye(4), (len(joints), 1, 1))
    inverse[:, 3, :3] = -np.array([joint.position for joint in character.joints])
    matrices = buffer.accessor(inverse.reshape(-1, 16) + 0.0, FLOAT)
    roots = [first + i for i, joint in enumerate(character.joints) if joint.parent < 0]
    # Skinned meshes belong at the root of the scene: transforms above them have no effect.
    nodes: list[Json] = [{"name": m["name"], "mesh": i, "skin": 0} for i, m in enumerate(meshes)]
    document: Json = {
        "asset": {"version": "2.0", "generator": GENERATOR, "copyright": COPYRIGHT},
        "scene": 0,
        "scenes": [{"name": character.name, "nodes": [*range(first), *roots]}],
        "nodes": nodes + joints,
        "meshes": meshes,
        "materials": materials,
        "skins": [
            {
                "name": character.name,
                "inverseBindMatrices": matrices,
                "joints": list(range(first, first + len(joints))),
                "skeleton": roots[0],
            }
        ],
    }
    animations = _animations(buffer, character, first)
    if animations:
        document["animations"] = animations
    document["accessors"] = buffer.accessors
    document["bufferViews"] = buffer.views
    document["buffers"] = [{"byteLength": len(buffer.data)}]
    _write_chunks(document, bytes(buffer.data), path)


def _write_chunks(document: Json, binary: bytes, path: Path) -> None:
    """Write the header, the JSON chunk and the binary chunk."""
    text = json.dumps(document, separators=(",", ":")).encode()
    text += b" " * (-len(text) % 4)
    header = struct.pack("<4sII", b"glTF", 2, 28 + len(text) + len(binary))
    chunks = struct.pack("<I4s", len(text), b"JSON") + text
    chunks += struct.pack("<I4s", len(binary), b"BIN\0") + binary
    path.write_bytes(header + chunks)
