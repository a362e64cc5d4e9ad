"""Ada's eyes, teeth, tongue, brows, ears, hair and collar."""

from __future__ import annotations

import numpy as np

from . import ada_form as form
from .ada_jaw import jaw_targets
from .ada_poses import brow_targets
from .field import cast, gradient
from .loft import ball, fan, outward, ring_angles, sheet, tube
from .mesh import FloatArray, IntArray, Material, Mesh, Part
from .smooth import step
from .teeth import Arch, tongue, tooth_row

WHITE = Material("Sclera", (0.80, 0.79, 0.77), 0.22)
IRIS = Material("Iris", (0.045, 0.150, 0.175), 0.18)
LIMBUS = Material("Limbus", (0.012, 0.035, 0.045), 0.20)
PUPIL = Material("Pupil", (0.004, 0.004, 0.005), 0.12)
ENAMEL = Material("Enamel", (0.92, 0.88, 0.80), 0.30)
GUM = Material("Gum", (0.42, 0.13, 0.12), 0.45)
TONGUE = Material("Tongue", (0.66, 0.19, 0.20), 0.45)
HAIR = Material("Hair", (0.075, 0.028, 0.016), 0.45)
KNIT = Material("Knit", (0.030, 0.150, 0.170), 0.85)

SKULL = np.array([0.0, 0.032, -0.010])
"""Middle of the skull, from which the hair is laid out."""
HAIR_POLE = np.array([0.0, 0.722, -0.692])
"""Direction of the bun, from the middle of the skull."""
HAIR_AHEAD = np.array([0.0, 0.692, 0.722])
HAIR_SIDE = np.array([1.0, 0.0, 0.0])
HAIRLINE = (
    (0, 20, 40, 56, 68, 82, 98, 120, 150, 180),
    (0.077, 0.0765, 0.069, 0.050, 0.022, 0.004, 0.010, -0.020, -0.048, -0.052),
)
"""Height of the hairline over the angle around the head (degrees from the front)."""

_POLAR = np.array([0.11, 0.205, 0.31, 0.435, 0.505, 0.60, 0.75, 1.0, 1.35, 1.9, 2.5])
_SEGMENTS = 18


def rigid(count: int, joint: int) -> FloatArray:
    """Weights (count, 4) of vertices that follow one joint."""
    weights = np.zeros((count, 4))
    weights[:, joint] = 1.0
    return weights


def eyes() -> Mesh:
    """Both eyeballs; the look targets turn them about their centres."""
    unit, triangles = ball(_POLAR, _SEGMENTS)
    n = _SEGMENTS
    cut = {
        PUPIL: triangles[: 3 * n],
        IRIS: triangles[3 * n : 7 * n],
        LIMBUS: triangles[7 * n : 9 * n],
        WHITE: triangles[9 * n :],
    }
    turned = np.radians(2.0)
    points, targets = [], {}
    for eye, side in enumerate((1.0, -1.0)):
        q = _turned(unit, side * turned, 0.0) * form.EYE_RADIUS
        points.append(q + form.EYE * [side, 1.0, 1.0])
        name = "Left" if eye == 0 else "Right"
        for look, (yaw, pitch) in {
            "Up": (0.0, 0.42), "Down": (0.0, -0.42),
            "In": (-side * 0.52, 0.0), "Out": (side * 0.52, 0.0),
        }.items():  # fmt: skip
            delta = np.zeros((2, len(unit), 3))
            delta[eye] = _turned(q, yaw, pitch) - q
            targets[f"eyeLook{look}{name}"] = delta.reshape(-1, 3)
    parts = [Part(m, np.concatenate([t, t + len(unit)])) for m, t in cut.items()]
    count = 2 * len(unit)
    ordered = {name: targets[name] for name in sorted(targets, reverse=True)}
    return Mesh("Eyes", np.concatenate(points), parts, rigid(count, 2), ordered)


def _turned(q: FloatArray, yaw: float, pitch: float) -> FloatArray:
    """Points turned by yaw towards +X, then by pitch upwards (radians)."""
    c, s = np.cos(yaw), np.sin(yaw)
    q = np.stack([c * q[:, 0] + s * q[:, 2], q[:, 1], c * q[:, 2] - s * q[:, 0]], axis=1)
    c, s = np.cos(pitch), np.sin(pitch)
    return np.stack([q[:, 0], c * q[:, 1] + s * q[:, 2], c * q[:, 2] - s * q[:, 1]], axis=1)


def teeth(lips_z: float) -> Mesh:
    """Both rows of teeth; ``lips_z`` is the depth of the contact line of the lips."""
    upper = Arch((0.0, form.MOUTH_Y - 0.0018, lips_z - 0.0052), 0.0215, 0.030, 8, 1.0)
    lower = Arch((0.0, form.MOUTH_Y + 0.0004, lips_z - 0.0080), 0.0195, 0.028, 8, -1.0, 1.0, 0.0042)
    p0, white0, pink0, edge0 = tooth_row(upper)
    p1, white1, pink1, edge1 = tooth_row(lower)
    shift = len(p0)
    points = np.concatenate([p0, p1])
    follow = np.concatenate([np.zeros(shift), np.ones(len(p1))])
    parts = [
        Part(ENAMEL, np.concatenate([white0, white1 + shift])),
        Part(GUM, np.concatenate([pink0, pink1 + shift])),
    ]
    weights = np.concatenate([rigid(shift, 2), rigid(len(p1), 3)])
    incisors = slice(len(edge0) // 2 - 6, len(edge0) // 2 + 7)
    landmarks = {
        "teethUpperEdge": [int(v) for v in edge0[incisors]],
        "teethLowerEdge": [int(v) + shift for v in edge1[incisors]],
    }
    jaw = jaw_targets(points, follow)
    ordered = {name: jaw[name] for name in ("jawOpen", "jawRight", "jawLeft", "jawForward")}
    return Mesh("Teeth", points, parts, weights, ordered, landmarks)


def tongue_mesh(lips_z: float) -> Mesh:
    """The tongue, which lies behind the lower teeth."""
    t = np.linspace(0.0, 1.0, 11)
    path = np.stack(
        [0 * t, form.MOUTH_Y - 0.0150 + 0.0095 * t**0.8, lips_z - 0.052 + 0.0385 * t], axis=1
    )
    wide = 0.0145 * np.clip(1.02 - t**4.0, 0.05, 1.0) ** 0.5
    radii = np.stack([wide, 0.0070 * np.clip(1.03 - t**3.0, 0.06, 1.0) ** 0.5], axis=1)
    points, triangles, place = tongue(path, radii, 12)
    jaw = jaw_targets(points, np.ones(len(points)))
    along = (place**1.3)[:, None]
    thin = (points[:, 1:2] - np.interp(place, t, path[:, 1])[:, None]) * [0.0, -0.40, 0.0]
    out = along * [0.0, 0.0150, 0.0420] + along * thin
    order = ("tongueOut", "jawForward", "jawLeft", "jawRight", "jawOpen")
    targets = {name: {**jaw, "tongueOut": out}[name] for name in order}
    return Mesh("Tongue", points, [Part(TONGUE, triangles)], rigid(len(points), 3), targets)


def brows() -> Mesh:
    """Two tapered eyebrows that lie on the skin."""
    t = np.linspace(0.0, 1.0, 11)
    x = 0.0140 + 0.0385 * t
    y = 0.0270 + 0.0075 * np.sin(np.pi * (0.12 + 0.72 * t)) - 0.0030 * t
    origin = np.stack([x, y, 0 * x], axis=1)
    path = cast(form.skin, origin, np.tile([0.0, 0.0, 1.0], (len(t), 1)), 0.16)
    half = 0.0034 * np.clip(np.sin(np.pi * (0.07 + 0.91 * t)), 0.08, 1) ** 0.55 * (1.1 - 0.5 * t)
    normal = gradient(form.skin, path)
    path = path + 0.0006 * normal
    radii = np.stack([0.0019 + 0 * t, half], axis=1)
    points, triangles = tube(path, radii, 6, np.array([0, 1.0, 0]))
    triangles = outward(points - points.mean(0), triangles)
    both = np.concatenate([points, points * [-1.0, 1.0, 1.0]])
    faces = np.concatenate([triangles, triangles[:, ::-1] + len(points)])
    targets = brow_targets(both)
    ordered = {name: targets[name] for name in sorted(targets, key=lambda n: (n[::-1], n))}
    return Mesh("Brows", both, [Part(HAIR, faces)], rigid(len(both), 2), ordered)


def ears() -> tuple[FloatArray, IntArray]:
    """Points (V, 3) and triangles of both ears, to be added to the skin."""
    n = 14
    angle = ring_angles(n)
    forward, up = np.cos(angle), np.sin(angle)
    outline_x = 0.0150 * forward * (1.0 + 0.22 * up)
    outline_y = 0.0270 * up * (1.0 + 0.05 * forward)
    rings = ((0.45, -0.012), (0.86, 0.000), (1.0, 0.0060), (1.0, 0.0092), (0.90, 0.0108),
             (0.78, 0.0085), (0.66, 0.0046), (0.50, 0.0040), (0.30, 0.0010))  # fmt: skip
    out = np.array([0.88, 0.02, 0.47])
    out /= np.linalg.norm(out)
    ahead = np.cross([0.0, 1.0, 0.0], out)
    ahead = -ahead / np.linalg.norm(ahead)
    upward = np.cross(out, ahead) * -1.0
    upward = upward * np.sign(upward[1]) + 0.16 * -ahead
    centre = np.array([0.0705, -0.010, -0.012])
    points = [
        centre + s * (outline_x[:, None] * ahead + outline_y[:, None] * upward) + h * out
        for s, h in rings
    ]
    flat = np.concatenate([*points, [centre - 0.0005 * out]])
    k = len(rings)
    triangles = np.concatenate(
        [sheet(k, n, wrap=True), fan(np.arange((k - 1) * n, k * n), k * n, flip=True)]
    )
    triangles = outward(flat - flat.mean(0), triangles)
    both = np.concatenate([flat, flat * [-1.0, 1.0, 1.0]])
    return both, np.concatenate([triangles, triangles[:, ::-1] + len(flat)])


def hair() -> Mesh:
    """Hair drawn back into a bun."""
    cap, triangles = _hair_cap(52, 11)
    unit, bun = ball(np.linspace(0.25, 2.9, 8), 20)
    swirl = 1.0 + 0.035 * np.cos(5 * np.arctan2(unit[:, 1], unit[:, 0]) + 5.0 * unit[:, 2])
    frame = np.stack([HAIR_SIDE, np.cross(HAIR_POLE, HAIR_SIDE), HAIR_POLE])
    points = (unit * swirl[:, None] * [0.038, 0.038, 0.031]) @ frame
    bun = outward(points, bun)
    points = points + SKULL + 0.113 * HAIR_POLE
    both = np.concatenate([cap, points])
    faces = np.concatenate([triangles, bun + len(cap)])
    return Mesh("Hair", both, [Part(HAIR, faces)], rigid(len(both), 2))


def _hair_direction(around: FloatArray, phi: FloatArray) -> FloatArray:
    """Unit vectors from the middle of the skull, at angles phi from the bun."""
    across = np.sin(around)[:, None] * HAIR_SIDE + np.cos(around)[:, None] * HAIR_AHEAD
    return np.asarray(np.cos(phi)[:, None] * HAIR_POLE + np.sin(phi)[:, None] * across)


def _on_skull(direction: FloatArray) -> FloatArray:
    """Where rays from the middle of the skull leave it."""
    return cast(form.noseless, np.tile(SKULL, (len(direction), 1)), direction, 0.2)


def _hairline(around: FloatArray) -> FloatArray:
    """Angle from the bun at which the hair ends, for each direction around it."""
    end = np.full(len(around), 2.6)
    for phi in np.linspace(2.6, 0.3, 231):
        hit = _on_skull(_hair_direction(around, np.full(len(around), phi)))
        azimuth = np.degrees(np.arctan2(np.abs(hit[:, 0]), hit[:, 2]))
        end = np.where(hit[:, 1] < np.interp(azimuth, *HAIRLINE), phi, end)
    for _ in range(2):
        end = (np.roll(end, 1) + 2 * end + np.roll(end, -1)) / 4
    return end


def _hair_cap(columns: int, rows: int) -> tuple[FloatArray, IntArray]:
    """Strands from the bun to the hairline: points (V, 3) and triangles."""
    around = ring_angles(columns)
    end = _hairline(around)
    points = []
    for share in np.linspace(0.0, 1.0, rows - 1):
        direction = _hair_direction(around, end * (0.10 + 0.90 * share))
        strand = 0.0011 * np.cos(around * columns / 4) * np.sin(np.pi * share) ** 0.5
        thick = 0.0016 + 0.0090 * (1.0 - share**4) + strand
        points.append(_on_skull(direction) + thick[:, None] * direction)
    # The last row turns the edge inwards, under the skin.
    direction = _hair_direction(around, end + 0.012)
    points.append(_on_skull(direction) - 0.002 * direction)
    cap = np.concatenate(points)
    triangles = sheet(rows, columns, wrap=True)
    return cap, triangles if _faces_out(cap, triangles, SKULL) else triangles[:, ::-1]


def _faces_out(p: FloatArray, triangles: IntArray, centre: FloatArray) -> bool:
    """Whether most triangles face away from a centre."""
    a, b, c = (p[triangles[:, k]] for k in range(3))
    return bool((np.cross(b - a, c - a) * (a - centre)).sum() > 0)


def collar() -> Mesh:
    """A roll-neck with shoulders, cut off flat at the ground."""
    n = 28
    profile = np.array([
        (-0.172, 0.0405, 0.040), (-0.1635, 0.0420, 0.0415), (-0.1610, 0.0455, 0.0450),
        (-0.1660, 0.0490, 0.0485), (-0.1780, 0.0500, 0.0490), (-0.1845, 0.0510, 0.0490),
        (-0.1880, 0.0580, 0.0520), (-0.1960, 0.0850, 0.0590), (-0.2080, 0.1150, 0.0660),
        (-0.2230, 0.1350, 0.0730), (-0.2390, 0.1440, 0.0780), (-0.2400, 0.1400, 0.0750),
    ])  # fmt: skip
    a = ring_angles(n)
    rings = [
        np.stack([rx * np.sin(a), np.full(n, y), -0.032 + rz * np.cos(a)], axis=1)
        for y, rx, rz in profile
    ]
    points = np.concatenate([*rings, [[0.0, -0.240, -0.032]]])
    k = len(profile)
    triangles = np.concatenate(
        [sheet(k, n, wrap=True), fan(np.arange((k - 1) * n, k * n), k * n, flip=True)]
    )
    weights = rigid(len(points), 0)
    neck = step(-0.190, -0.165, points[:, 1])[:, None]
    weights = weights * (1 - 0.8 * neck) + rigid(len(points), 1) * 0.8 * neck
    return Mesh("Collar", points, [Part(KNIT, triangles)], weights)
