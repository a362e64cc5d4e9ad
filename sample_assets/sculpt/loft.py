"""Sheets and tubes: grids of points turned into triangles."""

from __future__ import annotations

import numpy as np

from .mesh import FloatArray, IntArray
from .shell import split_quads


def sheet(rows: int, columns: int, wrap: bool = False, start: int = 0) -> IntArray:
    """Triangles of a grid of vertices, row by row; ``wrap`` joins last and first column.

    Seen from outside, rows go down and columns to the right (counter-clockwise triangles).
    """
    i, j = np.meshgrid(np.arange(rows - 1), np.arange(columns - (not wrap)), indexing="ij")
    right = (j + 1) % columns
    corners = (
        i * columns + j,
        (i + 1) * columns + j,
        (i + 1) * columns + right,
        i * columns + right,
    )
    quads = np.stack([c.ravel() for c in corners], axis=1) + start
    return split_quads(quads.astype(np.int64))


def fan(ring: IntArray, centre: int, flip: bool = False) -> IntArray:
    """Triangles between a closed ring (N,) and a centre vertex."""
    following = np.roll(ring, -1)
    middle = np.full(len(ring), centre)
    pair = [following, ring] if flip else [ring, following]
    return np.stack([*pair, middle], axis=1)


def ring_angles(n: int) -> FloatArray:
    """Angles (n,) of a full turn."""
    return np.asarray(2 * np.pi * np.arange(n) / n)


def ball(polar: FloatArray, n: int) -> tuple[FloatArray, IntArray]:
    """Unit sphere whose first pole is +Z.

    Args:
        polar: (K,) angles from +Z of its rings, in radians, without the poles.
        n: Vertices per ring.

    Returns:
        Points (K * n + 2, 3), of which the last two are the poles, and triangles by band:
        the first n around the front pole, then 2 n per band, the last n around the back pole.
    """
    around = ring_angles(n)
    rings = np.stack(
        [
            np.sin(polar)[:, None] * np.cos(around),
            np.sin(polar)[:, None] * np.sin(around),
            np.cos(polar)[:, None] * np.ones(n),
        ],
        axis=2,
    ).reshape(-1, 3)
    k = len(polar)
    bands = [fan(np.arange(n), k * n)]
    bands += [sheet(2, n, wrap=True, start=i * n) for i in range(k - 1)]
    bands.append(fan(np.arange((k - 1) * n, k * n), k * n + 1, flip=True))
    return np.concatenate([rings, [[0, 0, 1.0], [0, 0, -1.0]]]), np.concatenate(bands)


def tube(
    centres: FloatArray, radii: FloatArray, n: int, up: FloatArray
) -> tuple[FloatArray, IntArray]:
    """Closed tube around a path.

    Args:
        centres: (K, 3) path.
        radii: (K, 2) half-width across (sideways, along ``up``).
        n: Vertices per ring.
        up: (3,) direction that is roughly across the path.

    Returns:
        Points (K * n + 2, 3), of which the last two are the middles of the ends, and triangles.
    """
    tangent = np.gradient(centres, axis=0)
    tangent /= np.linalg.norm(tangent, axis=1, keepdims=True)
    across = np.cross(tangent, up)
    across /= np.linalg.norm(across, axis=1, keepdims=True)
    upright = np.cross(across, tangent)
    angle = ring_angles(n)
    points = (
        centres[:, None, :]
        + (radii[:, :1] * np.cos(angle))[:, :, None] * across[:, None, :]
        + (radii[:, 1:] * np.sin(angle))[:, :, None] * upright[:, None, :]
    ).reshape(-1, 3)
    k = len(centres)
    triangles = [
        sheet(k, n, wrap=True),
        fan(np.arange(n), k * n),
        fan(np.arange((k - 1) * n, k * n), k * n + 1, flip=True),
    ]
    return np.concatenate([points, centres[[0]], centres[[-1]]]), np.concatenate(triangles)


def outward(points: FloatArray, triangles: IntArray) -> IntArray:
    """The triangles of a closed surface, turned round if its volume comes out negative."""
    a, b, c = (points[triangles[:, k]] for k in range(3))
    volume = (np.cross(a, b) * c).sum()
    return triangles if volume > 0 else triangles[:, ::-1]
