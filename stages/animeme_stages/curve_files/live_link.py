"""The CSV of Epic's Live Link Face app.

One row per frame: a time code, the number of columns that follow, ARKit's 52 shapes in CamelCase,
and nine angles of head and eyes. Order and names as the app's own takes have them.
"""

from __future__ import annotations

import numpy as np

from animeme.curves import CurveSet
from animeme.rig import BoundRig
from animeme.timing import RATES, FrameRate

APP_RATE = RATES["60"]
"""The rate of a take, if nobody says another."""

SHAPES: tuple[str, ...] = (
    "EyeBlinkLeft", "EyeLookDownLeft", "EyeLookInLeft", "EyeLookOutLeft", "EyeLookUpLeft",
    "EyeSquintLeft", "EyeWideLeft",
    "EyeBlinkRight", "EyeLookDownRight", "EyeLookInRight", "EyeLookOutRight", "EyeLookUpRight",
    "EyeSquintRight", "EyeWideRight",
    "JawForward", "JawRight", "JawLeft", "JawOpen",
    "MouthClose", "MouthFunnel", "MouthPucker", "MouthRight", "MouthLeft",
    "MouthSmileLeft", "MouthSmileRight", "MouthFrownLeft", "MouthFrownRight",
    "MouthDimpleLeft", "MouthDimpleRight", "MouthStretchLeft", "MouthStretchRight",
    "MouthRollLower", "MouthRollUpper", "MouthShrugLower", "MouthShrugUpper",
    "MouthPressLeft", "MouthPressRight", "MouthLowerDownLeft", "MouthLowerDownRight",
    "MouthUpperUpLeft", "MouthUpperUpRight",
    "BrowDownLeft", "BrowDownRight", "BrowInnerUp", "BrowOuterUpLeft", "BrowOuterUpRight",
    "CheekPuff", "CheekSquintLeft", "CheekSquintRight", "NoseSneerLeft", "NoseSneerRight",
    "TongueOut",
)  # fmt: skip
ANGLES: tuple[str, ...] = (
    "HeadYaw", "HeadPitch", "HeadRoll",
    "LeftEyeYaw", "LeftEyePitch", "LeftEyeRoll",
    "RightEyeYaw", "RightEyePitch", "RightEyeRoll",
)  # fmt: skip
COLUMNS = SHAPES + ANGLES


def arkit_name(column: str) -> str:
    """ARKit's name for a column: ``jawOpen`` for ``JawOpen``."""
    return column[:1].lower() + column[1:]


def columns_of(curves: CurveSet, rig: BoundRig | None) -> dict[str, str]:
    """Column of each curve that has one: by its own name, or by what its rig's profile calls it."""
    known = {arkit_name(column): column for column in SHAPES}
    named = {own: known[shape] for shape, own in (rig.mapped if rig else {}).items()
             if shape in known}  # fmt: skip
    return {
        name: named.get(name, known.get(name, ""))
        for name in curves.names
        if name in named or name in known
    }


def rows(curves: CurveSet, columns: dict[str, str], rate: FrameRate) -> list[list[str]]:
    """Header and frames of a take that starts at 00:00:00:00."""
    times_s = rate.times_s(curves.duration_s)
    sampled = curves.sample(times_s)
    place = {column: curves.names.index(name) for name, column in columns.items()}
    table = [["Timecode", "BlendShapeCount", *COLUMNS]]
    for frame, weights in enumerate(sampled):
        cells = [number(weights[place[c]]) if c in place else "0" for c in COLUMNS]
        table.append([f"{rate.label(frame)}.000", str(len(COLUMNS)), *cells])
    return table


def number(value: float) -> str:
    """Shortest text that float32 reads back; nobody plays more."""
    return f"{np.float32(value):.9g}"
