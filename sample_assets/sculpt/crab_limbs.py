"""The crab's legs, claws and eyestalks."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from .crab_body import STALK
from .loft import ball, outward, tube
from .mesh import FloatArray, IntArray, Material, Mesh, Part

SHELL = Material("Shell", (0.78, 0.135, 0.060), 0.40)
TIP = Material("Tip", (0.30, 0.045, 0.040), 0.45)
WHITE = Material("Sclera", (0.82, 0.81, 0.78), 0.22)
PUPIL = Material("Pupil", (0.010, 0.008, 0.012), 0.12)
Rigid = Callable[[int, int], FloatArray]


def _spline(keys: list[tuple[float, float, float]], count: int) -> FloatArray:
    """Smooth path (count, 3) through points (Catmull-Rom)."""
    p = np.array(keys)
    p = np.concatenate([[2 * p[0] - p[1]], p, [2 * p[-1] - p[-2]]])
    t = np.linspace(0, len(keys) - 1 - 1e-9, count)
    i = t.astype(np.int64)
    u = (t - i)[:, None]
    a, b, c, d = p[i], p[i + 1], p[i + 2], p[i + 3]
    return np.asarray(
        b + 0.5 * u * (c - a + u * (2 * a - 5 * b + 4 * c - d + u * (3 * (b - c) + d - a)))
    )


def _mirrored(points: FloatArray, triangles: IntArray) -> tuple[FloatArray, IntArray]:
    """Points and triangles with their mirror images added."""
    both = np.concatenate([points, points * [-1.0, 1.0, 1.0]])
    return both, np.concatenate([triangles, triangles[:, ::-1] + len(points)])


def _leg(z: float, spread: float) -> tuple[FloatArray, IntArray]:
    """One left leg, from the shell over the knee to the ground."""
    keys = [(0.085, 0.070, z * 0.7), (0.125, 0.082, z), (0.160, 0.075, z + spread),
            (0.178, 0.035, z + 1.5 * spread), (0.180, 0.002, z + 1.7 * spread)]  # fmt: skip
    path = _spline(keys, 9)
    t = np.linspace(0, 1, 9)
    radius = 0.0110 * (1 - 0.78 * t**1.6) * (1 + 0.16 * np.cos(4 * np.pi * t))
    points, triangles = tube(path, np.stack([radius, radius], axis=1), 6, np.array([0, 0.3, 1.0]))
    return points, outward(points - points.mean(0), triangles)


def _finger(keys: list[tuple[float, float, float]], thick: float) -> tuple[FloatArray, IntArray]:
    """A finger of the left claw, thick at its root and pointed."""
    path = _spline(keys, 9)
    t = np.linspace(0, 1, 9)
    radius = thick * np.clip(np.sin(np.pi * (0.16 + 0.83 * t**0.85)), 0.03, 1)
    radii = np.stack([radius * 0.62, radius], axis=1)
    points, triangles = tube(path, radii, 8, np.array([0.5, 0.0, -1.0]))
    return points, outward(points - points.mean(0), triangles)


def limbs(rigid: Rigid) -> Mesh:
    """Six legs and two claws."""
    pieces = [_leg(z, s) for z, s in ((0.030, 0.010), (-0.010, -0.004), (-0.048, -0.020))]
    arm_path = _spline([(0.088, 0.078, 0.035), (0.128, 0.070, 0.058), (0.148, 0.088, 0.078)], 8)
    radius = 0.0125 + 0.0030 * np.cos(np.linspace(0, 3 * np.pi, 8))
    arm, triangles = tube(arm_path, np.stack([radius, radius], axis=1), 8, np.array([0, 1.0, 0]))
    claw = [(arm, outward(arm - arm.mean(0), triangles))]
    claw.append(_finger([(0.140, 0.078, 0.074), (0.168, 0.122, 0.088), (0.150, 0.168, 0.096),
                         (0.116, 0.184, 0.100)], 0.0270))  # fmt: skip
    claw.append(_finger([(0.138, 0.090, 0.080), (0.122, 0.124, 0.090), (0.112, 0.146, 0.097),
                         (0.106, 0.168, 0.101)], 0.0165))  # fmt: skip
    points: list[FloatArray] = []
    faces: list[IntArray] = []
    weights: list[FloatArray] = []
    start = 0
    for k, piece in enumerate(pieces + claw):
        both, triangles = _mirrored(*piece)
        points.append(both)
        faces.append(triangles + start)
        start += len(both)
        half = len(both) // 2
        left, right = (1, 1) if k < len(pieces) else (2, 3)
        weights += [rigid(half, left), rigid(half, right)]
    flat, triangles = np.concatenate(points), np.concatenate(faces)
    low = flat[triangles].mean(1)[:, 1] < 0.022
    parts = [Part(SHELL, triangles[~low]), Part(TIP, triangles[low])]
    return Mesh("Limbs", flat, parts, np.concatenate(weights))


def stalks(rigid: Rigid) -> Mesh:
    """Eyes on stalks, which rise in the pose ``EyestalkPerk``."""
    top = STALK + np.array([0.006, 0.036, 0.006])
    foot, bend = STALK - [0, 0.012, 0.002], STALK + np.array([0.002, 0.012, 0.001])
    path = _spline([tuple(foot), tuple(bend), tuple(top)], 6)
    radius = np.linspace(0.0115, 0.0095, 6)
    stalk, tube_faces = tube(path, np.stack([radius, radius], 1), 10, np.array([0, 0, 1.0]))
    tube_faces = outward(stalk - stalk.mean(0), tube_faces)
    unit, ball_faces = ball(np.array([0.18, 0.36, 0.50, 0.70, 1.0, 1.4, 1.9, 2.5]), 14)
    tilt = np.radians(7.0)
    c, s = np.cos(tilt), np.sin(tilt)
    q = np.stack([c * unit[:, 0] + s * unit[:, 2], unit[:, 1], c * unit[:, 2] - s * unit[:, 0]], 1)
    eye = q * 0.0250 + top + [0.0, 0.010, 0.004]
    points = np.concatenate([stalk, eye])
    cut = 5 * 14
    groups = [(SHELL, tube_faces), (PUPIL, ball_faces[:cut] + len(stalk)),
              (WHITE, ball_faces[cut:] + len(stalk))]  # fmt: skip
    parts = []
    both = points
    for material, faces in groups:
        both, triangles = _mirrored(points, faces)
        parts.append(Part(material, triangles))
    height = np.clip((both[:, 1] - STALK[1]) / 0.018, 0.0, 1.0)[:, None]
    perk = height * [0.0, 0.0260, 0.0] + (1 - height) * [0.0, 0.0060, 0.0]
    perk = perk + height * np.sign(both[:, :1]) * [-0.0030, 0.0, 0.0]
    return Mesh("Eyes", both, parts, rigid(len(both), 1), {"EyestalkPerk": perk})
