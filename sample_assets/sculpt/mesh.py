"""Value types of a character: meshes with materials, targets and skin, joints, animation."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]

SMALLEST_DELTA = 2e-5
"""Shorter displacements of a target (metres) are dropped."""


@dataclass(frozen=True)
class Material:
    """Surface look: base colour in linear RGB and roughness from 0 to 1."""

    name: str
    colour: tuple[float, float, float]
    roughness: float = 0.6
    double_sided: bool = False


@dataclass(frozen=True)
class Part:
    """The triangles (T, 3) of a mesh that share one material."""

    material: Material
    triangles: IntArray


@dataclass
class Mesh:
    """A skinned mesh.

    Attributes:
        name: Name of the mesh and of its node.
        points: (V, 3) positions in metres.
        parts: Triangles by material; all index the same points.
        weights: (V, J) joint weights over the joints of the character, rows add up to one.
        targets: Blendshape name -> (V, 3) displacements in metres, in order.
        landmarks: Name -> vertex indices.
    """

    name: str
    points: FloatArray
    parts: list[Part]
    weights: FloatArray
    targets: dict[str, FloatArray] = field(default_factory=dict)
    landmarks: dict[str, list[int]] = field(default_factory=dict)

    def triangles(self) -> IntArray:
        """Return the triangles (T, 3) of all parts."""
        return np.concatenate([part.triangles for part in self.parts])

    def normals(self) -> FloatArray:
        """Area-weighted unit vertex normals (V, 3)."""
        triangles = self.triangles()
        a, b, c = (self.points[triangles[:, k]] for k in range(3))
        face = np.cross(b - a, c - a)
        total = np.zeros_like(self.points)
        for k in range(3):
            np.add.at(total, triangles[:, k], face)
        length = np.linalg.norm(total, axis=1, keepdims=True)
        unit = np.where(length > 1e-14, total / np.maximum(length, 1e-14), [0.0, 0.0, 1.0])
        return np.asarray(unit)

    def deformed(self, shapes: Mapping[str, float]) -> FloatArray:
        """Points (V, 3) with targets added; shapes that the mesh lacks are ignored."""
        points = self.points.copy()
        for name, weight in shapes.items():
            if name in self.targets:
                points += weight * self.targets[name]
        return points

    def strongest_joints(self, count: int = 4) -> tuple[IntArray, FloatArray]:
        """Joint indices and weights (V, count), heaviest first, weights adding up to one."""
        order = np.argsort(-self.weights, axis=1, kind="stable")[:, :count]
        kept = np.take_along_axis(self.weights, order, axis=1)
        kept = np.where(kept < 1e-3, 0.0, kept)
        kept = np.round(kept / kept.sum(1, keepdims=True), 5)
        kept[:, 0] += 1.0 - kept.sum(1)
        order = np.where(kept > 0, order, 0)
        return np.asarray(order), np.asarray(kept)


@dataclass(frozen=True)
class Joint:
    """A joint of the skeleton: world position in metres, no rest rotation."""

    name: str
    parent: int
    position: tuple[float, float, float]


@dataclass(frozen=True)
class JointAnimation:
    """Rotations of joints over time.

    Attributes:
        name: Name of the animation.
        times: (K,) seconds.
        rotations: Joint name -> (K, 4) unit quaternions x, y, z, w.
    """

    name: str
    times: FloatArray
    rotations: dict[str, FloatArray]


@dataclass
class Character:
    """Everything that is written into a file."""

    name: str
    meshes: list[Mesh]
    joints: list[Joint]
    animations: list[JointAnimation] = field(default_factory=list)


def finish(character: Character, shift: Sequence[float]) -> Character:
    """Move a character and round its numbers, so that files do not depend on the last bit."""
    for mesh in character.meshes:
        mesh.points = np.round(mesh.points + np.asarray(shift), 6) + 0.0
        for name, delta in mesh.targets.items():
            small = np.linalg.norm(delta, axis=1) < SMALLEST_DELTA
            mesh.targets[name] = np.where(small[:, None], 0.0, np.round(delta, 6)) + 0.0
        mesh.weights = np.round(mesh.weights, 5)
    joints = []
    for joint in character.joints:
        x, y, z = (round(p + s, 6) for p, s in zip(joint.position, shift, strict=True))
        joints.append(Joint(joint.name, joint.parent, (x, y, z)))
    character.joints = joints
    return character
