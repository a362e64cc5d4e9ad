"""Animations that were there: other people's stay, our own are replaced."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from animeme.errors import InputError
from support.gltf_build import TRIANGLE, Json, Reader, add_weights_animation, face
from support.gltf_kit import (
    FORMAT,
    animate,
    external_buffer,
    face_glb,
    line,
    require_played,
    saved,
    speech,
)


def test_other_peoples_animations_are_kept(tmp_path: Path) -> None:
    document = face()
    binary = add_weights_animation(document, TRIANGLE, "blink", [[0, 0], [1, 0.5]])
    binary = add_weights_animation(document, binary, None, [[0, 0], [0.5, 0]], interpolation="STEP")
    source = face_glb(tmp_path, document, binary)
    reader = animate(source, tmp_path / "out.glb")
    assert reader.animation_names() == ["blink", None, "hello"]
    np.testing.assert_array_equal(reader.weights("blink", np.array([1.0]))[0], [[1, 0.5]])


def test_a_name_that_others_use_gets_the_language(tmp_path: Path) -> None:
    document = face()
    binary = add_weights_animation(document, TRIANGLE, "hello", [[0, 0], [1, 0.5]])
    reader = animate(face_glb(tmp_path, document, binary), tmp_path / "out.glb")
    assert reader.animation_names() == ["hello", "hello_en"]


def test_a_name_is_never_used_twice(tmp_path: Path) -> None:
    document = face()
    binary = add_weights_animation(document, TRIANGLE, "hello", [[0, 0], [1, 0.5]])
    binary = add_weights_animation(document, binary, "hello_en", [[0, 0], [1, 0.5]])
    source, target = face_glb(tmp_path, document, binary), tmp_path / "out.glb"
    FORMAT.write(FORMAT.load(source), [line(speech(["jawOpen"]))], target)
    names = Reader(target).animation_names()
    assert len(set(names)) == len(names) == 3


def test_lines_of_one_file_never_share_a_name(tmp_path: Path) -> None:
    document = face()
    binary = add_weights_animation(document, TRIANGLE, "hello", [[0, 0], [1, 0.5]])
    source, target = face_glb(tmp_path, document, binary), tmp_path / "out.glb"
    lines = [line(speech(["jawOpen"]), name) for name in ("hello", "hello_en")]
    FORMAT.write(FORMAT.load(source), lines, target)
    names = Reader(target).animation_names()
    assert len(set(names)) == len(names) == 3


@pytest.mark.parametrize("suffix", [".glb", ".gltf"])
def test_our_own_animation_is_replaced_when_our_output_is_the_source(
    suffix: str, tmp_path: Path
) -> None:
    if suffix == ".glb":
        source = face_glb(tmp_path / "in")
    else:
        source = saved(tmp_path / "in" / "face.gltf", external_buffer(tmp_path / "in"))
    first, second = tmp_path / "one" / f"face{suffix}", tmp_path / "two" / f"face{suffix}"
    lines = [line(speech(["jawOpen"], seed=1), name) for name in ("hello", "bye")]
    FORMAT.write(FORMAT.load(source), lines, first)
    animate(first, second, speech(["mouthClose"], seed=2), origin=source)
    assert Reader(second).animation_names() == ["hello", "bye"]
    require_played(Reader(second), "bye", lines[1].curves, FORMAT.load(source).canonical)


FOREIGN = {
    "normalized bytes": {"dtype": "u1"},
    "normalized shorts": {"dtype": "<u2"},
    "steps": {"interpolation": "STEP"},
}


@pytest.mark.parametrize("case", FOREIGN)
def test_our_animation_is_readable_whatever_format_others_have(case: str, tmp_path: Path) -> None:
    document = face()
    binary = add_weights_animation(document, TRIANGLE, "theirs", [[0, 0], [9, 9]], **FOREIGN[case])
    animate(face_glb(tmp_path, document, binary), tmp_path / "out.glb")


def test_our_animation_is_readable_beside_one_with_sparse_values(tmp_path: Path) -> None:
    document = face()
    binary = add_weights_animation(document, TRIANGLE, "theirs", [[0, 0], [1, 1]])
    sampler = document["animations"][0]["samplers"][0]
    values = document["accessors"][sampler["output"]]
    view = values.pop("bufferView")
    values["sparse"] = {
        "count": 1,
        "indices": {"bufferView": view, "componentType": 5125},
        "values": {"bufferView": view},
    }
    animate(face_glb(tmp_path, document, binary), tmp_path / "out.glb")


@pytest.mark.parametrize(
    "broken",
    [
        {"channels": [{"sampler": 9, "target": {"node": 0, "path": "weights"}}]},
        {"channels": [{"sampler": 0, "target": {"path": "weights"}}]},
        {"channels": [{"sampler": 0}]},
        {"channels": None},
        {"samplers": [{"input": 99, "output": 99}]},
        {"samplers": [{}]},
    ],
    ids=str,
)
def test_broken_animations_of_others_raise_nothing_but_input_errors(
    broken: Json, tmp_path: Path
) -> None:
    document = face()
    binary = add_weights_animation(document, TRIANGLE, "theirs", [[0, 0], [1, 1]])
    document["animations"][0] |= broken
    source = face_glb(tmp_path, document, binary)
    try:
        character = FORMAT.load(source)
        FORMAT.write(character, [line(speech(["jawOpen"]))], tmp_path / "out.glb")
        FORMAT.read_animations(tmp_path / "out.glb")
    except InputError as error:
        assert error.code == "asset-unreadable"  # noqa: PT017
