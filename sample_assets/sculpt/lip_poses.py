"""Displacements of lips for poses, as functions of the place along the mouth and on the lip.

All take a `Lips` and return displacements (R, n, 3) of its rings, which run from the border of
the red (ring 0) over the contact line to the inside. Poses that keep lips closed move the two
contact lines alike.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from .mesh import FloatArray
from .mouth import PROFILE, spread


@dataclass(frozen=True)
class Lips:
    """Rest positions (R, n, 3) of lip rings; ``scale`` is the size relative to a human mouth."""

    rest: FloatArray
    scale: float

    @property
    def s(self) -> FloatArray:
        """Place (n,) of the columns from 1, left, to -1."""
        return spread(self.rest.shape[1])[0]

    @property
    def side(self) -> FloatArray:
        """Lip (n,) of the columns: 1 upper, -1 lower, 0 corner."""
        return spread(self.rest.shape[1])[1]

    @property
    def opening(self) -> FloatArray:
        """Height (n,) of an oval opening: 1 in the middle, 0 at the corners."""
        return np.asarray(np.clip(1.0 - self.s**2, 0.0, 1.0) ** 0.72)

    def outer(self) -> FloatArray:
        """Weight (R, 1) of the rings: 1 at the border of the red, 0 from the contact line on."""
        t = np.ones(len(self.rest))
        t[: len(PROFILE)] = PROFILE
        return np.asarray((1.0 - t)[:, None])


def shift(
    lips: Lips, x: FloatArray | float, y: FloatArray | float, z: FloatArray | float
) -> FloatArray:
    """Displacement with human-sized components, each (n,) by column or (R, n)."""
    shape = lips.rest.shape[:2]
    parts = [np.broadcast_to(np.asarray(v, dtype=np.float64), shape) for v in (x, y, z)]
    return np.asarray(np.stack(parts, axis=2) * lips.scale)


def roll(lips: Lips, degrees: FloatArray) -> FloatArray:
    """Turn each column (n,) about the middle of its red; positive turns the lip inwards."""
    pivot = 0.5 * (lips.rest[0] + lips.rest[len(PROFILE)])
    angle = np.radians(degrees) * lips.side
    q = lips.rest - pivot
    cos, sin = np.cos(angle), np.sin(angle)
    turned = q.copy()
    turned[..., 1] = cos * q[..., 1] - sin * q[..., 2]
    turned[..., 2] = sin * q[..., 1] + cos * q[..., 2]
    return np.asarray(turned - q)


def close_gap(lips: Lips, opened: FloatArray, upper_share: float) -> FloatArray:
    """Bring lips together that a pose has opened; exact for all weights of both together."""
    n = lips.rest.shape[1]
    facing = opened[:, (n - np.arange(n)) % n]
    gap = facing - opened
    share = np.where(lips.side > 0, upper_share, 1.0 - upper_share)
    return np.asarray(gap * share[None, :, None])


def sealed(lips: Lips, moved: FloatArray) -> FloatArray:
    """Let both lips do the mean of their motions where they touch, so that no gap opens."""
    contact = slice(len(PROFILE) - 1, len(PROFILE) + 1)
    return np.asarray(
        np.concatenate(
            [
                moved[: contact.start],
                moved[contact] + close_gap(lips, moved, 0.5)[contact],
                moved[contact.stop :],
            ]
        )
    )


def funnel(lips: Lips) -> FloatArray:
    """Rounded, open and pushed out."""
    g, up, down = lips.opening, lips.side > 0, lips.side < 0
    x = -0.24 * lips.rest[..., 0] / lips.scale
    y = np.where(up, 0.0036 * g, 0.0) - np.where(down, 0.0042 * g, 0.0)
    moved = shift(lips, x, y, 0.0048 + 0.0022 * g)
    return moved + roll(lips, -16.0 * g)


def pucker(lips: Lips) -> FloatArray:
    """Kiss: corners come in, lips go forward and get fuller."""
    g = lips.opening
    x = -0.37 * lips.rest[..., 0] / lips.scale
    middle = lips.rest[len(PROFILE) - 1, np.argmax(g), 1]
    level = 0.5 * (middle - lips.rest[len(PROFILE) - 1, :, 1]) / lips.scale
    fuller = 0.0009 * lips.outer() * g * lips.side
    moved = shift(lips, x, level + fuller, 0.0062 + 0.0028 * g) + roll(lips, -7.0 * g)
    return sealed(lips, moved)


def corners(
    lips: Lips, x: float, y: float, z: float, power: float, base: float = 0.0
) -> FloatArray:
    """Pull both corners: x outwards, y up, z forward; ``base`` of it in the middle of the lips."""
    reach = base + (1.0 - base) * np.abs(lips.s) ** power
    outwards = np.sign(lips.s) * np.abs(lips.s) ** max(1.0, power * 0.75)
    return shift(lips, x * outwards, y * reach, z * reach)


def press(lips: Lips) -> FloatArray:
    """Lips pressed on each other: the red gets narrow, the contact stays."""
    g = lips.opening
    y = -0.0018 * lips.outer() * lips.side * g
    inwards = -0.0014 * g * (0.3 + 0.7 * np.sqrt(lips.outer() * (1 - lips.outer()) * 4))
    return shift(lips, 0.0, y, inwards)


def roll_in(lips: Lips, which: float, y: float, z: float, degrees: float) -> FloatArray:
    """Draw the upper (1) or lower (-1) lip over the teeth."""
    g = lips.opening * (lips.side == which)
    moved = shift(lips, 0.0, y * g, z * g) + roll(lips, degrees * g)
    moved += shift(lips, 0.0, -which * 0.0022 * lips.outer() * g, 0.0)
    return np.asarray(moved)


def lift(lips: Lips, which: float, y: float, z: float, degrees: float) -> FloatArray:
    """Raise (y > 0) or lower one lip, all along its width, off the teeth."""
    g = np.clip(1.0 - np.abs(lips.s) ** 2.6, 0.0, 1.0) * (lips.side == which)
    return shift(lips, 0.0, y * g, z * g) + roll(lips, degrees * g)


def shrug(lips: Lips, upper: float, lower: float, forward: float, which: float) -> FloatArray:
    """Push both lips up by what the chin pushes; one of them curls forward."""
    g = lips.opening
    y = np.where(lips.side > 0, upper, lower) * g
    z = forward * g * np.where(lips.side == which, 1.0, 0.35)
    moved = shift(lips, 0.0, y, z) + roll(lips, -8.0 * g * (lips.side == which))
    return sealed(lips, moved) if upper == lower else moved
