"""Control curves to the shape curves of one character."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from animeme.curves import CurveSet, Floats
from animeme.rig import BoundRig, RigProfile
from animeme_stages.retarget.controls import as_understood
from animeme_stages.retarget.poses import solve


def retarget(controls: CurveSet, rig: BoundRig, rest: Mapping[str, float]) -> CurveSet:
    """Weights of every shape that `rig` drives with one of `controls`.

    A shape's weight is its rest weight plus gain × control, summed over its controls, or its part
    in the mixture of poses that comes nearest to the controls. Then it is held within its limits,
    its group within its total, it under its ceiling, and shapes that follow others are set.

    Args:
        controls: a model's curves.
        rig: profile bound to the character.
        rest: weight of each shape at rest.
    """
    profile = rig.profile
    heard = as_understood(controls.names, profile)
    columns = dict(zip(heard.shapes, (controls.weights @ heard.mix).T, strict=True))
    if heard.solved:
        poses = [profile.poses[shape] for shape in heard.solved]
        found = solve(controls.weights @ heard.arkit, poses).T
        for shape, weights in zip(heard.solved, found, strict=True):
            columns[shape] = columns.get(shape, 0.0) + weights
    for shape, weights in columns.items():
        low, high = profile.limits.get(shape, (0.0, 1.0))
        columns[shape] = np.clip(weights + rest.get(shape, 0.0), low, high)
    _combine(columns, profile, solved=bool(heard.solved))
    return _as_curves(controls, _taken_apart(columns, rig, rest))


def _combine(columns: dict[str, Floats], profile: RigProfile, *, solved: bool) -> None:
    """Apply the profile's rules on shapes among each other."""
    for total in profile.totals:
        group = [shape for shape in total.shapes if shape in columns]
        together = sum(np.maximum(columns[shape], 0.0) for shape in group)
        share = total.most / np.maximum(together, max(total.most, 1e-9))
        for shape in group:
            columns[shape] = columns[shape] * share
    for shape, ceiling in profile.ceilings.items():
        if shape in columns and ceiling in columns:
            columns[shape] = np.minimum(columns[shape], columns[ceiling])
    for shape, rule in profile.correctives.items():
        if all(name in columns for name in rule.of):
            followed = np.stack([columns[name] for name in rule.of])
            made = followed.prod(axis=0) if rule.rule == "product" else followed.min(axis=0)
            columns[shape] = np.clip(made, *profile.limits.get(shape, (0.0, 1.0)))
    if solved and profile.rest:
        others = sum(columns[shape] for shape in profile.poses if shape in columns)
        columns[profile.rest] = np.clip(1.0 - others, 0.0, 1.0)


def _taken_apart(
    columns: Mapping[str, Floats], rig: BoundRig, rest: Mapping[str, float]
) -> dict[str, Floats]:
    """Columns of the character's shapes, from those of what its binds put together."""
    made: dict[str, Floats] = {}
    for name, weights in columns.items():
        if name not in rig.binds:
            made[name] = made[name] + weights if name in made else weights
            continue
        for drive in rig.binds[name]:
            start = made.get(drive.shape, rest.get(drive.shape, 0.0))
            made[drive.shape] = start + drive.gain * weights
    bound = {drive.shape for drives in rig.binds.values() for drive in drives}
    return {name: np.clip(w, 0.0, 1.0) if name in bound else w for name, w in made.items()}


def _as_curves(controls: CurveSet, columns: Mapping[str, Floats]) -> CurveSet:
    weights = np.zeros((len(controls.times_s), len(columns)))
    for index, column in enumerate(columns.values()):
        weights[:, index] = column
    return CurveSet(controls.times_s, tuple(columns), weights)
