"""What a mouth does, measured on the deformed mesh and not on curves.

Lengths are in units of the distance between the eyes' centres, and relative to the face at rest, as
in the captured data of the design.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from animeme_stages.pictures.scene import Scene, SceneMesh
from support.animated import Animated

Indices = NDArray[np.int64]
Floats = NDArray[np.float64]
Weights = Mapping[str, float]

# iBUG's 68 points: inner lip, upper and lower, paired left to right; eyes.
_UPPER_INNER = (61, 62, 63)
_LOWER_INNER = (67, 66, 65)
_EYES = (range(36, 42), range(42, 48))
# The ICT readme's table: upper central incisors.
_INCISORS = range(18067, 18219)


@dataclass(frozen=True)
class MouthPoints:
    """Where to measure.

    Attributes:
        scene: the character.
        face, teeth: names of its meshes.
        upper, lower: paired vertices of the inner lips.
        incisors: vertices of the upper incisors' edge.
        eye_distance: between the eyes' centres, scene units.
        animated: its file's animations.
    """

    scene: Scene
    face: str
    teeth: str
    upper: Indices
    lower: Indices
    incisors: Indices
    eye_distance: float
    animated: Animated

    def measured_only(self) -> MouthPoints:
        """The same with only the meshes that are measured, which is quicker."""
        meshes = tuple(m for m in self.scene.meshes if m.name in (self.face, self.teeth))
        return replace(self, scene=replace(self.scene, meshes=meshes))

    def weights_at(self, line: str, time_s: float) -> Weights:
        """What the file's animation says at a time."""
        return self.animated.weights_at(line, time_s)

    def lip_gap(self, weights: Weights) -> float:
        """Mean vertical distance of the inner lips, less that at rest."""
        return (self._gap(weights) - self._gap({})) / self.eye_distance

    def lip_to_teeth(self, weights: Weights) -> float:
        """Distance between the lower lip's rim and the upper incisors' edge, absolute."""
        points = self.scene.deform(weights)
        tree = cKDTree(points[self.teeth][self.incisors])
        nearest, _ = tree.query(points[self.face][self.lower])
        return float(np.min(nearest)) / self.eye_distance

    def _gap(self, weights: Weights) -> float:
        points = self.scene.deform(weights)[self.face]
        return float(np.mean(points[self.upper, 1] - points[self.lower, 1]))


def ada_mouth(scene: Scene) -> MouthPoints:
    """The sample head's points, from the landmarks in its file."""
    face, teeth, eyes = scene.mesh("Face"), scene.mesh("Teeth"), scene.mesh("Eyes")
    middle = slice(3, -3)  # the inner pairs; the outer ones meet at the corners
    left = eyes.points[:, 0] > 0
    distance = eyes.points[left].mean(axis=0) - eyes.points[~left].mean(axis=0)
    return MouthPoints(
        scene,
        "Face",
        "Teeth",
        np.asarray(face.landmarks["lipUpperInner"])[middle],
        np.asarray(face.landmarks["lipLowerInner"])[middle],
        np.asarray(teeth.landmarks["teethUpperEdge"]),
        float(np.linalg.norm(distance)),
        Animated(scene.character.source),
    )


def ict_mouth(scene: Scene, folder: Path) -> MouthPoints:
    """The ICT head's points, from its published landmark vertices."""
    lines = (folder / "generic_neutral_mesh.obj").read_text(encoding="utf-8").splitlines()
    obj = np.array([line.split()[1:4] for line in lines if line.startswith("v ")], np.float64)
    published = json.loads((folder / "vertex_indices.json").read_text(encoding="utf-8"))
    marks = obj[published["idx_to_landmark_verts"]]
    face, teeth = scene.mesh("M_Face"), scene.mesh("M_Teeth")
    eyes = [marks[list(eye)].mean(axis=0) for eye in _EYES]
    incisors = obj[list(_INCISORS)]
    edge = incisors[incisors[:, 1] < incisors[:, 1].min() + 0.1]
    return MouthPoints(
        scene,
        "M_Face",
        "M_Teeth",
        _nearest(face, marks[list(_UPPER_INNER)]),
        _nearest(face, marks[list(_LOWER_INNER)]),
        _nearest(teeth, edge),
        float(np.linalg.norm(eyes[0] - eyes[1])),
        Animated(scene.character.source),
    )


def _nearest(mesh: SceneMesh, points: Floats) -> Indices:
    _, found = cKDTree(mesh.points).query(points)
    return np.asarray(found)
