"""Vectorised z-buffer rasteriser: triangles are filled in bulk, by size of bounding box."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]

_MAX_FRAGMENTS = 1_500_000


@dataclass(frozen=True)
class Fragments:
    """Visible surface of each covered pixel.

    Attributes:
        pixel: (F,) flat pixel index (row * width + column), each at most once.
        triangle: (F,) index of the visible triangle.
        bary: (F, 3) barycentric coordinates in that triangle.
        depth: (height * width,) distance to the eye, infinity where nothing was drawn.
    """

    pixel: IntArray
    triangle: IntArray
    bary: FloatArray
    depth: FloatArray


def rasterise(
    screen: FloatArray, depth: FloatArray, triangles: IntArray, width: int, height: int
) -> Fragments:
    """Fill triangles and keep the nearest surface in each pixel.

    Args:
        screen: (V, 2) pixel coordinates (x right, y down).
        depth: (V,) distance from the eye plane, positive in front of it.
        triangles: (T, 3) vertex indices, already culled as wished.
        width: Image width in pixels.
        height: Image height in pixels.
    """
    corner = screen[triangles]
    low = np.floor(corner.min(1) - 0.5).astype(np.int64) + 1
    low = np.maximum(low, 0)
    high = np.minimum(np.floor(corner.max(1) - 0.5).astype(np.int64), [width - 1, height - 1])
    extent = high - low + 1
    usable = (extent > 0).all(1) & (depth[triangles].min(1) > 1e-6)
    classes = np.ceil(np.log2(np.maximum(extent, 1))).astype(np.int64)
    buffer = np.full(width * height, np.inf)
    found: list[tuple[IntArray, IntArray, FloatArray, FloatArray]] = []
    for kind in np.unique(classes[usable], axis=0):
        members = np.flatnonzero(usable & (classes == kind).all(1))
        box = 1 << kind
        chunk = max(1, _MAX_FRAGMENTS // int(box[0] * box[1]))
        for start in range(0, len(members), chunk):
            part = members[start : start + chunk]
            found.append(_fill(part, corner, depth[triangles], low, high, box, width))
            np.minimum.at(buffer, found[-1][0], found[-1][3])
    return _nearest(found, buffer)


def _fill(
    part: IntArray,
    corner: FloatArray,
    depth: FloatArray,
    low: IntArray,
    high: IntArray,
    box: IntArray,
    width: int,
) -> tuple[IntArray, IntArray, FloatArray, FloatArray]:
    """Pixel, triangle, barycentric coordinates and depth of the pixels inside some triangles."""
    dx, dy = np.meshgrid(np.arange(box[0]), np.arange(box[1]))
    px = low[part, 0, None] + dx.ravel()
    py = low[part, 1, None] + dy.ravel()
    a, b, c = (corner[part, k][:, None, :] for k in range(3))
    x, y = px + 0.5, py + 0.5
    area = (b[..., 0] - a[..., 0]) * (c[..., 1] - a[..., 1]) - (b[..., 1] - a[..., 1]) * (
        c[..., 0] - a[..., 0]
    )
    area = np.where(np.abs(area) < 1e-12, 1e-12, area)
    w0 = ((b[..., 0] - x) * (c[..., 1] - y) - (b[..., 1] - y) * (c[..., 0] - x)) / area
    w1 = ((c[..., 0] - x) * (a[..., 1] - y) - (c[..., 1] - y) * (a[..., 0] - x)) / area
    w2 = 1.0 - w0 - w1
    inside = (w0 >= -1e-9) & (w1 >= -1e-9) & (w2 >= -1e-9)
    inside &= (px <= high[part, 0, None]) & (py <= high[part, 1, None])
    rows, cells = np.nonzero(inside)
    bary = np.stack([w0[rows, cells], w1[rows, cells], w2[rows, cells]], axis=1)
    # Barycentric coordinates are linear on the screen; divide by depth for perspective.
    bary /= depth[part[rows]]
    bary /= bary.sum(1, keepdims=True)
    z = (bary * depth[part[rows]]).sum(1)
    return py[rows, cells] * width + px[rows, cells], part[rows], bary, z


def _nearest(
    found: list[tuple[IntArray, IntArray, FloatArray, FloatArray]], buffer: FloatArray
) -> Fragments:
    """Keep one fragment per pixel: the one that set the z-buffer."""
    if not found:
        empty = np.zeros(0, dtype=np.int64)
        return Fragments(empty, empty, np.zeros((0, 3)), buffer)
    kept = [(p[m], t[m], w[m]) for p, t, w, z in found for m in [z <= buffer[p]]]
    pixel = np.concatenate([k[0] for k in kept])
    triangle = np.concatenate([k[1] for k in kept])
    bary = np.concatenate([k[2] for k in kept])
    pixel, first = np.unique(pixel, return_index=True)
    return Fragments(pixel, triangle[first], bary[first], buffer)


def vertex_normals(points: FloatArray, triangles: IntArray) -> FloatArray:
    """Area-weighted unit normals (V, 3) of a triangle mesh, zero where no triangle is."""
    a, b, c = points[triangles[:, 0]], points[triangles[:, 1]], points[triangles[:, 2]]
    face = np.cross(b - a, c - a)
    total = np.zeros_like(points)
    for k in range(3):
        for axis in range(3):
            total[:, axis] += np.bincount(triangles[:, k], face[:, axis], len(points))
    length = np.linalg.norm(total, axis=1, keepdims=True)
    return np.asarray(total / np.maximum(length, 1e-20))


def box_blur(image: FloatArray, radius: int) -> FloatArray:
    """Mean over a square of side ``2 * radius + 1``, edges repeated; image is (H, W)."""
    for axis in (0, 1):
        pad = [(0, 0), (0, 0)]
        pad[axis] = (radius + 1, radius)
        total = np.cumsum(np.pad(image, pad, mode="edge"), axis=axis)
        size = 2 * radius + 1
        if axis == 0:
            image = (total[size:] - total[:-size]) / size
        else:
            image = (total[:, size:] - total[:, :-size]) / size
    return image
