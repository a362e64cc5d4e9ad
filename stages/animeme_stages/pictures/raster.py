"""Vectorised z-buffer rasteriser: triangles become spans of pixels, row by row, all at once."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Singles = NDArray[np.float32]
Indices = NDArray[np.int64]

# Pixels filled at a time, so that memory stays bounded (about 60 bytes each).
_MOST_FRAGMENTS = 1 << 20
_NEAREST = 1e-6
_WIDEST_PX = 1e6
_EMPTY = np.iinfo(np.int64).max

Opaque = Callable[[Indices, Singles], NDArray[np.bool_]]
"""Given triangles (F,) and barycentric coordinates (F, 3): where there is something to see."""


@dataclass(frozen=True)
class Corners:
    """Triangles on the screen, ready to be filled.

    Attributes:
        x, y: (T, 3) pixel coordinates, y down.
        closeness: (T, 3) inverse of the distance from the eye plane; linear on the screen.
        area: (T,) twice its area, negative if its front is seen.
        usable: (T,) whether it is in front of the eye and has an area.
    """

    x: Singles
    y: Singles
    closeness: Singles
    area: Singles
    usable: NDArray[np.bool_]

    def of(self, count: int, place: Indices, keep: NDArray[np.bool_]) -> Corners:
        """The same triangles as some of `count`: at `place`, those that are kept."""
        if len(place) == count:
            return replace(self, usable=self.usable & keep)
        wide = np.zeros((3, count, 3), np.float32)
        area, usable = np.zeros(count, np.float32), np.zeros(count, dtype=bool)
        wide[0, place], wide[1, place], wide[2, place] = self.x, self.y, self.closeness
        area[place], usable[place] = self.area, self.usable & keep
        return Corners(wide[0], wide[1], wide[2], area, usable)


class Canvas:
    """Which triangle each pixel shows.

    Args:
        width, height: in pixels.
    """

    def __init__(self, width: int, height: int) -> None:
        self.width, self.height = width, height
        self._nearest: Indices = np.full(width * height, _EMPTY, dtype=np.int64)

    def copy(self) -> Canvas:
        """The same, to draw more upon."""
        made = Canvas.__new__(Canvas)
        made.width, made.height = self.width, self.height
        made._nearest = self._nearest.copy()
        return made

    def pixels(self) -> tuple[Indices, Indices]:
        """Covered pixels (F,), row by row, and the triangle (F,) that each of them shows."""
        covered = np.flatnonzero(self._nearest != _EMPTY)
        return covered, self._nearest[covered] & 0xFFFFFFFF

    def closeness(self) -> Singles:
        """Inverse distance from the eye plane (height, width), 0 where nothing was drawn."""
        bits = np.int64(0xFFFFFFFF) - (self._nearest >> 32)
        found = np.where(self._nearest == _EMPTY, 0, bits).astype(np.uint32)
        return found.view(np.float32).reshape(self.height, self.width)

    def fill(self, corners: Corners, chosen: Indices, opaque: Opaque | None = None) -> None:
        """Draw some triangles; of several in a pixel the nearest is kept, at a tie the first.

        Args:
            corners: of all triangles.
            chosen: (N,) which of them to draw.
            opaque: leaves out what cannot be seen.
        """
        part = chosen[corners.usable[chosen]]
        if not len(part):
            return
        y = corners.y[part]
        first = np.clip(np.ceil(y.min(1) - 0.5), 0, self.height).astype(np.int64)
        last = np.clip(np.floor(y.max(1) - 0.5), -1, self.height - 1).astype(np.int64)
        rows = np.maximum(last - first + 1, 0)
        which = np.repeat(np.arange(len(part)), rows)
        row = _counted(rows) + np.repeat(first, rows)
        left, right = _span(corners.x[part], y, which, row)
        start = np.clip(np.ceil(left - 0.5), 0, self.width).astype(np.int64)
        stop = np.clip(np.floor(right - 0.5), -1, self.width - 1).astype(np.int64) + 1
        count = np.maximum(stop - start, 0)
        planes = _planes(corners, part)
        total = np.cumsum(count)
        cut = 0
        while cut < len(count):
            done = total[cut - 1] if cut else 0
            end = max(int(np.searchsorted(total, done + _MOST_FRAGMENTS, "right")), cut + 1)
            some = slice(cut, end)
            spans = part[which[some]], planes[which[some]], row[some], start[some], count[some]
            self._put(corners, *spans, opaque)
            cut = end

    def _put(
        self,
        corners: Corners,
        triangle: Indices,
        planes: Floats,
        row: Indices,
        start: Indices,
        count: Indices,
        opaque: Opaque | None,
    ) -> None:
        """Write spans of pixels where they are nearer than what is there."""
        slope = planes[:, 0]
        across = planes[:, 2] + planes[:, 1] * (row + 0.5)
        x = _counted(count) + np.repeat(start, count)
        close = np.repeat(across, count) + np.repeat(slope, count) * (x + 0.5)
        pixel = np.repeat(row * self.width, count) + x
        owner = np.repeat(triangle, count)
        np.maximum(close, _NEAREST, out=close)  # rounding at the rims of slivers
        if opaque is not None:
            seen = opaque(owner, barycentric(corners, owner, pixel, self.width))
            pixel, close, owner = pixel[seen], close[seen], owner[seen]
        # The bits of positive floats are in the order of the floats.
        bits = close.astype(np.float32).view(np.uint32).astype(np.int64)
        np.minimum.at(self._nearest, pixel, ((0xFFFFFFFF - bits) << 32) | owner)


def on_screen(screen: Floats, distance: Floats, triangles: Indices) -> Corners:
    """Triangles between vertices that are on the screen.

    Args:
        screen: (V, 2) pixel coordinates, x right and y down.
        distance: (V,) from the eye plane, positive in front of it.
        triangles: (T, 3) vertex indices.
    """
    x, y = (screen[:, k].astype(np.float32)[triangles] for k in (0, 1))
    close = (1.0 / np.maximum(distance, _NEAREST)).astype(np.float32)[triangles]
    area = _area(x, y)
    usable = (close.max(1) < 0.5 / _NEAREST) & (np.abs(area) > 1e-6)
    # Nor what an eye in the middle of it would see of it.
    usable &= (np.abs(x).max(1) < _WIDEST_PX) & (np.abs(y).max(1) < _WIDEST_PX)
    return Corners(x, y, close, area, usable)


def barycentric(corners: Corners, triangle: Indices, pixel: Indices, width: int) -> Singles:
    """Barycentric coordinates (F, 3), on the screen, of pixels within their triangles."""
    x, y, area = corners.x, corners.y, corners.area
    inverse = np.float32(1) / np.where(area == 0, np.float32(1), area)
    planes = np.empty((len(x), 6), np.float32)
    for k in (0, 1):
        i, j = (k + 1) % 3, (k + 2) % 3
        planes[:, 3 * k] = (y[:, i] - y[:, j]) * inverse
        planes[:, 3 * k + 1] = (x[:, j] - x[:, i]) * inverse
        planes[:, 3 * k + 2] = (x[:, i] * y[:, j] - x[:, j] * y[:, i]) * inverse
    row = pixel // width
    px = (pixel - row * width + 0.5).astype(np.float32)
    py = (row + 0.5).astype(np.float32)
    of = planes[triangle]
    found = np.empty((len(pixel), 3), np.float32)
    found[:, 0] = of[:, 0] * px + of[:, 1] * py + of[:, 2]
    found[:, 1] = of[:, 3] * px + of[:, 4] * py + of[:, 5]
    np.clip(found[:, :2], 0.0, 1.0, out=found[:, :2])
    found[:, 2] = np.maximum(1.0 - found[:, 0] - found[:, 1], 0.0)
    return found


def _area(x: Singles, y: Singles) -> Singles:
    """Twice the signed areas (T,)."""
    return np.asarray(
        (x[:, 1] - x[:, 0]) * (y[:, 2] - y[:, 0]) - (y[:, 1] - y[:, 0]) * (x[:, 2] - x[:, 0])
    )


def _counted(lengths: Indices) -> Indices:
    """0, 1, … for each length, one after the other."""
    ends = np.cumsum(lengths)
    total = int(ends[-1]) if len(ends) else 0
    return np.arange(total) - np.repeat(ends - lengths, lengths)


def _span(x: Singles, y: Singles, which: Indices, row: Indices) -> tuple[Singles, Singles]:
    """Where triangles (T, 3) begin and end along the middle of rows of pixels (R,)."""
    middle = row.astype(np.float32) + np.float32(0.5)
    left, right = np.full(len(row), 1e6, np.float32), np.full(len(row), -1e6, np.float32)
    for k in range(3):
        x0, x1, y0, y1 = x[:, k], x[:, (k + 1) % 3], y[:, k], y[:, (k + 1) % 3]
        # Both triangles that share an edge must find the same place on it.
        swap = (y0 > y1) | ((y0 == y1) & (x0 > x1))
        x0, x1 = np.where(swap, x1, x0), np.where(swap, x0, x1)
        y0, y1 = np.where(swap, y1, y0), np.where(swap, y0, y1)
        slope = (x1 - x0) / np.where(y0 < y1, y1 - y0, np.float32(1))
        edge = np.stack([y0, np.where(y0 < y1, y1, -np.inf), x0, slope], axis=1)[which]
        crosses = (edge[:, 0] <= middle) & (middle <= edge[:, 1])
        at = edge[:, 2] + edge[:, 3] * (middle - edge[:, 0])
        np.minimum(left, at, out=left, where=crosses)
        np.maximum(right, at, out=right, where=crosses)
    return left, right


def _planes(corners: Corners, part: Indices) -> Floats:
    """Closeness over the screen (N, 3): change per pixel across and down, value at (0, 0)."""
    x, y, z = (
        table[part].astype(np.float64) for table in (corners.x, corners.y, corners.closeness)
    )
    area = (x[:, 1] - x[:, 0]) * (y[:, 2] - y[:, 0]) - (y[:, 1] - y[:, 0]) * (x[:, 2] - x[:, 0])
    dz1, dz2 = z[:, 1] - z[:, 0], z[:, 2] - z[:, 0]
    across = (dz1 * (y[:, 2] - y[:, 0]) - dz2 * (y[:, 1] - y[:, 0])) / area
    down = (dz2 * (x[:, 1] - x[:, 0]) - dz1 * (x[:, 2] - x[:, 0])) / area
    return np.stack([across, down, z[:, 0] - across * x[:, 0] - down * y[:, 0]], axis=1)


def summed_normals(points: Floats, triangles: Indices, welded: Indices, count: int) -> Floats:
    """Area-weighted normals (count, 3), not of unit length, of groups of vertices.

    Args:
        points: (V, 3).
        triangles: (T, 3).
        welded: (V,) group of each vertex: those at the seams of textures share a normal.
        count: number of groups.
    """
    a, b, c = (points[triangles[:, k]] for k in range(3))
    u, v = b - a, c - a
    face = (
        u[:, 1] * v[:, 2] - u[:, 2] * v[:, 1],
        u[:, 2] * v[:, 0] - u[:, 0] * v[:, 2],
        u[:, 0] * v[:, 1] - u[:, 1] * v[:, 0],
    )
    group = welded[triangles].T.ravel()
    return np.stack([np.bincount(group, np.tile(axis, 3), count) for axis in face], axis=1)
