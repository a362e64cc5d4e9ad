"""How Ada's face follows her mandible, and the motion of the mandible itself."""

from __future__ import annotations

import numpy as np

from . import ada_form as form
from .ada_head import Head
from .lip_poses import Lips
from .mesh import FloatArray, IntArray
from .mouth import INNER, SKIN_RINGS
from .smooth import extend, step


def lips_of(head: Head) -> Lips:
    """The lip rings of the face."""
    return Lips(head.points[head.mouth[SKIN_RINGS : INNER + 1]], 1.0)


def still(head: Head) -> IntArray:
    """Vertices that no pose of the mouth moves: upper face, back of the head, neck."""
    p = head.points
    far = (p[:, 1] > -0.026) | (p[:, 2] < 0.004) | (p[:, 1] < -0.134)
    nose = (np.abs(p[:, 0]) < 0.013) & (p[:, 1] > -0.0405) & (p[:, 2] > 0.070)
    mask = far | nose
    mask[head.mouth[SKIN_RINGS:].ravel()] = False
    return np.flatnonzero(mask)


def jaw_follow(head: Head) -> FloatArray:
    """How much each vertex (V,) goes with the mandible, from 0 to 1."""
    lips = lips_of(head)
    p = head.points
    on_lips = 0.5 - 0.5 * lips.side * lips.opening
    rings = head.mouth[SKIN_RINGS : INNER + 1]
    chin = (p[:, 1] < -0.0905) & (p[:, 1] > -0.116) & (p[:, 2] > 0.040)
    chin &= np.abs(p[:, 0]) < 0.030
    chin[head.mouth[SKIN_RINGS:].ravel()] = False
    lining = head.mouth[INNER + 1 :]
    n = lining.shape[1]
    around = 0.5 - 0.5 * np.sin(2 * np.pi * np.arange(n) / n)
    quiet = still(head)
    known = np.concatenate(
        [rings.ravel(), np.flatnonzero(chin), lining.ravel(), np.array([head.throat]), quiet]
    )
    values = np.concatenate(
        [
            np.tile(on_lips, len(rings)),
            np.ones(int(chin.sum())),
            np.tile(around, len(lining)),
            [0.5],
            np.zeros(len(quiet)),
        ]
    )
    follow = extend(head.shell.all_triangles(), known, values[:, None], len(p))[:, 0]
    return np.asarray(np.clip(follow, 0.0, 1.0))


def turn(p: FloatArray) -> FloatArray:
    """Displacements (N, 3) of points that turn rigidly with the opening mandible."""
    angle = form.JAW_ANGLE
    q = p - form.JAW_AXIS
    cos, sin = np.cos(angle), np.sin(angle)
    moved = q.copy()
    moved[:, 1] = cos * q[:, 1] - sin * q[:, 2]
    moved[:, 2] = sin * q[:, 1] + cos * q[:, 2]
    return np.asarray(moved - q)


def jaw_targets(p: FloatArray, follow: FloatArray) -> dict[str, FloatArray]:
    """The four poses of the mandible for points (N, 3) that follow it (N,)."""
    w = follow[:, None]
    return {
        "jawForward": w * [0.0, 0.0005, 0.0085],
        "jawLeft": w * [0.0095, 0.0, 0.0] * np.ones((len(p), 1)),
        "jawRight": w * [-0.0095, 0.0, 0.0] * np.ones((len(p), 1)),
        "jawOpen": w * turn(p),
    }


def joint_weights(p: FloatArray, follow: FloatArray) -> FloatArray:
    """Weights (N, 4) of the joints root, neck, head and jaw."""
    trunk = step(-0.165, -0.225, p[:, 1])
    front = np.clip(p[:, 2] / 0.06, 0.0, 1.0)
    head = step(-0.150, -0.060, p[:, 1] + 0.035 * front)
    neck = 1.0 - head
    jaw = follow
    weights = np.stack(
        [trunk * (1 - jaw), neck * (1 - trunk) * (1 - jaw), head * (1 - trunk) * (1 - jaw), jaw],
        axis=1,
    )
    return np.asarray(weights / weights.sum(1, keepdims=True))
