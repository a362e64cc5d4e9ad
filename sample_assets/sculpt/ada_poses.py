"""The 52 ARKit blendshapes of Ada's face."""

from __future__ import annotations

import numpy as np

from . import ada_form as form
from . import lip_poses as lp
from .ada_head import LID_RINGS, Head
from .ada_jaw import jaw_targets, lips_of, still
from .mesh import FloatArray
from .mouth import INNER, SKIN_RINGS
from .smooth import bump, extend, step

ARKIT = (
    "browDownLeft", "browDownRight", "browInnerUp", "browOuterUpLeft", "browOuterUpRight",
    "cheekPuff", "cheekSquintLeft", "cheekSquintRight", "eyeBlinkLeft", "eyeBlinkRight",
    "eyeLookDownLeft", "eyeLookDownRight", "eyeLookInLeft", "eyeLookInRight", "eyeLookOutLeft",
    "eyeLookOutRight", "eyeLookUpLeft", "eyeLookUpRight", "eyeSquintLeft", "eyeSquintRight",
    "eyeWideLeft", "eyeWideRight", "jawForward", "jawLeft", "jawOpen", "jawRight", "mouthClose",
    "mouthDimpleLeft", "mouthDimpleRight", "mouthFrownLeft", "mouthFrownRight", "mouthFunnel",
    "mouthLeft", "mouthLowerDownLeft", "mouthLowerDownRight", "mouthPressLeft", "mouthPressRight",
    "mouthPucker", "mouthRight", "mouthRollLower", "mouthRollUpper", "mouthShrugLower",
    "mouthShrugUpper", "mouthSmileLeft", "mouthSmileRight", "mouthStretchLeft", "mouthStretchRight",
    "mouthUpperUpLeft", "mouthUpperUpRight", "noseSneerLeft", "noseSneerRight", "tongueOut",
)  # fmt: skip
"""Names of the targets, in the order of the face mesh."""

INF = float("inf")


def left_share(x: FloatArray) -> FloatArray:
    """Share (N,) of a two-sided pose that its left half takes; mirrored it adds up to one."""
    return step(-0.013, 0.013, x)


def halves(name: str, delta: FloatArray, x: FloatArray) -> dict[str, FloatArray]:
    """Split a symmetric pose into its left and right targets."""
    share = left_share(x)[:, None]
    return {f"{name}Left": delta * share, f"{name}Right": delta * (1.0 - share)}


def brow_targets(p: FloatArray) -> dict[str, FloatArray]:
    """Poses of the eyebrows for points (N, 3) of forehead or brows."""
    q = form.folded(p)
    front = step(0.010, 0.045, p[:, 2]) * step(0.006, 0.026, p[:, 1])
    low = (front * bump(q, (0.026, 0.026, 0), (0.026, 0.018, INF)))[:, None]
    inner = (front * bump(q, (0.008, 0.030, 0), (0.017, 0.022, INF)))[:, None]
    outer = (front * bump(q, (0.046, 0.028, 0), (0.018, 0.022, INF)))[:, None]
    inwards = -np.sign(p[:, :1]) * np.clip(np.abs(p[:, :1]) / 0.008, 0, 1)
    down = low * ([0.0, -0.0056, 0.0010] + inwards * [0.0028, 0.0, 0.0])
    return {
        **halves("browDown", down, p[:, 0]),
        "browInnerUp": inner * [0.0, 0.0085, 0.0],
        **halves("browOuterUp", outer * [0.0, 0.0080, -0.0010], p[:, 0]),
    }


def jaw_open(head: Head, follow: FloatArray) -> FloatArray:
    """The opening jaw (V, 3), which also draws the corners of the mouth in a little."""
    p = head.points
    delta = jaw_targets(p, follow)["jawOpen"]
    corner = (form.MOUTH_HALF_WIDTH, form.MOUTH_Y, 0.080)
    near = bump(form.folded(p), corner, (0.016, 0.022, 0.020))
    delta[:, 0] -= 0.0055 * near * np.clip(p[:, 0] / 0.012, -1.0, 1.0)
    return delta


def _lip_handles(head: Head, follow: FloatArray) -> dict[str, FloatArray]:
    """Displacements (R, n, 3) of the lip rings, symmetric poses as a whole."""
    lips = lips_of(head)
    rings = head.mouth[SKIN_RINGS : INNER + 1]
    opened = jaw_open(head, follow)[rings]
    g = lips.opening
    sideways = lp.shift(lips, 0.0115 - 0.002 * np.abs(lips.s), 0.0012 * lips.s, -0.0012 * lips.s)
    return {
        "mouthClose": lp.close_gap(lips, opened, 0.08),
        "mouthFunnel": lp.funnel(lips),
        "mouthPucker": lp.pucker(lips),
        "mouthLeft": sideways,
        "mouthRight": lp.shift(
            lips, -0.0115 + 0.002 * np.abs(lips.s), -0.0012 * lips.s, 0.0012 * lips.s
        ),
        "mouthSmile": lp.corners(lips, 0.0075, 0.0078, -0.0055, 1.7, 0.04)
        + lp.shift(lips, 0.0, 0.0, -0.0012 * g),
        "mouthFrown": lp.corners(lips, 0.0005, -0.0072, -0.0010, 1.9),
        "mouthDimple": lp.corners(lips, 0.0050, 0.0012, -0.0045, 2.2),
        "mouthStretch": lp.corners(lips, 0.0085, -0.0030, -0.0050, 1.5),
        "mouthPress": lp.press(lips),
        "mouthRollUpper": lp.roll_in(lips, 1.0, -0.0012, -0.0030, 22.0),
        "mouthRollLower": lp.roll_in(lips, -1.0, 0.0028, -0.0052, 26.0),
        "mouthShrugUpper": lp.shrug(lips, 0.0022, 0.0010, 0.0022, 1.0),
        "mouthShrugLower": lp.shrug(lips, 0.0030, 0.0030, 0.0026, -1.0),
        "mouthUpperUp": lp.lift(lips, 1.0, 0.0072, 0.0008, -6.0),
        "mouthLowerDown": lp.lift(lips, -1.0, -0.0078, 0.0006, -6.0),
        "noseSneer": lp.lift(lips, 1.0, 0.0016, 0.0, 0.0),
        "cheekPuff": lp.shift(lips, -0.03 * lips.rest[..., 0], 0.0, 0.0012 * g)
        + 0.3 * lp.press(lips),
        "tongueOut": lp.lift(lips, -1.0, -0.0012, 0.0010, 0.0),
    }


def mouth_targets(head: Head, follow: FloatArray) -> dict[str, FloatArray]:
    """Poses led by the lips, continued smoothly over cheeks, chin and lining."""
    handles = _lip_handles(head, follow)
    rings = head.mouth[SKIN_RINGS : INNER + 1]
    quiet = np.concatenate([still(head), head.mouth[-3:].ravel(), [head.throat]])
    under = np.flatnonzero((head.points[:, 1] < -0.108) & (head.points[:, 1] >= -0.15))
    quiet = np.union1d(quiet, under)
    values = np.concatenate([handles[name].reshape(-1, 3) for name in handles], axis=1)
    known = np.concatenate([rings.ravel(), quiet])
    values = np.concatenate([values, np.zeros((len(quiet), values.shape[1]))])
    solved = extend(head.shell.all_triangles(), known, values, len(head.points))
    whole = {name: solved[:, 3 * i : 3 * i + 3] for i, name in enumerate(handles)}
    _add_cheeks(head, whole)
    targets: dict[str, FloatArray] = {}
    for name, delta in whole.items():
        if name in ARKIT:
            targets[name] = delta
        else:
            targets.update(halves(name, delta, head.points[:, 0]))
    return targets


def _add_cheeks(head: Head, whole: dict[str, FloatArray]) -> None:
    """Add what muscles other than those of the lips do, in place."""
    p = head.points
    q = form.folded(p)
    out = np.where(p[:, :1] < 0, -1.0, 1.0)
    skin = np.ones((len(p), 1))
    skin[head.mouth[SKIN_RINGS:].ravel()] = 0.0
    skin[head.throat] = 0.0
    cheek = bump(q, (0.040, -0.030, 0.060), (0.017, 0.014, 0.030))[:, None] * skin
    whole["mouthSmile"] += cheek * np.concatenate([out * 0.0022, skin * 0.0030, skin * 0.0026], 1)
    puff = bump(q, (0.041, -0.062, 0.055), (0.020, 0.020, 0.030))[:, None] * skin
    whole["cheekPuff"] += puff * np.concatenate([out * 0.0105, skin * 0.0, skin * 0.0055], 1)
    wing = bump(q, (0.011, -0.035, 0.092), (0.009, 0.011, 0.014))[:, None] * skin
    root = bump(q, (0.009, -0.012, 0.090), (0.009, 0.012, 0.020))[:, None] * skin
    whole["noseSneer"] += wing * [0.0, 0.0036, -0.0004] + root * [0.0, 0.0016, 0.0008]
    chin = bump(p, (0.0, -0.094, 0.080), (0.022, 0.012, 0.020))[:, None] * skin
    whole["mouthShrugLower"] += chin * [0.0, 0.0024, 0.0010]
    whole["cheekSquint"] = cheek * np.concatenate([out * 0.0006, skin * 0.0060, skin * 0.0034], 1)


def _turn_lids(head: Head, eye: int, upper: float, lower: float, swing: float = 0.0) -> FloatArray:
    """Move the lids of an eye (0 left, 1 right) along the eyeball.

    Args:
        head: The face.
        eye: Which eye.
        upper: How far the upper lid goes down, as a share of the opening; negative opens it.
        lower: How far the lower lid goes up.
        swing: Angle in radians by which both go towards +X.
    """
    rings = head.lids[eye]
    centre = form.EYE * ([1.0, 1.0, 1.0] if eye == 0 else [-1.0, 1.0, 1.0])
    m = rings.shape[1]
    edge = head.points[rings[LID_RINGS]] - centre
    angle = np.arctan2(edge[:, 1], edge[:, 2])
    facing = angle[(m - np.arange(m)) % m]
    part = np.where(np.arange(m) < m / 2, upper, lower)
    turn = (facing - angle) * part
    delta = np.zeros_like(head.points)
    last = len(rings) - 1
    for r in range(1, last + 1):
        share = 0.97 if r == LID_RINGS - 1 else min(1.0, r / (LID_RINGS - 0.6)) ** 1.2
        q = head.points[rings[r]] - centre
        cos, sin = np.cos(turn * share), np.sin(turn * share)
        moved = np.stack([q[:, 0], cos * q[:, 1] + sin * q[:, 2], cos * q[:, 2] - sin * q[:, 1]], 1)
        # Straight paths cut through the ball; start a little further out.
        moved += (
            (np.abs(turn) * share * 0.0011)[:, None]
            * moved
            / np.linalg.norm(moved, axis=1)[:, None]
        )
        moved[:, 0] += swing * share * q[:, 2]
        delta[rings[r]] = moved - q
    return delta


def lid_targets(head: Head) -> dict[str, FloatArray]:
    """Poses of the eyelids."""
    targets = {}
    for eye, side in enumerate(("Left", "Right")):
        outwards = 1.0 if eye == 0 else -1.0
        blink = _turn_lids(head, eye, 0.80, 0.20)
        targets[f"eyeBlink{side}"] = blink
        targets[f"eyeSquint{side}"] = _turn_lids(head, eye, 0.10, 0.30)
        targets[f"eyeWide{side}"] = _turn_lids(head, eye, -0.22, -0.05)
        targets[f"eyeLookDown{side}"] = _turn_lids(head, eye, 0.36, -0.10)
        targets[f"eyeLookUp{side}"] = _turn_lids(head, eye, -0.16, 0.03)
        targets[f"eyeLookOut{side}"] = _turn_lids(head, eye, 0.0, 0.0, 0.05 * outwards)
        targets[f"eyeLookIn{side}"] = _turn_lids(head, eye, 0.0, 0.0, -0.05 * outwards)
    return targets


def face_targets(head: Head, follow: FloatArray) -> dict[str, FloatArray]:
    """All 52 targets of the face, (V, 3) each, in Apple's alphabetical order."""
    p = head.points
    brows = brow_targets(p)
    for delta in brows.values():
        for rings in head.lids:
            for r in range(1, len(rings)):
                delta[rings[r]] *= max(0.0, 1.0 - r / 4.5)
    targets = {**brows, **jaw_targets(p, follow), **mouth_targets(head, follow)}
    targets["jawOpen"] = jaw_open(head, follow)
    targets.update(lid_targets(head))
    return {name: targets[name] for name in ARKIT}
