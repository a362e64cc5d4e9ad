"""Which tracked point is which, by the numbering of iBUG 300-W (68) and of MediaPipe's face mesh.

Sources: Sagonas et al., "300 Faces In-The-Wild Challenge" (2016), figure 1; MediaPipe's
canonical face model. The two were marked by eye and by a network, so that pairs agree to a few
millimetres; what is mapped are displacements, for which that is enough.
"""

from __future__ import annotations

# iBUG number → MediaPipe number. "Right" is the person's own.
LIPS = {
    48: 61, 49: 40, 50: 37, 51: 0, 52: 267, 53: 270, 54: 291,  # outer upper, right to left
    55: 321, 56: 314, 57: 17, 58: 84, 59: 91,  # outer lower, left to right
    60: 78, 61: 81, 62: 13, 63: 311, 64: 308,  # inner upper, right to left
    65: 402, 66: 14, 67: 178,  # inner lower, left to right
}  # fmt: skip
CHIN = {8: 152}
# Upper and lower inner lip, of which the distance is the opening.
INNER = ((61, 67), (62, 66), (63, 65))
# Outer and inner corner of the right eye, inner and outer of the left.
EYES = {36: 33, 39: 133, 42: 362, 45: 263}
# Points that move with the head only; those of the nose bridge and tip pair up, too.
STILL = {**EYES, 27: 168, 30: 4}
# More of them, which have no partner on a character but help to find the head's motion.
STILL_ONLY = {"ibug": (28, 29, 33), "mediapipe": (1, 10)}

SCHEMES = ("ibug", "mediapipe")


def numbers(scheme: str, table: dict[int, int]) -> tuple[int, ...]:
    """The points of `table` in the numbering of `scheme`, in order."""
    return tuple(table if scheme == "ibug" else table.values())


def scheme_of(ids: set[int]) -> str:
    """Which numbering a set of tracked points has: iBUG's ends at 67."""
    return "ibug" if max(ids) < 68 else "mediapipe"
