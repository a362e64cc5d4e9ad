"""Smooth continuation of displacements over a mesh, and smooth masks."""

from __future__ import annotations

import numpy as np

from .mesh import FloatArray, IntArray
from .shell import adjacency


def step(low: float, high: float, value: FloatArray) -> FloatArray:
    """Smooth step from 0 at ``low`` to 1 at ``high`` (which may be the lesser one)."""
    t = np.clip((value - low) / (high - low), 0.0, 1.0)
    return np.asarray(t * t * t * (t * (6.0 * t - 15.0) + 10.0))


def bump(
    p: FloatArray, centre: tuple[float, float, float], size: tuple[float, float, float]
) -> FloatArray:
    """Gaussian (N,) around a centre, one at it; infinite sizes ignore an axis."""
    return np.asarray(np.exp(-(((p - np.asarray(centre)) / np.asarray(size)) ** 2).sum(1)))


def extend(triangles: IntArray, known: IntArray, values: FloatArray, count: int) -> FloatArray:
    """Continue values smoothly from known vertices to all the others.

    Minimises the squared graph Laplacian of each column, so that the result has neither kinks
    nor, next to zeros, visible borders.

    Args:
        triangles: (T, 3) triangles.
        known: (K,) vertices with given values.
        values: (K, C) their values.
        count: Number of vertices V.

    Returns:
        (V, C) values.
    """
    full = np.zeros((count, values.shape[1]))
    full[known] = values
    free = np.ones(count, dtype=bool)
    free[known] = False
    source, destination = adjacency(triangles, count)
    unknown = np.flatnonzero(free)
    # Rows: the unknown vertices and their neighbours; columns: the unknown and the known ones.
    rows = np.union1d(unknown, source[free[destination]])
    row_of = np.full(count, -1)
    row_of[rows] = np.arange(len(rows))
    column_of = np.full(count, -1)
    column_of[unknown] = np.arange(len(unknown))
    degree = np.bincount(source, minlength=count)
    weight = -1.0 / degree[source]
    right = np.zeros((len(rows), values.shape[1]))
    right[row_of[rows]] = full[rows]
    use = (row_of[source] >= 0) & ~free[destination]
    for column in range(values.shape[1]):
        contribution = weight[use] * full[destination[use], column]
        right[:, column] += np.bincount(row_of[source[use]], contribution, len(rows))
    matrix = np.zeros((len(rows), len(unknown)))
    use = (row_of[source] >= 0) & free[destination]
    matrix[row_of[source[use]], column_of[destination[use]]] = weight[use]
    matrix[row_of[unknown], column_of[unknown]] = 1.0
    full[unknown] = np.linalg.solve(matrix.T @ matrix, -matrix.T @ right)
    return full
