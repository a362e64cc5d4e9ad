"""The crab's shell with its mouth.

Design space: metres, origin on the ground below the middle of the shell, facing +Z.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from .field import cast, ellipsoid, sphere, union
from .lip_poses import Lips
from .mesh import FloatArray, IntArray
from .mouth import CONTACT, INNER, SKIN_RINGS, LipForm, lip_groups, lip_rings
from .shell import Hole, Shell, relax, symmetrised
from .smooth import extend

COLUMNS = 44
PITCHES = (
    80, 64, 50, 38, 28, 19, 13, 7, 1, -5, -11, -17, -23, -29, -38, -50, -64, -79,
)  # fmt: skip
"""Pitch of the rays of each row of the grid, in degrees."""
MOUTH_HOLE = Hole(5, 13, -7, 7)
CENTRE = np.array([0.0, 0.092, 0.0])
MOUTH_Y = 0.0790
STALK = np.array([0.0370, 0.136, 0.040])
"""Foot of the left eyestalk."""
HINGE = np.array([0.0, 0.085, -0.030])
"""A point on the line, along X, about which the lower mouth turns."""
GAPE = np.radians(17.0)
SCALE = 1.75
"""Size of the mouth relative to a human one."""
LIPS = LipForm(
    y=MOUTH_Y,
    half_width=0.0460,
    upper=0.0090,
    lower=0.0115,
    fullness=(0.0052, 0.0060),
    smile=0.0120,
    bow=0.0,
    depth=0.0055,
    lining=(
        (0.0465, 0.0180, 0.0190, 0.0085),
        (0.0500, 0.0240, 0.0230, 0.0240),
        (0.0470, 0.0220, 0.0210, 0.0540),
    ),
)


def shell_field(p: FloatArray) -> FloatArray:
    """Field of the shell."""
    q = p * np.where(p[:, :1] < 0, [-1.0, 1.0, 1.0], [1.0, 1.0, 1.0])
    d = ellipsoid(q, (0, 0.086, 0.0), (0.100, 0.056, 0.080))
    rim = ellipsoid(q, (0, 0.103, -0.008), (0.124, 0.030, 0.090))
    d = union(d, rim, 0.020)
    d = union(d, sphere(q, STALK - [0.0, 0.012, 0.002], 0.0185), 0.020)
    for x, z in ((0.0, -0.030), (0.040, -0.018), (0.066, 0.012), (0.030, -0.062), (0.072, -0.045)):
        y = 0.136 - 2.6 * (x * x + z * z)
        d = union(d, ellipsoid(q, (x, y, z), (0.012, 0.008, 0.012)), 0.010)
    return d


@dataclass(frozen=True)
class Body:
    """The shell with the meaning of its vertices, as for Ada's head."""

    points: FloatArray
    shell: Shell
    mouth: IntArray
    mirror: IntArray
    throat: int

    def lips(self) -> Lips:
        """The lip rings."""
        return Lips(self.points[self.mouth[SKIN_RINGS : INNER + 1]], SCALE)

    def lips_z(self) -> float:
        """Depth of the contact line in the middle."""
        return float(self.points[self.mouth[CONTACT, self.mouth.shape[1] // 4], 2])


def build_body() -> Body:
    """Sculpt the shell."""
    shell = Shell(len(PITCHES), COLUMNS, [MOUTH_HOLE])
    mouth = shell.add_rings(shell.loop(MOUTH_HOLE), lip_groups(LIPS))
    throat = shell.close(mouth[-1], "lining")
    bottom = [shell.at(len(PITCHES) - 1, j) for j in range(COLUMNS)]
    belly = shell.close(np.array(bottom[::-1]), "skin")
    points = _grid(shell)
    lips = lip_rings(LIPS, shell_field, mouth.shape[1])
    points[mouth[SKIN_RINGS:]] = lips
    points[throat] = lips[-1].mean(0) - [0.0, 0.0, 0.010]
    points[belly] = points[bottom].mean(0)
    for k in range(1, SKIN_RINGS):
        share = k / SKIN_RINGS
        points[mouth[k]] = (1 - share) * points[mouth[0]] + share * points[mouth[SKIN_RINGS]]
    mirror = shell.mirror([(mouth, mouth)])
    anchor = np.zeros(shell.count)
    anchor[: max(shell.place.values()) + 1] = 0.10
    pinned = np.concatenate([mouth[SKIN_RINGS:].ravel(), [throat]])
    triangles = shell.all_triangles()
    points = relax(points, triangles, pinned, shell_field, 40, anchor, mirror)
    return Body(symmetrised(points, mirror), shell, mouth, mirror, throat)


def _grid(shell: Shell) -> FloatArray:
    """Initial points: where rays from the middle meet the shell."""
    half = np.arange(COLUMNS // 2 + 1) / (COLUMNS // 2)
    turn = np.pi * (0.66 * half + 0.34 * half**2.4)
    theta = np.concatenate([turn, -turn[-2:0:-1]])
    direction = np.tile([0.0, 1.0, 0.0], (shell.count, 1))
    for (i, j), vertex in shell.place.items():
        # Rows sink towards the sides and the back, so that one of them follows the rim.
        pitch = np.radians(PITCHES[i])
        pitch -= np.radians(15.0) * np.cos(pitch) * (1.0 - np.cos(min(abs(theta[j]), 1.7)))
        flat = np.cos(pitch)
        direction[vertex] = (np.sin(theta[j]) * flat, np.sin(pitch), np.cos(theta[j]) * flat)
    return cast(shell_field, np.tile(CENTRE, (shell.count, 1)), direction, 0.25)


def still(body: Body) -> IntArray:
    """Vertices that no pose of the mouth moves."""
    p = body.points
    mask = (p[:, 1] > 0.122) | (p[:, 2] < 0.012) | (p[:, 1] < 0.0315)
    mask[body.mouth[SKIN_RINGS:].ravel()] = False
    return np.flatnonzero(mask)


def gape_follow(body: Body) -> FloatArray:
    """How much each vertex (V,) goes with the lower mouth, from 0 to 1."""
    lips = body.lips()
    p = body.points
    rings = body.mouth[SKIN_RINGS : INNER + 1]
    lining = body.mouth[INNER + 1 :]
    around = 0.5 - 0.5 * np.sin(2 * np.pi * np.arange(lining.shape[1]) / lining.shape[1])
    chin = (p[:, 1] < 0.056) & (p[:, 1] > 0.046) & (p[:, 2] > 0.045) & (np.abs(p[:, 0]) < 0.03)
    chin[body.mouth[SKIN_RINGS:].ravel()] = False
    quiet = still(body)
    known = np.concatenate([rings.ravel(), np.flatnonzero(chin), lining.ravel(), [body.throat],
                            quiet])  # fmt: skip
    values = np.concatenate([np.tile(0.5 - 0.5 * lips.side * lips.opening, len(rings)),
                             np.full(int(chin.sum()), 0.85), np.tile(around, len(lining)), [0.5],
                             np.zeros(len(quiet))])  # fmt: skip
    follow = extend(body.shell.all_triangles(), known, values[:, None], len(p))[:, 0]
    return np.asarray(np.clip(follow, 0.0, 1.0))


def turn(p: FloatArray) -> FloatArray:
    """Displacements (N, 3) of points that turn rigidly with the lower mouth."""
    q = p - HINGE
    cos, sin = np.cos(GAPE), np.sin(GAPE)
    moved = q.copy()
    moved[:, 1] = cos * q[:, 1] - sin * q[:, 2]
    moved[:, 2] = sin * q[:, 1] + cos * q[:, 2]
    return np.asarray(moved - q)
