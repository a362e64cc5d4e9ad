"""Ada's face: skin, lids, lips and lining in one mesh, without targets."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from . import ada_form as form
from .field import cast, project
from .mesh import FloatArray, IntArray
from .mouth import SKIN_RINGS, LipForm, lip_groups, lip_rings
from .shell import Hole, Shell, adjacency, neighbour_mean, relax, symmetrised
from .smooth import step

COLUMNS = 56
MOUTH_HOLE = Hole(20, 28, -8, 8)
EYE_HOLE = Hole(9, 15, 4, 14)
LID_RINGS = 6
LIPS = LipForm(
    y=form.MOUTH_Y,
    half_width=form.MOUTH_HALF_WIDTH,
    upper=0.0066,
    lower=0.0092,
    fullness=(0.0032, 0.0038),
    smile=0.0022,
    bow=0.0016,
    depth=0.0035,
    lining=(
        (0.0255, 0.0115, 0.0125, 0.0052),
        (0.0290, 0.0170, 0.0190, 0.0140),
        (0.0290, 0.0190, 0.0220, 0.0320),
        (0.0210, 0.0120, 0.0190, 0.0480),
    ),
)


@dataclass(frozen=True)
class Head:
    """The face with the meaning of its vertices.

    Attributes:
        points: (V, 3) positions in design space.
        shell: Topology, with triangles by group: skin, lips, lining, lash.
        mouth: (R, n) vertices of the mouth rings from the skin inwards.
        lids: For the left and the right eye (R, m) vertices from the orbit to the lid's edge and
            beyond; columns run from the side of the left corner as seen from the front.
        mirror: (V,) vertex on the other side.
        throat: Vertex that closes the lining.
    """

    points: FloatArray
    shell: Shell
    mouth: IntArray
    lids: tuple[IntArray, IntArray]
    mirror: IntArray
    throat: int


def _rows() -> list[tuple[float, float, float]]:
    """Height and depth of the origin of each row's rays, and their pitch in front (degrees)."""
    crown = [(0.030, 0.0, pitch) for pitch in (78.0, 62.0, 47.0, 34.0, 23.0)]
    face = np.interp(
        np.arange(26),
        [0, 4, 10, 15, 23, 25],
        [0.056, 0.0215, -0.0195, -0.0460, -0.0880, -0.0985],
    )
    level = [(float(y), 0.0, 0.0) for y in face]
    under = [(-0.100, 0.010, -16.0), (-0.104, 0.005, -32.0), (-0.108, 0.0, -46.0)]
    under += [(-0.115, -0.01, -50.0), (-0.124, -0.02, -35.0)]
    neck = [(float(y), -0.028, 0.0) for y in np.linspace(-0.142, -0.200, 5)]
    return crown + level + under + neck


def _grid(shell: Shell) -> FloatArray:
    """Initial points: where rays of the grid meet the skin."""
    half = np.arange(COLUMNS // 2 + 1) / (COLUMNS // 2)
    turn = np.pi * (0.62 * half + 0.38 * half**2.6)
    theta = np.concatenate([turn, -turn[-2:0:-1]])
    rows = _rows()
    origin = np.zeros((shell.count, 3))
    direction = np.tile([0.0, 1.0, 0.0], (shell.count, 1))
    for (i, j), vertex in shell.place.items():
        y, z, front_pitch = rows[i]
        side = 1.0 if i < 5 else (1 + np.cos(theta[j])) / 2
        pitch = np.radians(front_pitch) * side
        origin[vertex] = (0.0, y, z)
        flat = np.cos(pitch)
        direction[vertex] = (np.sin(theta[j]) * flat, np.sin(pitch), np.cos(theta[j]) * flat)
    return cast(form.noseless, origin, direction, 0.30)


def lid_edge(m: int) -> FloatArray:
    """Offsets (m, 2) in x and y of the edge of the left eye's lids from the eye's centre."""
    angle = 2 * np.pi * np.arange(m) / m
    c, s = np.cos(angle), np.sin(angle)
    x = 0.0181 * c
    upper = 0.0103 * np.abs(s) ** 0.85 * (1.0 - 0.10 * c)
    lower = -0.0086 * np.abs(s) ** 1.05 * (1.0 + 0.12 * c)
    tilt = 0.0016 * c - 0.0006
    return np.stack([x, np.where(s >= 0, upper, lower) + tilt], axis=1)


def _on_ball(offset: FloatArray, radius: float) -> FloatArray:
    """Points (N, 3) on a sphere around the left eye, in front of offsets in x and y."""
    z = np.sqrt(np.maximum(radius**2 - (offset**2).sum(1), 1e-8))
    return np.asarray(form.EYE + np.column_stack([offset, z]))


def _lid_rings(m: int) -> FloatArray:
    """Positions (5, m, 3): end of the liner, edge, lashes, back of the left lids, hidden end."""
    edge = lid_edge(m)
    ball = form.EYE_RADIUS
    angle = 2 * np.pi * np.arange(m) / m
    long = np.clip(np.sin(angle), 0.0, 1.0) ** 0.5 * (1.0 + 0.35 * np.cos(angle))
    lash = _on_ball(edge, ball + 0.0012)
    away = (lash - form.EYE) / np.linalg.norm(lash - form.EYE, axis=1, keepdims=True)
    lash += (0.0016 * long)[:, None] * away - (0.0007 * long)[:, None] * [0.0, 1.0, 0.0]
    lash[:, 0] += 0.0007 * long * np.cos(angle)
    wide = edge + (0.0004 + 0.0011 * long)[:, None] * edge / np.linalg.norm(edge, axis=1)[:, None]
    hidden = _on_ball(edge * [1.03, 1.12], ball - 0.0002) - [0.0, 0.0, 0.0030]
    edge_ring, back = _on_ball(edge, ball + 0.0015), _on_ball(edge * 0.97, ball + 0.0001)
    return np.stack([_on_ball(wide, ball + 0.0018), edge_ring, lash, back, hidden])


def build_head() -> Head:
    """Sculpt the face."""
    eyes = (EYE_HOLE, Hole(EYE_HOLE.top, EYE_HOLE.bottom, -EYE_HOLE.right, -EYE_HOLE.left))
    shell = Shell(len(_rows()), COLUMNS, [MOUTH_HOLE, *eyes])
    mouth = shell.add_rings(shell.loop(MOUTH_HOLE), lip_groups(LIPS))
    throat = shell.close(mouth[-1], "lining")
    groups = ["skin"] * (LID_RINGS - 1) + ["lash", "lash", "lash", "skin"]
    lids = tuple(
        shell.add_rings(shell.loop(hole), groups, np.full(32, side, dtype=bool))
        for side, hole in enumerate(eyes)
    )
    grid = _grid_with_room(shell)
    lips = lip_rings(LIPS, form.skin, mouth.shape[1])
    grid[mouth[SKIN_RINGS:]] = lips
    grid[throat] = lips[-1].mean(0) - [0.0, 0.0, 0.006]
    _interpolate(grid, mouth[: SKIN_RINGS + 1])
    left = _lid_rings(lids[0].shape[1])
    m = left.shape[1]
    swap = (m // 2 - np.arange(m)) % m
    for vertices, rings in ((lids[0], left), (lids[1], left[:, swap] * [-1.0, 1.0, 1.0])):
        grid[vertices[LID_RINGS - 1 :]] = rings
        _interpolate(grid, vertices[:LID_RINGS])
    bottom = [shell.at(len(_rows()) - 1, j) for j in range(COLUMNS)]
    pinned = [mouth[SKIN_RINGS:].ravel(), np.array([throat]), np.array(bottom)]
    pinned += [vertices[LID_RINGS - 1 :].ravel() for vertices in lids]
    skin = shell.all_triangles()
    anchor = np.zeros(shell.count)
    anchor[: max(shell.place.values()) + 1] = 0.08
    mirror = shell.mirror([(mouth, mouth), (lids[0], lids[1])])
    fixed = np.concatenate(pinned)
    points = relax(grid, skin, fixed, form.noseless, 50, anchor, mirror)
    points = _softened(_with_nose(points, fixed), skin, fixed)
    for lid in lids:
        _crease(points, lid)
    points = symmetrised(points, mirror)
    return Head(points, shell, mouth, (lids[0], lids[1]), mirror, throat)


def _grid_with_room(shell: Shell) -> FloatArray:
    """Initial points of the grid; ring vertices, which have no ray, are set by the caller."""
    return project(form.noseless, _grid(shell), 3)


def _softened(points: FloatArray, triangles: IntArray, kept: IntArray) -> FloatArray:
    """Smooth away small folds, except on the nose; kept vertices stay."""
    edges = adjacency(triangles, len(points))
    nose = np.linalg.norm((points - [0.0, -0.0330, 0.0920]) / [1.2, 1.0, 1.0], axis=1)
    share = step(0.012, 0.022, nose)
    share[kept] = 0.0
    # Each step back undoes the shrinking by the step before it, but not the smoothing.
    for factor in (0.5, -0.51) * 7:
        points = points + factor * share[:, None] * (neighbour_mean(points, edges) - points)
    return points


def _crease(points: FloatArray, rings: IntArray) -> None:
    """Press the fold of the upper lid in, in place."""
    m = rings.shape[1]
    depth = np.clip(np.sin(2 * np.pi * np.arange(m) / m), 0.0, 1.0) ** 0.7
    fold = rings[LID_RINGS - 3]
    points[fold] -= (0.0013 * depth)[:, None] * [0.0, 0.25, 1.0]


def _with_nose(points: FloatArray, kept: IntArray) -> FloatArray:
    """Blow the middle of the face up into a nose; kept vertices stay."""
    centre = np.array([0.0, -0.0340, 0.0660])
    inside = form.skin(points) < np.minimum(form.noseless(points), 0.0) - 1e-5
    inside[kept] = False
    covered = np.flatnonzero(inside & (points[:, 2] > 0.05))
    outward = points[covered] - centre
    outward /= np.linalg.norm(outward, axis=1, keepdims=True)
    points = points.copy()
    points[covered] = cast(form.skin, np.tile(centre, (len(covered), 1)), outward, 0.06)
    return points


def _interpolate(points: FloatArray, rings: IntArray) -> None:
    """Spread the rings between the first and the last one, in place."""
    first, last = points[rings[0]], points[rings[-1]]
    for k in range(1, len(rings) - 1):
        points[rings[k]] = first + (last - first) * (k / (len(rings) - 1))
