"""Spellings of a shape's name: which are the same, and which are not."""

from __future__ import annotations

from itertools import combinations

import pytest

from animeme.rig import Drive, RigProfile
from animeme_stages.retarget.profiles import bind
from animeme_stages.retarget.spelling import spelling
from support.rigs import character


@pytest.mark.parametrize(
    "name",
    [
        "mouthSmileLeft",
        "mouthSmile_L",
        "mouthSmileL",
        "MouthSmile_Left",
        "Head.mouthSmileLeft",
        "Head.mouthSmile_L",
        "Armature|mouthSmile_L",
        "ns:mouthSmile_L",
        "mouth_smile_left",
        "mouth smile left",
        "mouth-smile-L",
        "MOUTH_SMILE_LEFT",
        "mouthSmile L",
        # Blender's own way of marking sides, and with it, of marking copies.
        "mouthSmile.L",
        "Head.mouthSmile.L",
        "mouth_smile_l",
    ],
)
def test_one_shape_in_many_spellings(name: str) -> None:
    assert spelling(name) == spelling("mouthSmileLeft")
    assert spelling(name) != spelling("mouthSmileRight")


def test_names_that_only_look_alike_stay_apart() -> None:
    apart = [
        "curl", "cu", "cuLeft", "roll", "rol", "rolLeft", "blur", "blu", "bluRight",
        "lower", "lowe", "all", "al", "CURL", "FUR", "eyeLookUp", "eyeLookUpL", "eyeLookUpR",
        "mouthLeft", "mouthRight", "mouth", "あ", "い", "browDown.L", "eyeBlink.L", "browDown.R",
        "smile.001", "frown.001", "jawOpen", "jaw", "L", "R",
    ]  # fmt: skip
    clashes = [
        (a, b)
        for a, b in combinations(apart, 2)
        if spelling(a) == spelling(b) and a.lower() != b.lower()
    ]
    assert clashes == []


@pytest.mark.parametrize("name", ["curl", "roll", "blur", "lower", "pucker", "all"])
def test_a_word_that_ends_in_l_or_r_has_no_side(name: str) -> None:
    assert spelling(name) == name


def test_names_of_signs_only_are_nobodys() -> None:
    profile = RigProfile("p", {"c": (Drive("!"),)})
    assert bind(profile, character(["?", "…"])).missing == ("!",)
