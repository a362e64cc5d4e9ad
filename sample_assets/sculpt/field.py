"""Signed distance fields (negative inside) out of which heads and shells are blended."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from .mesh import FloatArray

Vector = Sequence[float] | FloatArray
"""Three coordinates."""
Field = Callable[[FloatArray], FloatArray]
"""Maps points (N, 3) to signed distances (N,), in metres."""


def ellipsoid(p: FloatArray, centre: Vector, radii: Vector) -> FloatArray:
    """Approximate distance to an axis-aligned ellipsoid; exact on its surface."""
    q = p - np.asarray(centre)
    k0 = np.linalg.norm(q / np.asarray(radii), axis=-1)
    k1 = np.linalg.norm(q / np.square(radii), axis=-1)
    return np.asarray(k0 * (k0 - 1.0) / np.maximum(k1, 1e-9))


def sphere(p: FloatArray, centre: Vector, radius: float) -> FloatArray:
    """Distance to a sphere."""
    return np.asarray(np.linalg.norm(p - np.asarray(centre), axis=-1) - radius)


def cone(p: FloatArray, a: Vector, b: Vector, radius_a: float, radius_b: float) -> FloatArray:
    """Distance to a capsule from a to b whose radius changes linearly."""
    axis = np.asarray(b, dtype=np.float64) - np.asarray(a)
    q = p - np.asarray(a)
    t = np.clip(q @ axis / (axis @ axis), 0.0, 1.0)
    near = np.linalg.norm(q - t[..., None] * axis, axis=-1)
    return np.asarray(near - (radius_a + (radius_b - radius_a) * t))


def union(a: FloatArray, b: FloatArray, blend: float) -> FloatArray:
    """Union with a fillet about as wide as ``blend`` metres."""
    h = np.maximum(blend - np.abs(a - b), 0.0) / blend
    return np.asarray(np.minimum(a, b) - h * h * h * blend / 6.0)


def subtract(a: FloatArray, b: FloatArray, blend: float) -> FloatArray:
    """What is in a and not in b, with a rounded edge."""
    return np.asarray(-union(-a, b, blend))


def gradient(field: Field, p: FloatArray, step: float = 2e-4) -> FloatArray:
    """Gradient (N, 3) from differences along the corners of a tetrahedron."""
    corners = np.array([[1, -1, -1], [-1, -1, 1], [-1, 1, -1], [1, 1, 1]], dtype=np.float64)
    total = np.zeros_like(p)
    for corner in corners:
        total += corner * field(p + step * corner)[:, None]
    return np.asarray(total / (4.0 * step))


def project(field: Field, p: FloatArray, steps: int = 4) -> FloatArray:
    """Move points along the gradient on to the surface."""
    for _ in range(steps):
        g = gradient(field, p)
        square = np.maximum((g * g).sum(1), 0.05)
        p = p - np.clip(field(p) / square, -0.01, 0.01)[:, None] * g
    return p


def cast(field: Field, origin: FloatArray, direction: FloatArray, far: float) -> FloatArray:
    """First surface points met from ``origin + far * direction`` back towards the origin."""
    t = np.full(len(origin), far)
    for _ in range(160):
        t = np.maximum(t - 0.6 * field(origin + t[:, None] * direction), 0.0)
    return np.asarray(origin + t[:, None] * direction)
