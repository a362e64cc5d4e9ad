"""All meshes as one: what never moves is told from what does, as most of a head stands still."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from animeme_stages.pictures.raster import Floats, Indices, Singles, summed_normals
from animeme_stages.pictures.scene import Material, SceneMesh, Target, numbered


class Body:
    """The drawn meshes of a scene, joined.

    Attributes:
        triangles: (T, 3) vertices.
        material: (T,) index into `materials`.
        materials: of all primitives.
        welded: (V,) vertices of one number share a normal.
        groups: how many such numbers there are.
        uv: (V, 2) of each vertex.
        albedo: (V, 3) linear RGB of its material, tinted.
        roughness: (V,) of its material.
        holed: (T,) whether the material has holes.
        double_sided: (T,) whether it shows its back.
    """

    def __init__(self, meshes: Sequence[SceneMesh]) -> None:
        self.meshes = tuple(mesh for mesh in meshes if mesh.primitives)
        self.starts = np.cumsum([0] + [len(mesh.points) for mesh in self.meshes])
        count = int(self.starts[-1])
        uv, albedo = np.zeros((count, 2), np.float32), np.ones((count, 3), np.float32)
        welded, self.groups = np.zeros(count, np.int64), 0
        materials: list[Material] = []
        triangles, kinds = [], []
        for mesh, start in zip(self.meshes, self.starts, strict=False):
            own = slice(start, start + len(mesh.points))
            welded[own] = mesh.welded + self.groups
            self.groups += int(mesh.welded.max()) + 1
            if mesh.uv is not None:
                uv[own] = mesh.uv
            if mesh.tint is not None:
                albedo[own] = mesh.tint
            for primitive in mesh.primitives:
                triangles.append(primitive.triangles + start)
                kinds.append(np.full(len(primitive.triangles), len(materials)))
                materials.append(primitive.material)
        self.material = np.concatenate(kinds)
        pairs = np.concatenate(triangles) * len(materials) + self.material[:, None]
        distinct, corner = np.unique(pairs, return_inverse=True)
        vertex, kind = np.divmod(distinct, len(materials))
        albedo = albedo[vertex] * np.array([m.colour for m in materials], np.float32)[kind]
        chosen, number = self._distinct(vertex, kind, welded[vertex], uv[vertex], albedo)
        self.kept, self.welded, self.uv = vertex[chosen], welded[vertex[chosen]], uv[vertex[chosen]]
        self.albedo = albedo[chosen]
        self.roughness = np.array([m.roughness for m in materials], np.float32)[kind[chosen]]
        self.triangles = number[corner.reshape(-1, 3)]
        self.materials = tuple(materials)
        self.holed = np.array([m.cutoff is not None for m in materials])[self.material]
        self.double_sided = np.array([m.double_sided for m in materials])[self.material]

    def points(self, weights: Mapping[str, float]) -> Floats:
        """Vertices (V, 3) under canonical shape weights."""
        return np.concatenate([mesh.deformed(weights) for mesh in self.meshes])[self.kept]

    def _distinct(
        self, vertex: Indices, kind: Indices, welded: Indices, uv: Singles, albedo: Singles
    ) -> tuple[Indices, Indices]:
        """Which of the vertices of a material differ, and which of these each one is.

        Exporters write a vertex once per corner: four times as many as there are.
        """
        looks = np.round(np.concatenate([uv, albedo], axis=1) * 65536).astype(np.int64)
        first, group = numbered(np.concatenate([welded[:, None], kind[:, None], looks], axis=1))
        same = first[group]
        for mesh, start in zip(self.meshes, self.starts, strict=False):
            own = np.flatnonzero((vertex >= start) & (vertex < start + len(mesh.points)))
            here, there = vertex[own] - start, vertex[same[own]] - start
            for target in mesh.targets.values():
                size = float(np.abs(target.offsets).max(initial=0.0))
                apart = np.abs(target.offsets[:, here] - target.offsets[:, there]).max((0, 2))
                differ = own[apart > 1e-5 * size]
                same[differ] = differ
        chosen, number = np.unique(same, return_inverse=True)
        return chosen, number.reshape(-1)


class Motion:
    """A body whose shapes vary within a range.

    Args:
        body: what moves.
        ranges: canonical shape → its least and greatest weight; shapes that are not named rest.
            Without any all vertices may move.
        least: a vertex that moves by less than this, world units, stands still.

    Attributes:
        moving: (M,) vertices that move.
        changing: (T,) triangles that look different when they do.
    """

    def __init__(
        self, body: Body, ranges: Mapping[str, tuple[float, float]] | None, least: float
    ) -> None:
        self.body = body
        base = {} if ranges is None else {name: low for name, (low, _) in ranges.items()}
        self.still = body.points(base)
        self._base = base
        self._moved = body.triangles
        self._table: Singles | None = None
        self.moving: Indices = np.arange(len(self.still))
        self.changing: NDArray[np.bool_] = np.ones(len(body.triangles), dtype=bool)
        self._fixed = np.zeros((body.groups, 3))
        varying = {n: e for n, e in (ranges or {}).items() if e[0] != e[1]}
        if any(name in mesh.targets for mesh in body.meshes for name in varying):
            self._split(varying, least)

    def _split(self, ranges: Mapping[str, tuple[float, float]], least: float) -> None:
        body = self.body
        amount = np.zeros(int(body.starts[-1]))
        for mesh, start in zip(body.meshes, body.starts, strict=False):
            own = slice(start, start + len(mesh.points))
            for name, target in mesh.targets.items():
                if name in ranges:
                    reach = max(map(abs, ranges[name])) + ranges[name][1] - ranges[name][0]
                    amount[own] += reach * np.linalg.norm(target.offsets, axis=2).max(0)
        amount = amount[body.kept]
        moves = amount > least
        self.moving = np.flatnonzero(moves)
        moved = moves[body.triangles].any(1)
        turned = np.zeros(body.groups, dtype=bool)
        turned[body.welded[body.triangles[moved]]] = True
        self.changing = np.asarray(turned[body.welded[body.triangles]].any(1))
        self._moved = body.triangles[moved]
        self._fixed = summed_normals(self.still, body.triangles[~moved], body.welded, body.groups)
        self._columns, self._table = self._tabled(ranges)

    def _tabled(
        self, ranges: Mapping[str, tuple[float, float]]
    ) -> tuple[list[tuple[str, Target, float]], Singles]:
        """Which pose of which shape each row is, and the rows: offsets (R, M * 3) that move."""
        body, rows = self.body, []
        columns: list[tuple[str, Target, float]] = []
        for mesh, start in zip(body.meshes, body.starts, strict=False):
            own = body.kept[self.moving] - start
            at = np.flatnonzero((own >= 0) & (own < len(mesh.points)))
            for name, target in mesh.targets.items():
                if name not in ranges:
                    continue
                rest = mesh.rest.get(name, 0.0)
                same = [
                    i
                    for i, (other, shape, still) in enumerate(columns)
                    if (other, shape.weights, still) == (name, target.weights, rest)
                ]
                if not same:
                    same = [len(columns)]
                    columns.append((name, target, rest))
                    rows.append(np.zeros((len(target.weights), len(self.moving), 3), np.float32))
                rows[same[0]][:, at] = target.offsets[:, own[at]]
        table = np.concatenate(rows)
        return columns, table.reshape(len(table), len(self.moving) * 3)

    def points(self, weights: Mapping[str, float]) -> Floats:
        """Vertices (V, 3) under canonical shape weights."""
        if self._table is None:
            return self.body.points(weights)
        factors: list[float] = []
        for name, target, rest in self._columns:
            now = target.factors(weights.get(name, rest))
            then = target.factors(self._base.get(name, rest))
            factors += [a - b for a, b in zip(now, then, strict=True)]
        points = self.still.copy()
        points[self.moving] += np.reshape(np.array(factors, np.float32) @ self._table, (-1, 3))
        return points

    def normals(self, points: Floats) -> Singles:
        """Unit normals (V, 3), zero where no triangle is."""
        body = self.body
        total = self._fixed + summed_normals(points, self._moved, body.welded, body.groups)
        total /= np.maximum(np.linalg.norm(total, axis=1, keepdims=True), 1e-20)
        return np.asarray(total[body.welded], dtype=np.float32)
