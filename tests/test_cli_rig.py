"""``animeme rig``: what is known of an asset's shapes, and drafts of what is not."""

from __future__ import annotations

import json
import tomllib
from pathlib import Path

import pytest

from support.gltf_build import BIN_KIND, TRIANGLE, face, glb
from support.gltf_kit import face_glb
from support.jobs import SAMPLE, Capture, animeme
from support.schemas import validate


@pytest.mark.parametrize("suffix", ["glb", "usdc"])
def test_rig_knows_ada(suffix: str, capsys: Capture) -> None:
    ran = animeme(capsys, "rig", SAMPLE / f"ada.{suffix}", "--json")
    assert ran.code == 0
    document = json.loads(ran.out)
    assert document["profile"] == "arkit"
    assert document["coverage"] == 1.0
    assert document["missing"] == []
    assert document["format"] == {"glb": "gltf", "usdc": "usd"}[suffix]
    assert (document["fallbacks"], document["binds"]) == ({}, {})
    assert set(document["mapped"].values()) <= set(document["shapes"])


@pytest.mark.usefixtures("wide")
def test_rig_shows_people_a_table(capsys: Capture) -> None:
    ran = animeme(capsys, "rig", SAMPLE / "ada.glb")
    assert ran.code == 0
    for cell in ("profile arkit", "coverage 100%", "jawOpen"):
        assert cell in ran.out


def test_rig_does_not_know_the_crab_and_says_how_to_go_on(capsys: Capture) -> None:
    ran = animeme(capsys, "rig", SAMPLE / "crab.glb", "--json")
    ran.says("crab.glb", "8 shapes", "no known rig family", "--draft", "rig-unknown")
    assert ran.code == 2
    document = json.loads(ran.out)
    assert (document["profile"], document["coverage"], document["mapped"]) == (None, 0.0, {})
    assert "MawGape" in document["shapes"]


def test_rig_takes_a_profile_of_ones_own(capsys: Capture) -> None:
    profile = SAMPLE / "crab.rig.toml"
    ran = animeme(capsys, "rig", SAMPLE / "crab.glb", "--rig", profile, "--json")
    assert ran.code == 0
    document = json.loads(ran.out)
    assert (document["profile"], document["coverage"]) == ("crab", 1.0)


@pytest.mark.parametrize(
    ("rig", "words"),
    [
        ("arkti", ("'arkti'", "Did you mean 'arkit'?")),
        ("no.rig.toml", ("no.rig.toml", "no such file")),
        ("arkit", ("crab.glb", "'arkit'", "another profile")),
    ],
)
def test_rig_says_why_a_profile_cannot_be_used(
    rig: str, words: tuple[str, ...], capsys: Capture
) -> None:
    ran = animeme(capsys, "rig", SAMPLE / "crab.glb", "--rig", rig)
    ran.says(*words)
    assert (ran.code, ran.out) == (2, "")


def test_a_drafted_rig_can_be_used_and_is_never_overwritten(
    tmp_path: Path, capsys: Capture
) -> None:
    draft = tmp_path / "größe.rig.toml"
    ran = animeme(capsys, "rig", SAMPLE / "crab.glb", "--draft", draft)
    ran.says(str(draft), "check every line")
    assert ran.code == 0
    validate("rig", tomllib.loads(draft.read_text(encoding="utf-8")))
    assert [path.name for path in tmp_path.iterdir()] == [draft.name]

    read = animeme(capsys, "rig", SAMPLE / "crab.glb", "--rig", draft, "--json")
    assert read.code == 0
    assert json.loads(read.out)["profile"] == "größe"

    draft.write_text("mine")
    again = animeme(capsys, "rig", SAMPLE / "crab.glb", "--draft", draft)
    again.says(str(draft), "is there already", "Choose another name", "output-exists")
    assert again.code == 2
    assert draft.read_text() == "mine"


@pytest.mark.parametrize("name", ["crab.json", "crab"])
def test_a_draft_is_refused_where_it_could_not_be_read_back(
    name: str, tmp_path: Path, capsys: Capture
) -> None:
    ran = animeme(capsys, "rig", SAMPLE / "crab.glb", "--draft", tmp_path / name)
    if ran.code == 0:
        read = animeme(capsys, "rig", SAMPLE / "crab.glb", "--rig", tmp_path / name)
        assert read.code == 0, read.err
        return
    ran.says(name, ".toml")
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("asset", ["no.glb", "no.usdc", "no.fbx", "speech.py"])
def test_rig_says_which_asset_it_cannot_read(asset: str, capsys: Capture) -> None:
    ran = animeme(capsys, "rig", SAMPLE / asset)
    ran.says(asset)
    assert (ran.code, ran.out) == (2, "")


@pytest.mark.usefixtures("wide")
def test_rig_tells_what_stands_in_for_a_missing_shape(tmp_path: Path, capsys: Capture) -> None:
    names = ("jawOpen", "mouthPucker", "mouthSmile", "mouthShrugLower", "mouthRollUpper")
    asset = face_glb(tmp_path, face(names))
    document = json.loads(animeme(capsys, "rig", asset, "--json").out)
    assert document["profile"] == "arkit"
    assert "mouthFunnel" in document["missing"]
    assert document["fallbacks"]["mouthFunnel"] == {"shape": "mouthPucker", "gain": 0.7}
    shown = animeme(capsys, "rig", asset)
    assert "missing, 0.7 × mouthPucker instead" in shown.out


def test_rig_follows_the_binds_of_a_vrm(tmp_path: Path, capsys: Capture) -> None:
    def expression(*binds: tuple[int, float]) -> dict[str, object]:
        return {"morphTargetBinds": [{"node": 0, "index": i, "weight": w} for i, w in binds]}

    presets = {"aa": expression((0, 1.0)), "oh": expression((0, 0.5), (1, 1.0), (9, 1.0))}
    vrm = {"VRMC_vrm": {"expressions": {"preset": {**presets, "happy": "?", "ih": {}}}}}
    asset = tmp_path / "hero.vrm"
    asset.write_bytes(glb(face(("k1", "k2"), extensions=vrm), (BIN_KIND, TRIANGLE)))
    document = json.loads(animeme(capsys, "rig", asset, "--json").out)
    assert (document["profile"], document["mapped"]) == ("vrm1", {"aa": "k1", "oh": "oh"})
    assert document["binds"] == {"oh": [{"shape": "k1", "gain": 0.5}, {"shape": "k2", "gain": 1.0}]}


def test_rig_follows_the_groups_of_an_older_vrm(tmp_path: Path, capsys: Capture) -> None:
    groups = [
        {"presetName": "a", "name": "A", "binds": [{"mesh": 0, "index": 1, "weight": 100}]},
        {"presetName": "unknown", "name": "o", "binds": [{"mesh": 0, "index": 0, "weight": 50}]},
        {"presetName": "u", "name": "U", "binds": [{"mesh": 7, "index": 0, "weight": 100}]},
    ]
    asset = tmp_path / "hero.vrm"
    vrm = {"VRM": {"blendShapeMaster": {"blendShapeGroups": groups}}}
    asset.write_bytes(glb(face(("k1", "k2"), extensions=vrm), (BIN_KIND, TRIANGLE)))
    document = json.loads(animeme(capsys, "rig", asset, "--json").out)
    assert (document["profile"], document["missing"]) == ("vrm0", ["I", "U", "E"])
    assert document["mapped"]["A"] == "k2"
    # A group of its own that is called like a preset stands for it.
    assert document["binds"] == {"O": [{"shape": "k1", "gain": 0.5}]}
