"""Topology of a closed skin: a grid around a body with holes, and rings that fill the holes."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from .field import Field, gradient, project
from .mesh import FloatArray, IntArray


@dataclass(frozen=True)
class Hole:
    """Rectangle of removed grid cells: rows [top, bottom], columns [left, right], inclusive.

    Columns may be negative; they count from the front middle and wrap around.
    """

    top: int
    bottom: int
    left: int
    right: int

    def loop(self) -> list[tuple[int, int]]:
        """Grid places around the hole, from the right middle upwards (seen from the front)."""
        middle = (self.top + self.bottom) // 2
        right = [(i, self.right) for i in range(middle, self.top, -1)]
        top = [(self.top, j) for j in range(self.right, self.left, -1)]
        left = [(i, self.left) for i in range(self.top, self.bottom)]
        bottom = [(self.bottom, j) for j in range(self.left, self.right)]
        rest = [(i, self.right) for i in range(self.bottom, middle, -1)]
        return right + top + left + bottom + rest


class Shell:
    """Collects vertices and triangles of one skin.

    The grid has ``rows`` rows from the pole down and ``columns`` columns around +Y; column 0
    looks to +Z and columns go on towards +X. Vertex 0 is the pole.
    """

    def __init__(self, rows: int, columns: int, holes: list[Hole]) -> None:
        """Lay out the grid; hole interiors get no vertices."""
        self.columns = columns
        self.count = 1
        self.place: dict[tuple[int, int], int] = {}
        gone = {
            (i, j % columns)
            for h in holes
            for i in range(h.top + 1, h.bottom)
            for j in range(h.left + 1, h.right)
        }
        for i in range(rows):
            for j in range(columns):
                if (i, j) not in gone:
                    self.place[i, j] = self.count
                    self.count += 1
        empty = {
            (i, j % columns)
            for h in holes
            for i in range(h.top, h.bottom)
            for j in range(h.left, h.right)
        }
        self.groups: dict[str, list[IntArray]] = {"skin": []}
        fan = [(self.at(0, j), self.at(0, j + 1), 0) for j in range(columns)]
        self.groups["skin"].append(np.array(fan, dtype=np.int64))
        for i in range(rows - 1):
            cells = [j for j in range(columns) if (i, j) not in empty]
            quads = [
                (self.at(i, j), self.at(i + 1, j), self.at(i + 1, j + 1), self.at(i, j + 1))
                for j in cells
            ]
            if quads:
                flip = np.array([j >= columns // 2 for j in cells])
                self.groups["skin"].append(split_quads(np.array(quads, dtype=np.int64), flip))

    def at(self, row: int, column: int) -> int:
        """Vertex of a grid place; columns wrap around."""
        return self.place[row, column % self.columns]

    def loop(self, hole: Hole) -> IntArray:
        """Vertices around a hole, see `Hole.loop`."""
        return np.array([self.at(i, j) for i, j in hole.loop()], dtype=np.int64)

    def add_rings(
        self, outer: IntArray, groups: list[str], flip: NDArray[np.bool_] | None = None
    ) -> IntArray:
        """Fill inwards with one ring of new vertices per group name.

        Args:
            outer: (N,) vertices of the outermost ring.
            groups: Group of the triangles of each ring.
            flip: (N,) columns whose quads are cut along the other diagonal; by default those
                of the right half of a ring that is symmetric itself.

        Returns:
            (R + 1, N) vertices: the outer ring and the new ones.
        """
        rings = [outer]
        column = np.arange(len(outer))
        if flip is None:
            flip = (column >= len(outer) // 4) & (column < 3 * len(outer) // 4)
        for group in groups:
            ring = np.arange(self.count, self.count + len(outer))
            self.count += len(outer)
            a, b = rings[-1], np.roll(rings[-1], -1)
            quads = np.stack([a, b, np.roll(ring, -1), ring], axis=1)
            self.groups.setdefault(group, []).append(split_quads(quads, flip))
            rings.append(ring)
        return np.stack(rings)

    def close(self, ring: IntArray, group: str) -> int:
        """Fill a ring with a fan around a new vertex, which is returned."""
        centre = self.count
        self.count += 1
        fan = np.stack([ring, np.roll(ring, -1), np.full(len(ring), centre)], axis=1)
        self.groups.setdefault(group, []).append(fan)
        return centre

    def mirror(self, loops: list[tuple[IntArray, IntArray]]) -> IntArray:
        """For each vertex the one on the other side (V,).

        Args:
            loops: Pairs of rings (R, N) that mirror each other; a middle one pairs with itself.
        """
        other = np.arange(self.count)
        for (i, j), vertex in self.place.items():
            other[vertex] = self.at(i, -j)
        for a, b in loops:
            n = a.shape[1]
            back = (n // 2 - np.arange(n)) % n
            other[a[1:]] = b[1:, back]
            other[b[1:]] = a[1:, back]
        return other

    def triangles(self, group: str) -> IntArray:
        """Triangles (T, 3) of a group."""
        return np.concatenate(self.groups[group])

    def all_triangles(self) -> IntArray:
        """Triangles (T, 3) of all groups."""
        return np.concatenate([self.triangles(group) for group in self.groups])


def split_quads(quads: IntArray, flip: NDArray[np.bool_] | None = None) -> IntArray:
    """Two triangles per quad (Q, 4), with the same winding.

    Flipped quads are cut along the other diagonal; without that the triangles of a symmetric
    grid would not be symmetric.
    """
    if flip is not None:
        quads = np.where(flip[:, None], np.roll(quads, 1, axis=1), quads)
    return np.concatenate([quads[:, [0, 1, 2]], quads[:, [0, 2, 3]]])


def adjacency(triangles: IntArray, count: int) -> tuple[IntArray, IntArray]:
    """Directed edges (source, destination) of a mesh, each once, sorted."""
    pairs = np.concatenate([triangles[:, [0, 1]], triangles[:, [1, 2]], triangles[:, [2, 0]]])
    pairs = np.concatenate([pairs, pairs[:, ::-1]])
    key = np.unique(pairs[:, 0] * count + pairs[:, 1])
    return key // count, key % count


def neighbour_mean(values: FloatArray, edges: tuple[IntArray, IntArray]) -> FloatArray:
    """Mean of the values (V, C) of each vertex's neighbours."""
    source, destination = edges
    degree = np.bincount(source, minlength=len(values))
    total = np.stack([np.bincount(source, v[destination], len(values)) for v in values.T], axis=1)
    return np.asarray(total / np.maximum(degree, 1)[:, None])


def relax(
    points: FloatArray,
    triangles: IntArray,
    pinned: IntArray,
    field: Field,
    steps: int,
    anchor: FloatArray,
    mirror: IntArray,
) -> FloatArray:
    """Even out a mesh on the surface of a field.

    Args:
        points: (V, 3) initial positions.
        triangles: (T, 3) triangles.
        pinned: Vertices that stay.
        field: The surface.
        steps: Number of passes.
        anchor: (V,) how strongly each vertex is drawn to where it was, from 0 to 1.
        mirror: (V,) vertex on the other side of each one.
    """
    start = points.copy()
    edges = adjacency(triangles, len(points))
    free = np.ones(len(points), dtype=bool)
    free[pinned] = False
    for _ in range(steps):
        pull = 0.6 * (neighbour_mean(points, edges) - points)[free]
        pull += (anchor[:, None] * (start - points))[free]
        # Only along the surface, else vertices slide off everything that stands out.
        normal = gradient(field, points[free])
        normal /= np.maximum(np.linalg.norm(normal, axis=1, keepdims=True), 1e-9)
        pull -= (pull * normal).sum(1, keepdims=True) * normal
        points[free] = project(field, points[free] + pull, 1)
        points = symmetrised(points, mirror)
    points[free] = project(field, points[free], 6)
    return points


def symmetrised(points: FloatArray, mirror: IntArray) -> FloatArray:
    """Points averaged with their mirror images."""
    return np.asarray(0.5 * (points + points[mirror] * [-1.0, 1.0, 1.0]))
