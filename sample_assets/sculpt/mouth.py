"""A mouth: lips in rings around the contact line, and the lining behind them.

Columns run around the mouth, from the left corner (+X) over the upper lip to the right corner
and back along the lower lip; column k of the upper lip faces column ``n - k`` of the lower lip.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from .field import Field, cast
from .mesh import FloatArray, IntArray

SKIN_RINGS = 4
"""Rings of skin around the lips, the first of which is the border of the hole in the grid."""
PROFILE = (0.0, 0.22, 0.46, 0.70, 0.88, 1.0)
"""Places of the rings of the red of the lip, from its border to the contact line."""
CONTACT = SKIN_RINGS + len(PROFILE) - 1
"""Ring on which the lips start to touch; they still do on the next one, behind it."""
INNER = CONTACT + 2
"""Ring on the inside of the lips, where they have parted."""


@dataclass(frozen=True)
class LipForm:
    """Shape of a mouth (metres).

    Attributes:
        y: Height of the contact line in the middle.
        half_width: From the middle to a corner.
        upper: Height of the red of the upper lip in the middle.
        lower: Height of the red of the lower lip in the middle.
        fullness: How far the lips stand out from the skin (upper, lower).
        smile: How far the corners lie above the middle.
        bow: Depth of the cupid's bow.
        depth: Thickness of the contact between the lips, front to back.
        lining: Rings of the lining: half-width, height above and below the middle, and depth
            behind the contact line in the middle.
    """

    y: float
    half_width: float
    upper: float
    lower: float
    fullness: tuple[float, float]
    smile: float
    bow: float
    depth: float
    lining: tuple[tuple[float, float, float, float], ...]


def lip_groups(form: LipForm) -> list[str]:
    """Names of the groups of the rings inside a hole, for `Shell.add_rings`."""
    lips = ["lips"] * (len(PROFILE) - 1 + 1)
    return ["skin"] * SKIN_RINGS + lips + ["lining"] * (1 + len(form.lining))


def spread(n: int) -> tuple[FloatArray, FloatArray]:
    """Place s (n,) of each column from 1 (left) to -1, and its lip: 1 upper, -1 lower, 0 both."""
    angle = 2 * np.pi * np.arange(n) / n
    s = np.round(np.cos(angle), 12)
    # Half way to even spacing, else the columns crowd at the corners.
    even = 1.0 - 4.0 * np.minimum(np.arange(n), n - np.arange(n)) / n
    side = np.where(np.arange(n) < n / 2, 1.0, -1.0)
    side[[0, n // 2]] = 0.0
    return 0.55 * s + 0.45 * even, side


def lip_rings(form: LipForm, field: Field, n: int) -> FloatArray:
    """Positions (R, n, 3) of the lip rings from the border of the red to the last lining ring."""
    s, side = spread(n)
    room = np.clip(1.0 - s * s, 0.0, 1.0)
    contact = np.zeros((n, 3))
    contact[:, 0] = s * form.half_width
    contact[:, 1] = form.y + form.smile * s**2 - 0.10 * form.bow * np.exp(-((s / 0.2) ** 2))
    border = contact.copy()
    border[:, 0] = s * (form.half_width + 0.0016)
    peak = np.exp(-(((np.abs(s) - 0.22) / 0.20) ** 2)) - 0.25 * np.exp(-((s / 0.11) ** 2))
    upper = form.upper * room**0.85 + form.bow * peak * room
    lower = form.lower * room**0.62
    border[:, 1] += np.where(side > 0, upper, 0.0) - np.where(side < 0, lower, 0.0)
    contact[:, 2] = _front(field, contact) - 0.0006
    border[:, 2] = _front(field, border)
    rings = [_red(form, contact, border, room, side, t) for t in PROFILE]
    back = contact - np.array([0.0, 0.0, form.depth])
    inner = back + np.stack([-0.02 * back[:, 0], side * 0.0030 * room, 0.0 * s - 0.0012], axis=1)
    return np.stack([*rings, back, inner, *_lining(form, contact, s, side)])


def _front(field: Field, places: FloatArray) -> FloatArray:
    """Height z (N,) of the skin in front of some places."""
    origin = places * [1.0, 1.0, 0.0]
    hit = cast(field, origin, np.tile([0.0, 0.0, 1.0], (len(places), 1)), 0.16)
    return np.asarray(hit[:, 2])


def _red(
    form: LipForm,
    contact: FloatArray,
    border: FloatArray,
    room: FloatArray,
    side: FloatArray,
    t: float,
) -> FloatArray:
    """Ring of the red at place t of the profile, 0 the border and 1 the contact line."""
    full = np.where(side > 0, form.fullness[0], form.fullness[1]) * room**0.6
    ring = border + (contact - border) * (0.25 * t + 0.75 * t**1.35)
    # The same for both lips at the end, for there they touch.
    both = 0.5 * (form.fullness[0] + form.fullness[1]) * room**0.6
    ring[:, 2] += full * np.sin(np.pi * t**0.85) ** 0.9 + both * 0.25 * t
    return np.asarray(ring)


def _lining(
    form: LipForm, contact: FloatArray, s: FloatArray, side: FloatArray
) -> list[FloatArray]:
    """Rings of the bag behind the lips; it encloses teeth and tongue."""
    height = np.sqrt(np.clip(1.0 - s * s, 0.0, 1.0))
    middle = contact[np.argmin(np.abs(s) + np.where(side > 0, 0, 1)), 2]
    rings = []
    for width, above, below, depth in form.lining:
        ring = np.empty_like(contact)
        ring[:, 0] = s * width
        ring[:, 1] = form.y + np.where(side > 0, above, -below) * height
        # The front of the bag follows the curve of the lips, its bottom is straight.
        curve = (contact[:, 2] - middle) * max(0.0, 1.0 - depth / 0.03)
        ring[:, 2] = middle - depth + curve
        rings.append(ring)
    return rings


def lip_landmarks(rings: IntArray) -> dict[str, list[int]]:
    """Paired vertices across the mouth and the corners, from the rings (R, n) of a mouth."""
    n = rings.shape[1]
    # Every second column, the middle one among them, and not those next to the corners.
    columns = range(2 + n // 4 % 2, n // 2 - 1, 2)
    return {
        "lipUpperInner": [int(rings[CONTACT, k]) for k in columns],
        "lipLowerInner": [int(rings[CONTACT, n - k]) for k in columns],
        "lipCornerLeft": [int(rings[CONTACT, 0])],
        "lipCornerRight": [int(rings[CONTACT, n // 2])],
    }
