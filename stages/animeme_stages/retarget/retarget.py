"""Control curves to the shape curves of one character."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from animeme.curves import CurveSet
from animeme.rig import BoundRig


def retarget(controls: CurveSet, rig: BoundRig, rest: Mapping[str, float]) -> CurveSet:
    """Weights of every shape that `rig` drives with one of `controls`.

    A shape's weight is its rest weight plus gain × control, summed over its controls, then held
    within its limits and under its ceiling.

    Args:
        controls: a model's curves.
        rig: profile bound to the character.
        rest: weight of each shape at rest.
    """
    profile = rig.profile
    shapes = tuple(
        dict.fromkeys(d.shape for name in controls.names for d in profile.drives.get(name, ()))
    )
    column = {shape: index for index, shape in enumerate(shapes)}
    mix = np.zeros((len(controls.names), len(shapes)))
    for row, name in enumerate(controls.names):
        for drive in profile.drives.get(name, ()):
            mix[row, column[drive.shape]] += drive.gain
    weights = controls.weights @ mix + np.array([rest.get(shape, 0.0) for shape in shapes])
    low, high = (
        np.array([profile.limits.get(shape, (0.0, 1.0)) for shape in shapes]).reshape(-1, 2).T
    )
    weights = np.clip(weights, low, high)
    for shape, ceiling in profile.ceilings.items():
        if shape in column and ceiling in column:
            at = column[shape]
            weights[:, at] = np.minimum(weights[:, at], weights[:, column[ceiling]])
    return CurveSet(controls.times_s, shapes, weights)
