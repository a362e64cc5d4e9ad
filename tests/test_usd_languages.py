"""Assemblies: one file for all languages."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from pxr import Usd

from support.usd_kit import (
    FORMAT,
    SHAPES,
    add_animation,
    add_mesh,
    add_skeleton,
    assembled,
    digest,
    hero,
    joints,
    new_stage,
    played,
    select,
)


def test_assembly_switches_language_and_line(tmp_path: Path) -> None:
    source = hero(tmp_path / "hero.usda", old=["browUp"], weights={0.0: [0.0], 9.0: [1.0]})
    before = joints(Usd.Stage.Open(str(source)), "/hero/rig")
    brows = played(Usd.Stage.Open(str(source)), "/hero/face", [0.2])["browUp"]
    stage, lines = assembled(source, tmp_path / "out")
    languages = stage.GetPrimAtPath("/hero").GetVariantSet("dialogueLanguage")
    assert languages.GetVariantSelection() == "en"
    for (language, name), spoken in lines.items():
        select(stage, dialogueLanguage=language)
        select(stage, dialogueLine=name)
        weights = played(stage, "/hero/face", [0.2, 1.3])
        for i, shape in enumerate(spoken.curves.names):
            wanted = spoken.curves.sample([0.2, 1.3])[:, i]
            np.testing.assert_allclose(weights[shape], wanted, atol=1e-5)
        np.testing.assert_allclose(weights["browUp"][:1], brows, atol=1e-5)
        np.testing.assert_array_equal(joints(stage, "/hero/rig"), before)
    text = (tmp_path / "out" / "hero.usda").read_text("utf-8")
    assert "timeSamples" not in text
    assert str(tmp_path) not in text
    assert stage.GetEndTimeCode() == 48.0


def test_assembly_of_what_lies_outside_the_character(tmp_path: Path) -> None:
    """Animation inside an instance and materials elsewhere survive the reference."""
    stage = new_stage(tmp_path / "hero.usda")
    add_skeleton(stage, "/hero/rig", "/clips/first/walk")
    add_mesh(stage, "/hero/face", "/hero/rig", SHAPES)
    stage.CreateClassPrim("/proto")
    add_animation(stage, "/proto/walk", ["browUp"], [0.5])
    clip = stage.DefinePrim("/clips/first")
    clip.GetReferences().AddInternalReference("/proto")
    clip.SetInstanceable(True)
    paint = stage.DefinePrim("/looks/skin", "Material").GetPath()
    stage.GetPrimAtPath("/hero/face").CreateRelationship("look").SetTargets([paint])
    stage.Save()
    before = joints(stage, "/hero/rig")
    out, lines = assembled(tmp_path / "hero.usda", tmp_path / "out")
    for language, name in lines:
        select(out, dialogueLanguage=language)
        select(out, dialogueLine=name)
        np.testing.assert_array_equal(joints(out, "/hero/rig"), before)
        assert played(out, "/hero/face", [1.0])["browUp"] == [0.5]
    assert out.GetPrimAtPath("/hero/face").GetRelationship("look").GetTargets() == [paint]


def test_no_languages_no_assembly(tmp_path: Path) -> None:
    character = FORMAT.load(hero(tmp_path / "hero.usda"))
    assert FORMAT.write_assembly(character, {}, tmp_path / "out.usda") == ()


def test_a_tenth_run_replaces(tmp_path: Path) -> None:
    source = hero(tmp_path / "hero.usda", old=["browUp"], weights=[0.5])
    digests = set()
    for _ in range(10):
        stage, lines = assembled(source, tmp_path / "out")
        digests.add(tuple(digest(file) for file in sorted((tmp_path / "out").rglob("*.usd?"))))
    assert len(digests) == 1
    names = [child.GetName() for child in stage.GetPrimAtPath("/hero/Dialogue").GetChildren()]
    assert sorted(names) == ["active", "x", "y"]
    assert len(lines) == 6
