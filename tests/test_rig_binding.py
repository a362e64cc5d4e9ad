"""What a profile makes of a character's shapes, and which profile a character has."""

from __future__ import annotations

import pytest

from animeme.errors import InputError
from animeme.rig import BoundRig, Drive, RigProfile
from animeme_stages.retarget.profile_files import shipped_profile
from animeme_stages.retarget.profiles import bind, detect
from support.rigs import character

SPEECH = (
    "jawOpen", "mouthClose", "mouthFunnel", "mouthPucker", "mouthSmileLeft", "mouthSmileRight",
    "mouthStretchLeft", "mouthStretchRight", "mouthLowerDownLeft", "mouthLowerDownRight",
    "mouthUpperUpLeft", "mouthUpperUpRight", "mouthRollLower", "tongueOut",
)  # fmt: skip


def sided(name: str, left: str, right: str) -> str:
    for side, mark in (("Left", left), ("Right", right)):
        if name.endswith(side):
            return name.removesuffix(side) + mark
    return name


STYLES = {
    "ARKit": list(SPEECH),
    "_L and _R": [sided(name, "_L", "_R") for name in SPEECH],
    "L and R": [sided(name, "L", "R") for name in SPEECH],
    ".L and .R, Blender": [sided(name, ".L", ".R") for name in SPEECH],
    "capitals": [name[0].upper() + name[1:] for name in SPEECH],
    "with a prefix": [f"Head.{name}" for name in SPEECH],
    "_Left and _Right": [sided(name, "_Left", "_Right") for name in SPEECH],
    "snake": ["".join(f"_{c.lower()}" if c.isupper() else c for c in name) for name in SPEECH],
    "snake with _l and _r": [
        "".join(f"_{c.lower()}" if c.isupper() else c for c in sided(name, "_l", "_r"))
        for name in SPEECH
    ],
}


@pytest.mark.parametrize("style", STYLES)
def test_arkit_is_detected_in_every_spelling(style: str) -> None:
    names = STYLES[style]
    bound = detect(character(["eyes", *names]))
    assert bound.profile.name == "arkit"
    assert bound.mapped == dict(zip(SPEECH, names, strict=True))
    assert bound.coverage == pytest.approx(len(SPEECH) / 52)
    for control, own in zip(SPEECH, names, strict=True):
        assert bound.profile.drives[control] == (Drive(own),)


def test_the_exact_name_wins_over_another_spelling() -> None:
    profile = RigProfile("p", {"c": (Drive("jawOpen"),)})
    assert bind(profile, character(["JawOpen", "jawOpen"])).mapped == {"jawOpen": "jawOpen"}
    assert bind(profile, character(["JawOpen", "jaw_open"])).mapped == {"jawOpen": "JawOpen"}


def test_a_prefix_per_mesh_leaves_no_mesh_behind() -> None:
    head = ["headShapes.jawOpen", "headShapes.mouthSmile_L"]
    hero = character(head, ["teethShapes.jawOpen"])
    bound = bind(shipped_profile("arkit"), hero)
    (drive,) = bound.profile.drives["jawOpen"]
    driven = {stored for stored, name in hero.canonical.items() if name == drive.shape}
    assert driven == {"headShapes.jawOpen", "teethShapes.jawOpen"}


def test_what_the_character_lacks_is_missing_and_its_limits_go() -> None:
    profile = RigProfile(
        "p",
        {"a": (Drive("one", 0.5), Drive("two")), "b": (Drive("two"),)},
        {"one": (-1.0, 1.0), "two": (0.0, 0.5)},
        {"one": "two"},
    )
    bound = bind(profile, character(["One"]))
    assert bound.mapped == {"one": "One"}
    assert bound.missing == ("two",)
    assert bound.coverage == 0.5
    assert bound.profile == RigProfile("p", {"a": (Drive("One", 0.5),)}, {"One": (-1.0, 1.0)})


def test_a_profile_without_shapes_covers_nothing() -> None:
    assert BoundRig(RigProfile("p", {}), {}, ()).coverage == 0.0


def test_a_rig_of_no_family_is_an_input_error_that_says_how_to_go_on() -> None:
    with pytest.raises(InputError, match="animeme rig ASSET --draft") as caught:
        detect(character(["scuttle", "pinch"]))
    assert caught.value.code == "rig-unknown"
