"""Rows of teeth with gums, and tongues."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from .loft import outward, sheet, tube
from .mesh import FloatArray, IntArray

SAMPLES = 4
"""Points along the arch per tooth."""
PROFILE = (
    (-0.0040, 0.0135), (-0.0012, 0.0098), (0.0000, 0.0072), (0.0007, 0.0042), (0.0003, 0.0012),
    (-0.0004, 0.0), (-0.0018, 0.0002), (-0.0046, 0.0065), (-0.0056, 0.0140),
)  # fmt: skip
"""Cross-section of an upper row: outwards from the arch, and up from the incisors' edge."""
GUM_BANDS = (0, 1, 7)
"""Bands of the cross-section that are gum."""


@dataclass(frozen=True)
class Arch:
    """A dental arch (metres).

    Attributes:
        front: Middle of the front edge.
        width: Half-axis of the ellipse sideways.
        depth: Half-axis of the ellipse backwards.
        teeth: Number of teeth.
        up: 1 for an upper row, whose gums lie above the edge; -1 for a lower one.
        scale: Size of the cross-section relative to a human one.
        drop: How much shorter the last teeth are than the incisors.
    """

    front: tuple[float, float, float]
    width: float
    depth: float
    teeth: int
    up: float
    scale: float = 1.0
    drop: float = 0.0


def tooth_row(arch: Arch, pointed: float = 0.0) -> tuple[FloatArray, IntArray, IntArray, IntArray]:
    """Sculpt a row of teeth.

    Returns:
        Points (V, 3), triangles of the teeth, triangles of the gums, and the vertices of the
        front edge from left to right.
    """
    count = arch.teeth * SAMPLES + 1
    t = np.linspace(1.0, -1.0, count)
    a = np.radians(84.0) * t
    path = np.stack([arch.width * np.sin(a), 0.0 * a, arch.depth * (np.cos(a) - 1.0)], axis=1)
    normal = np.stack([np.sin(a) / arch.width, 0.0 * a, np.cos(a) / arch.depth], axis=1)
    normal /= np.linalg.norm(normal, axis=1, keepdims=True)
    phase = np.arange(count) / SAMPLES
    gap = np.abs(np.cos(np.pi * phase)) ** 6
    middle = np.abs(np.sin(np.pi * phase))
    points = np.empty((count, len(PROFILE), 3))
    for k, (out, height) in enumerate(PROFILE):
        crown = 2 <= k <= 6
        o = out - 0.0009 * gap * crown + 0.0003 * middle * crown
        h = height + (0.0007 * gap if 4 <= k <= 6 else 0.0) - pointed * middle * (4 <= k <= 6)
        points[:, k] = path + (arch.scale * o)[:, None] * normal
        points[:, k, 1] += arch.up * arch.scale * (h + arch.drop * t**2 * (2 <= k <= 6))
    points = points.reshape(-1, 3) + np.asarray(arch.front)
    n = len(PROFILE)
    cells = sheet(count, n).reshape(2, count - 1, n - 1, 3)
    gum = np.isin(np.arange(n - 1), GUM_BANDS)
    flip = 1 if arch.up > 0 else -1
    white = cells[:, :, ~gum].reshape(-1, 3)[:, ::flip]
    pink = cells[:, :, gum].reshape(-1, 3)[:, ::flip]
    return points, white, pink, np.arange(count) * n + 5


def tongue(path: FloatArray, radii: FloatArray, n: int) -> tuple[FloatArray, IntArray, FloatArray]:
    """A tongue along a path (K, 3) from root to tip with half-widths (K, 2).

    Returns:
        Points (V, 3), triangles, and the place (V,) of each point from 0, root, to 1, tip.
    """
    points, triangles = tube(path, radii, n, np.array([0.0, 1.0, 0.0]))
    k = len(path)
    place = np.concatenate([np.repeat(np.linspace(0.0, 1.0, k), n), [0.0, 1.0]])
    ring = points[: k * n].reshape(k, n, 3)
    # A soft furrow along the back.
    top = np.clip(np.sin(2 * np.pi * np.arange(n) / n), 0.0, 1.0) ** 6
    ring[:, :, 1] -= 0.16 * radii[:, 1:] * top * np.sin(np.pi * np.linspace(0.1, 1, k))[:, None]
    points[: k * n] = ring.reshape(-1, 3)
    return points, outward(points - points.mean(0), triangles), place
