"""Weights of a rig's poses (visemes) that together come nearest to ARKit's controls.

Rigs with visemes have no shape for ``jawOpen`` or ``mouthPucker``: each shape is a whole mouth.
What each shows is in the profile, in ARKit's controls; the weights of a frame are the non-negative
mixture whose picture differs least from the controls (non-negative least squares, Lawson & Hanson
1974, as scipy has it). It is solved anew in each frame: as the problem is strictly convex, weights
move as continuously as the controls do.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import lru_cache

import numpy as np
import scipy  # its parts load when they are first used
from numpy.typing import NDArray

from animeme_stages.retarget.profile_files import arkit_controls

Floats = NDArray[np.float64]

# What counts how much: one unit of each control, both sides together. Chosen by random search over
# the sample's lines so that at the middle of each phone the pose which its family has for it is the
# strongest as often as possible, over four families and two models; rounded. In words: rounding and
# a lower lip at the teeth tell mouths apart, the jaw and an upper lip rolled in do not.
_WEIGHTS = {
    "jawOpen": 0.2,
    "mouthClose": 0.1,
    "mouthFunnel": 0.4,
    "mouthPucker": 1.6,
    "mouthPress": 2.0,
    "mouthRollLower": 4.5,
    "mouthRollUpper": 0.2,
    "mouthStretch": 0.5,
    "mouthSmile": 0.5,
    "mouthLowerDown": 0.2,
    "mouthUpperUp": 1.1,
    "tongueOut": 0.3,
}
_OTHER = 0.1
# jawOpen less mouthClose: how far the lips are apart.
_APERTURE = 0.7
# Share of a pose's own size that its weight costs: keeps the problem strictly convex, and weights
# from jumping, where two poses look alike.
_RIDGE = 0.15
# What all weights together cost, each by the root of its pose's size: one pose that says nearly the
# same goes before several, but a small one (closed lips) is not lost beside a wide open mouth.
_TOGETHER = 0.15


def solve(controls: Floats, poses: Sequence[Mapping[str, float]]) -> Floats:
    """Weights of `poses` in each frame.

    Args:
        controls: shape (T, 52), in the order of `arkit_controls`.
        poses: P of them, each control → value at weight 1.

    Returns:
        Shape (T, P), each at least 0.
    """
    # Imported here: every worker would wait for it, and few rigs are made of poses.

    picture = features()
    target = controls @ picture.T
    shown = np.array([[pose.get(c, 0.0) for c in arkit_controls()] for pose in poses]) @ picture.T
    sizes = np.linalg.norm(shown, axis=1)
    together = _TOGETHER * np.sqrt(sizes)[None]
    system = np.concatenate([shown.T, np.diag(_RIDGE * sizes), together])
    weights = np.zeros((len(controls), len(poses)))
    padding = np.zeros(len(poses) + 1)
    for frame, wanted in enumerate(target):
        weights[frame] = scipy.optimize.nnls(system, np.concatenate([wanted, padding]))[0]
    return weights


@lru_cache(maxsize=1)
def features() -> Floats:
    """What is compared of two faces, as a matrix over ARKit's controls, shape (F, 52).

    One row per control, sides together, and one for the aperture of the lips.
    """
    controls = arkit_controls()
    rows: dict[str, Floats] = {}
    for index, control in enumerate(controls):
        base = control
        if control not in ("jawLeft", "jawRight", "mouthLeft", "mouthRight"):
            base = control.removesuffix("Left").removesuffix("Right")
        row = rows.setdefault(base, np.zeros(len(controls)))
        row[index] = _WEIGHTS.get(base, _OTHER)
    for row in rows.values():
        row /= np.count_nonzero(row)
    aperture = np.zeros(len(controls))
    aperture[controls.index("jawOpen")] = _APERTURE
    aperture[controls.index("mouthClose")] = -_APERTURE
    return np.stack([*rows.values(), aperture])
