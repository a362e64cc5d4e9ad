"""Controls become weights of the character's own shapes."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import pytest

from animeme.curves import CurveSet
from animeme.rig import BoundRig, Drive, RigProfile
from animeme_stages.retarget.retarget import retarget


def bound(
    drives: dict[str, tuple[Drive, ...]],
    limits: dict[str, tuple[float, float]] | None = None,
    ceilings: dict[str, str] | None = None,
) -> BoundRig:
    profile = RigProfile("p", drives, limits or {}, ceilings or {})
    return BoundRig(profile, {shape: shape for shape in profile.shapes}, ())


def controls(**columns: Sequence[float]) -> CurveSet:
    count = len(next(iter(columns.values())))
    return CurveSet(np.arange(count) / 10, tuple(columns), np.array(list(columns.values())).T)


RETARGET: dict[str, tuple[CurveSet, BoundRig, dict[str, float], dict[str, list[float]]]] = {
    "as it is": (controls(a=[0, 0.5]), bound({"a": (Drive("x"),)}), {}, {"x": [0, 0.5]}),
    "gain": (controls(a=[0, 0.5]), bound({"a": (Drive("x", 0.5),)}), {}, {"x": [0, 0.25]}),
    "several shapes": (
        controls(a=[0.5]),
        bound({"a": (Drive("x"), Drive("y", 0.5))}),
        {},
        {"x": [0.5], "y": [0.25]},
    ),
    "sums": (
        controls(a=[0.25], b=[0.5]),
        bound({"a": (Drive("x"),), "b": (Drive("x", 0.5),)}),
        {},
        {"x": [0.5]},
    ),
    "same shape twice": (
        controls(a=[0.25]),
        bound({"a": (Drive("x"), Drive("x", 2.0))}),
        {},
        {"x": [0.75]},
    ),
    "held within [0, 1]": (
        controls(a=[-1, 2]),
        bound({"a": (Drive("x"),)}),
        {},
        {"x": [0, 1]},
    ),
    "own limits": (
        controls(a=[-1, 2]),
        bound({"a": (Drive("x"),)}, {"x": (-0.5, 1.5)}),
        {},
        {"x": [-0.5, 1.5]},
    ),
    "negative gain from rest": (
        controls(a=[0, 0.5]),
        bound({"a": (Drive("x", -1.0),)}),
        {"x": 0.75},
        {"x": [0.75, 0.25]},
    ),
    "rest is added, then limited": (
        controls(a=[0, 1]),
        bound({"a": (Drive("x"),)}),
        {"x": 0.5, "other": 1.0},
        {"x": [0.5, 1.0]},
    ),
    "ceiling": (
        controls(open=[0, 0.25, 1], close=[0.5, 0.5, 0.5]),
        bound({"open": (Drive("o"),), "close": (Drive("c"),)}, None, {"c": "o"}),
        {},
        {"o": [0, 0.25, 1], "c": [0, 0.25, 0.5]},
    ),
    "ceiling of a shape that no control here drives": (
        controls(close=[0.5]),
        bound({"open": (Drive("o"),), "close": (Drive("c"),)}, None, {"c": "o"}),
        {},
        {"c": [0.5]},
    ),
    "control without drive": (
        controls(a=[0.5], tongueOut=[1.0]),
        bound({"a": (Drive("x"),)}),
        {},
        {"x": [0.5]},
    ),
    "nothing driven": (controls(a=[0.5, 1]), bound({"b": (Drive("x"),)}), {}, {}),
}


@pytest.mark.parametrize("case", RETARGET)
def test_controls_become_shapes(case: str) -> None:
    curves, rig, rest, expected = RETARGET[case]
    shapes = retarget(curves, rig, rest)
    assert shapes.times_s.tolist() == curves.times_s.tolist()
    assert {name: shapes.curve(name).tolist() for name in shapes.names} == expected
