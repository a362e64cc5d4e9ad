"""Rigs of whole mouths: visemes solved from ARKit's controls, and any model on any rig."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from animeme.curves import CurveSet
from animeme.findings import RunReport
from animeme.phones import PhoneTrack
from animeme.rig import BoundRig, Corrective, Drive, RigProfile, Total
from animeme_stages.retarget.poses import solve
from animeme_stages.retarget.profile_files import arkit_controls, profile_names, shipped_profile
from animeme_stages.retarget.profiles import bind, detect
from animeme_stages.retarget.retarget import retarget
from bench.visemes import tally
from support.rigs import character

VISEMES = tuple(name for name in profile_names() if shipped_profile(name).poses)
SMARTBODY = ("open", "W", "ShCh", "PBM", "FV", "wide", "tBack", "tRoof", "tTeeth")


def frames(names: tuple[str, ...], *rows: dict[str, float]) -> CurveSet:
    weights = np.array([[row.get(name, 0.0) for name in names] for row in rows])
    return CurveSet(np.arange(len(rows)) / 60, names, weights)


def rig_of(family: str) -> BoundRig:
    profile = shipped_profile(family)
    return bind(profile, character(profile.shapes))


@pytest.mark.parametrize("family", VISEMES)
def test_each_pose_is_found_again_in_its_own_picture(family: str) -> None:
    profile = shipped_profile(family)
    shown = {shape: dict(pose) for shape, pose in profile.poses.items() if pose}
    curves = retarget(frames(arkit_controls(), *shown.values()), rig_of(family), {})
    spoken = [index for index, name in enumerate(curves.names) if name != profile.rest]
    found = [curves.names[spoken[i]] for i in curves.weights[:, spoken].argmax(axis=1)]
    wrong = {shape: other for shape, other in zip(shown, found, strict=True) if shape != other}
    assert wrong == {}
    assert (curves.weights >= 0).all()


@pytest.mark.parametrize("family", VISEMES)
def test_a_still_face_moves_nothing_but_the_rest(family: str) -> None:
    profile = shipped_profile(family)
    curves = retarget(frames(arkit_controls(), {}, {"browInnerUp": 0.0}), rig_of(family), {})
    moved = {n: w for n, w in zip(curves.names, curves.weights.T, strict=True) if w.any()}
    assert {name: w.tolist() for name, w in moved.items()} == (
        {profile.rest: [1.0, 1.0]} if profile.rest else {}
    )


def test_visemes_leave_the_rest_what_they_do_not_take() -> None:
    curves = retarget(
        frames(("jawOpen",), {"jawOpen": 0.2}, {"jawOpen": 1.0}), rig_of("oculus"), {}
    )
    assert curves.weights.sum(axis=1) == pytest.approx(1.0)


def test_weights_move_as_smoothly_as_the_controls() -> None:
    share = np.linspace(0.0, 1.0, 400)[:, None]
    rng = np.random.default_rng(5)
    poses = [pose for pose in shipped_profile("oculus").poses.values() if pose]
    for _ in range(20):
        start, end = rng.uniform(0, 0.6, (2, len(arkit_controls())))
        weights = solve((1 - share) * start + share * end, poses)
        assert np.abs(np.diff(weights, axis=0)).max() < 0.05


@pytest.mark.parametrize(("model", "vowels"), [("dam", 0.33), ("cohen-massaro", 0.55)])
def test_visemes_say_what_is_said(
    model: str, vowels: float, sample_run: tuple[RunReport, Path]
) -> None:
    _, output = sample_run
    tracks = [
        PhoneTrack.from_document(json.loads(path.read_text(encoding="utf-8")))
        for path in sorted((output / "alignments").rglob("*.json"))
    ]
    found = tally(tracks, model, "oculus")
    assert found.right["p b m"] >= 0.95 * found.phones["p b m"]
    assert found.right["f v"] >= 0.95 * found.phones["f v"]
    assert found.right["vowels"] >= vowels * found.phones["vowels"]
    assert found.alike["vowels"] >= 0.68 * found.phones["vowels"]
    assert found.aperture[0] < 0.05


# Models that do not speak ARKit.


def strongest(curves: CurveSet) -> str:
    return curves.names[int(curves.weights[0].argmax())]


def test_a_rigs_own_poses_are_driven_as_they_are() -> None:
    curves = frames(SMARTBODY, {"open": 0.4, "W": 0.3, "tRoof": 0.2})
    shapes = retarget(curves, rig_of("smartbody"), {})
    assert dict(zip(shapes.names, shapes.weights[0], strict=True)) == {
        **dict.fromkeys(SMARTBODY, 0.0),
        "open": 0.4,
        "W": 0.3,
        "tRoof": 0.2,
    }


TRANSLATED = {
    "lips on the teeth": ({"FV": 1.0}, "viseme_FF", "mouthRollLower"),
    "rounding": ({"W": 1.0}, "viseme_U", "mouthPucker"),
    "an open mouth": ({"open": 1.0}, "viseme_aa", "jawOpen"),
    "shut": ({"PBM": 1.0}, "viseme_PP", "mouthPressLeft"),
}


@pytest.mark.parametrize("case", TRANSLATED)
def test_poses_of_another_family_are_understood(case: str) -> None:
    row, viseme, arkit = TRANSLATED[case]
    curves = frames(SMARTBODY, row)
    assert strongest(retarget(curves, rig_of("oculus"), {})) == viseme
    found = retarget(curves, rig_of("arkit"), {})
    assert found.curve(arkit)[0] == pytest.approx(
        shipped_profile("smartbody").poses[next(iter(row))][arkit]
    )


def test_a_missing_viseme_is_replaced_by_those_that_look_most_like_it() -> None:
    own = [s for s in shipped_profile("oculus").shapes if s not in ("viseme_U", "viseme_PP")]
    rig = detect(character(own))
    assert rig.missing == ("viseme_PP", "viseme_U")
    row = {"jawOpen": 0.1, "mouthPucker": 0.6, "mouthFunnel": 0.2}
    assert strongest(retarget(frames(tuple(row), row), rig, {})) in ("viseme_O", "viseme_RR")


# Rules of shapes among each other.


def test_rules_are_applied_in_order() -> None:
    profile = RigProfile(
        "p",
        {"a": (Drive("x"),), "b": (Drive("y"),), "c": (Drive("z"),)},
        totals=(Total(("x", "y"), 1.0),),
        ceilings={"z": "x"},
        correctives={"xy": Corrective(("x", "y")), "least": Corrective(("x", "z"), "minimum")},
    )
    rig = bind(profile, character(profile.shapes))
    row = {"a": 0.6, "b": 0.9, "c": 0.7}
    shapes = retarget(frames(("a", "b", "c"), row, {"a": 0.2, "b": 0.3}), rig, {})
    assert shapes.curve("x") == pytest.approx([0.4, 0.2])
    assert shapes.curve("y") == pytest.approx([0.6, 0.3])
    assert shapes.curve("z") == pytest.approx([0.4, 0.0])
    assert shapes.curve("xy") == pytest.approx([0.24, 0.06])
    assert shapes.curve("least") == pytest.approx([0.4, 0.0])


def test_binds_are_taken_apart_over_the_shapes_at_rest() -> None:
    profile = RigProfile("p", {"a": (Drive("aa"),), "o": (Drive("oh"),)})
    rig = BoundRig(
        profile, {}, (), binds={"aa": (Drive("k1", 0.5), Drive("k2")), "oh": (Drive("k1"),)}
    )
    shapes = retarget(frames(("a", "o"), {"a": 0.4, "o": 0.1}), rig, {"k2": 0.25, "k1": 0.0})
    assert shapes.curve("k1") == pytest.approx([0.3])
    assert shapes.curve("k2") == pytest.approx([0.65])


def test_closing_without_a_shape_for_it_opens_less() -> None:
    rig = detect(character(["jawOpen", "mouthPucker", "mouthFunnel", "mouthShrugLower"]))
    row = {"jawOpen": 0.5, "mouthClose": 0.4}
    assert retarget(frames(tuple(row), row), rig, {}).curve("jawOpen") == pytest.approx([0.1])
