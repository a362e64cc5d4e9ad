"""Proportions of Ada and the field of her skin.

Design space: metres, origin between the eyes, +X to her left, +Y up, +Z forward.
"""

from __future__ import annotations

import numpy as np

from .field import cone, ellipsoid, sphere, subtract, union
from .mesh import FloatArray

EYE = np.array([0.0328, 0.0, 0.0585])
"""Centre of her left eyeball."""
EYE_RADIUS = 0.0203
LID_GAP = 0.0013
"""Distance between the eyeball and the outside of a lid."""
MOUTH_Y = -0.0665
MOUTH_HALF_WIDTH = 0.0250
JAW_AXIS = np.array([0.0, -0.020, 0.004])
"""A point on the line, along X, about which the mandible turns."""
JAW_ANGLE = np.radians(17.0)
FEET_TO_EYES = 0.2400
"""Height of the design origin above the ground of the finished bust."""


def folded(p: FloatArray) -> FloatArray:
    """Points with the right half mirrored on to the left."""
    return p * np.where(p[:, :1] < 0, [-1.0, 1.0, 1.0], [1.0, 1.0, 1.0])


def cranium(p: FloatArray) -> FloatArray:
    """Field of the skull, which also carries the hair."""
    skull = ellipsoid(p, (0, 0.040, -0.012), (0.0755, 0.082, 0.094))
    return union(skull, ellipsoid(p, (0, 0.030, 0.035), (0.0635, 0.060, 0.052)), 0.05)


def nose(d: FloatArray, q: FloatArray) -> FloatArray:
    """Union of the head (field d) with a small nose; q are folded points."""
    d = union(d, cone(q, (0, 0.002, 0.0780), (0, -0.028, 0.0950), 0.0062, 0.0080), 0.016)
    d = union(d, ellipsoid(q, (0, -0.0325, 0.0950), (0.0098, 0.0088, 0.0098)), 0.008)
    d = union(d, ellipsoid(q, (0.0102, -0.0362, 0.0905), (0.0066, 0.0062, 0.0085)), 0.0065)
    return subtract(d, ellipsoid(q, (0.0062, -0.0432, 0.0955), (0.0030, 0.0028, 0.0042)), 0.004)


def skin(p: FloatArray) -> FloatArray:
    """Field of head and neck without lips, ears and the inside of the mouth."""
    return nose(noseless(p), folded(p))


def noseless(p: FloatArray) -> FloatArray:
    """Field of the skin without the nose, on which a mesh can be evened out."""
    q = folded(p)
    d = cranium(q)
    d = union(d, ellipsoid(q, (0, -0.030, 0.020), (0.0640, 0.072, 0.060)), 0.040)
    d = union(d, ellipsoid(q, (0, -0.082, 0.046), (0.0360, 0.026, 0.036)), 0.045)
    d = union(d, ellipsoid(q, (0, -0.0960, 0.0715), (0.0195, 0.0140, 0.0140)), 0.024)
    d = union(d, ellipsoid(q, (0, -0.066, 0.060), (0.0330, 0.024, 0.0315)), 0.018)
    d = union(d, ellipsoid(q, (0.038, -0.034, 0.053), (0.025, 0.023, 0.0225)), 0.026)
    d = union(d, ellipsoid(q, (0.034, -0.060, 0.040), (0.026, 0.026, 0.030)), 0.022)
    d = union(d, cone(q, (0, -0.075, -0.022), (0, -0.215, -0.036), 0.0405, 0.0400), 0.030)
    d = union(d, cone(q, (0.010, 0.024, 0.0735), (0.042, 0.026, 0.0605), 0.0095, 0.0085), 0.022)
    d = subtract(d, ellipsoid(q, (0.034, -0.001, 0.0945), (0.026, 0.0180, 0.0165)), 0.018)
    lids = sphere(q, EYE, EYE_RADIUS + LID_GAP)
    return union(d, lids, 0.007)
