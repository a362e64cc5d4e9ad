"""Names of morph targets: where a glTF keeps them, and what they may be."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from support.gltf_build import face
from support.gltf_kit import FORMAT, animate, face_glb, speech


def test_names_may_stand_in_the_primitives_extras_only(tmp_path: Path) -> None:
    document = face()
    del document["meshes"][0]["extras"]
    document["meshes"][0]["primitives"][0]["extras"] = {"targetNames": ["a", "b"]}
    source = face_glb(tmp_path, document)
    assert FORMAT.load(source).shapes == ("a", "b")
    animate(source, tmp_path / "out.glb", speech(["b"]))


def test_the_meshs_names_win_over_its_primitives(tmp_path: Path) -> None:
    document = face(["a", "b"])
    document["meshes"][0]["primitives"][0]["extras"] = {"targetNames": ["c", "d"]}
    assert FORMAT.load(face_glb(tmp_path, document)).shapes == ("a", "b")


@pytest.mark.parametrize("names", [None, ["one"], "ab", [], {"0": "a"}])
def test_targets_without_a_name_each_are_numbered(names: Any, tmp_path: Path) -> None:
    document = face()
    document["meshes"][0]["extras"] = {} if names is None else {"targetNames": names}
    source = face_glb(tmp_path, document)
    assert FORMAT.load(source).shapes == ("target_0", "target_1")


def test_unnamed_targets_can_be_driven(tmp_path: Path) -> None:
    document = face()
    del document["meshes"][0]["extras"]
    animate(face_glb(tmp_path, document), tmp_path / "out.glb", speech(["target_1"]))


@pytest.mark.parametrize(
    "names", [["a", "a"], ["a", "a", "a#2"], ["a#2", "a", "a"], ["", ""], ["a", "a", "a#2", "a#2"]]
)
def test_every_target_has_a_name_of_its_own(names: list[str], tmp_path: Path) -> None:
    (loaded,) = FORMAT.load(face_glb(tmp_path, face(names))).meshes
    assert len(set(loaded.shapes)) == len(names)


def test_very_many_equal_names_are_told_apart_in_time(tmp_path: Path) -> None:
    (loaded,) = FORMAT.load(face_glb(tmp_path, face(["a"] * 30_000))).meshes
    assert len(set(loaded.shapes)) == 30_000


@pytest.mark.parametrize("names", [['quote"d'], ["line\nbreak"], ["😀"], ["é", "e\u0301"], [""]])
def test_any_string_can_be_a_name(names: list[str], tmp_path: Path) -> None:
    animate(face_glb(tmp_path, face(names)), tmp_path / "out.glb", speech(names[-1:]))
