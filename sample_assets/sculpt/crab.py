"""A crab with poses of its own: none of them has a name that a human face would use."""

from __future__ import annotations

import numpy as np

from . import lip_poses as lp
from .crab_body import MOUTH_HOLE, STALK, Body, build_body, gape_follow, still, turn
from .crab_limbs import SHELL, limbs, stalks
from .mesh import Character, FloatArray, Joint, Material, Mesh, Part, finish
from .mouth import INNER, SKIN_RINGS, lip_landmarks
from .smooth import bump, extend
from .teeth import Arch, tongue, tooth_row

POSES = (
    "MawGape", "ClackShut", "LipRing", "GrinWide", "FangTuck", "TongueFlick", "MandibleOut",
    "EyestalkPerk",
)  # fmt: skip
"""Names of the targets, in the order of the shell mesh."""

BELLY = Material("Belly", (0.86, 0.52, 0.30), 0.55)
LIPS = Material("Lips", (0.42, 0.060, 0.075), 0.38)
LINING = Material("Lining", (0.130, 0.020, 0.035), 0.60)
FANG = Material("Fang", (0.85, 0.80, 0.68), 0.30)
GUM = Material("Gum", (0.36, 0.075, 0.10), 0.45)
TONGUE = Material("Tongue", (0.68, 0.20, 0.24), 0.45)
JOINTS = (
    ("root", -1, (0.0, 0.0, 0.0)),
    ("body", 0, (0.0, 0.080, 0.0)),
    ("clawLeft", 1, (0.100, 0.080, 0.045)),
    ("clawRight", 1, (-0.100, 0.080, 0.045)),
)


def _rigid(count: int, joint: int) -> FloatArray:
    """Weights (count, 4) of vertices that follow one joint."""
    weights = np.zeros((count, len(JOINTS)))
    weights[:, joint] = 1.0
    return weights


def body_targets(body: Body, follow: FloatArray) -> dict[str, FloatArray]:
    """The eight poses of the shell."""
    p = body.points
    lips = body.lips()
    rings = body.mouth[SKIN_RINGS : INNER + 1]
    gape = follow[:, None] * turn(p)
    g = lips.opening
    handles = {
        "ClackShut": lp.close_gap(lips, gape[rings], 0.25),
        "LipRing": lp.pucker(lips) + 0.5 * lp.funnel(lips),
        "GrinWide": lp.corners(lips, 0.0085, 0.0065, -0.0045, 1.5, 0.02),
        "FangTuck": lp.roll_in(lips, -1.0, 0.0026, -0.0060, 26.0)
        + lp.lift(lips, 1.0, 0.0022, 0.0, 0.0),
        "TongueFlick": lp.lift(lips, -1.0, -0.0014, 0.0010, 0.0),
        "MandibleOut": lp.funnel(lips) + lp.shift(lips, 0.0, 0.0, 0.0020 * g),
    }
    quiet = np.concatenate([still(body), body.mouth[-2:].ravel(), [body.throat]])
    quiet = np.unique(np.concatenate([quiet, np.flatnonzero(p[:, 1] < 0.040)]))
    quiet = np.setdiff1d(quiet, rings)
    values = np.concatenate([handles[n].reshape(-1, 3) for n in handles], axis=1)
    values = np.concatenate([values, np.zeros((len(quiet), values.shape[1]))])
    known = np.concatenate([rings.ravel(), quiet])
    solved = extend(body.shell.all_triangles(), known, values, len(p))
    targets = {n: solved[:, 3 * i : 3 * i + 3] for i, n in enumerate(handles)}
    targets["MawGape"] = gape
    side = np.where(p[:, :1] < 0, [-1.0, 1.0, 1.0], [1.0, 1.0, 1.0])
    root = bump(p * side, tuple(STALK), (0.022, 0.025, 0.022))
    targets["EyestalkPerk"] = root[:, None] * [0.0, 0.0060, 0.0]
    return {name: targets[name] for name in POSES}


def _shell_parts(body: Body) -> list[Part]:
    """Shell above, belly below, lips and lining."""
    skin = body.shell.triangles("skin")
    row = np.full(body.shell.count, MOUTH_HOLE.top + 1)
    for (i, _), vertex in body.shell.place.items():
        row[vertex] = i
    row[0] = 0
    below = row[skin].min(1) >= MOUTH_HOLE.top + 1
    return [
        Part(SHELL, skin[~below]),
        Part(LIPS, body.shell.triangles("lips")),
        Part(LINING, body.shell.triangles("lining")),
        Part(BELLY, skin[below]),
    ]


def teeth(body: Body) -> Mesh:
    """A row of fangs above and a ridge below."""
    z = body.lips_z()
    y = body.lips().rest[5, body.mouth.shape[1] // 4, 1]
    upper = Arch((0.0, y + 0.0020, z - 0.0080), 0.0370, 0.040, 6, 1.0, 1.45)
    lower = Arch((0.0, y + 0.0010, z - 0.0145), 0.0340, 0.038, 6, -1.0, 1.30, 0.0040)
    p0, white0, pink0, edge0 = tooth_row(upper, 0.0034)
    p1, white1, pink1, _ = tooth_row(lower, 0.0)
    # The arches bend upwards at the sides as the smiling mouth does.
    points = np.concatenate([p0, p1])
    points[:, 1] += 0.0100 * (points[:, 0] / 0.046) ** 2
    lower_row = np.concatenate([np.zeros(len(p0)), np.ones(len(p1))])[:, None]
    parts = [
        Part(FANG, np.concatenate([white0, white1 + len(p0)])),
        Part(GUM, np.concatenate([pink0, pink1 + len(p0)])),
    ]
    targets = {"MandibleOut": lower_row * [0.0, 0.0, 0.004], "MawGape": lower_row * turn(points)}
    # The lower teeth make room for the lip that is tucked in.
    targets["FangTuck"] = lower_row * [0.0, -0.0040, -0.0090]
    landmarks = {"teethUpperEdge": [int(v) for v in edge0[8:17]]}
    return Mesh("Teeth", points, parts, _rigid(len(points), 1), targets, landmarks)


def tongue_mesh(body: Body) -> Mesh:
    """A broad tongue."""
    z = body.lips_z()
    y = float(body.lips().rest[5, body.mouth.shape[1] // 4, 1])
    t = np.linspace(0.0, 1.0, 10)
    path = np.stack([0 * t, y - 0.030 + 0.014 * t**0.8, z - 0.085 + 0.064 * t], axis=1)
    wide = 0.024 * np.clip(1.02 - t**4, 0.05, 1.0) ** 0.5
    radii = np.stack([wide, 0.0085 * np.clip(1.03 - t**3, 0.06, 1.0) ** 0.5], axis=1)
    points, triangles, place = tongue(path, radii, 10)
    along = (place**1.3)[:, None]
    flick = along * [0.0, 0.0225, 0.0640]
    return Mesh("Tongue", points, [Part(TONGUE, triangles)], _rigid(len(points), 1),
                {"TongueFlick": flick, "MawGape": turn(points)})  # fmt: skip


def build_crab() -> Character:
    """Sculpt the whole crab."""
    body = build_body()
    follow = gape_follow(body)
    count = len(body.points)
    landmarks = lip_landmarks(body.mouth)
    shell = Mesh("Shell", body.points, _shell_parts(body), _rigid(count, 1),
                 body_targets(body, follow), landmarks)  # fmt: skip
    meshes = [shell, stalks(_rigid), teeth(body), tongue_mesh(body), limbs(_rigid)]
    joints = [Joint(name, parent, position) for name, parent, position in JOINTS]
    return finish(Character("Crab", meshes, joints), (0.0, 0.0, 0.0))
