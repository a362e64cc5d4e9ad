"""JSON as people write it: what is not ours stays as it was written."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest

from animeme.errors import InputError
from support.gltf_build import (
    BIN_KIND,
    TRIANGLE,
    add_weights_animation,
    bin_of,
    data_uri,
    face,
    glb,
    text_of,
)
from support.gltf_kit import FORMAT, animate, face_glb, line, saved, speech


def odd_text() -> str:
    """A face whose JSON holds every form that parsing and dumping would change."""
    text = json.dumps(face(), indent=1)
    odd = r"""
 "extensionsUsed" : [ "VENDOR_x" ],
 "extensions": {"VENDOR_x": {"null": null, "deep": [[[{}]]], "é\u0000\ud83d\ude00": "\/\u00e9"}},
 "extras": {"n": [1.0, 1e-7, -0.0, 1E+5, 12345678901234567890, 0.10, -0, 1e400, 100 , ] },
 "twin": 1, "twin": 2.50, "\u0061": 1, "a": 2,
 "samplers": [ ], "unknown": {"accessors": [1, 2], "animations": [] },
""".replace(", ] }", " ] }")
    return "{" + odd + text[1:].replace("}", "\t}\r\n")


@pytest.mark.parametrize("suffix", [".glb", ".gltf"])
def test_numbers_escapes_twins_and_white_space_stay_as_written(suffix: str, tmp_path: Path) -> None:
    text = odd_text()
    if suffix == ".glb":
        source = face_glb(tmp_path, text)
    else:
        old = '"byteLength": 36'
        text = text.replace(old, f'"uri": "{data_uri(TRIANGLE)}", {old}', 1)
        source = saved(tmp_path / "face.gltf", text + "\n")
    target = tmp_path / f"out{suffix}"
    animate(source, target, plain=True)
    written = text_of(target)
    for piece in ("1.0, 1e-7, -0.0, 1E+5, 12345678901234567890, 0.10, -0, 1e400, 100", r"\/\u00e9"):
        assert piece in written
    assert '"twin": 1, "twin": 2.50, "\\u0061": 1, "a": 2' in written


def test_a_gltf_keeps_its_last_line_end(tmp_path: Path) -> None:
    document = face(buffers=[{"byteLength": 36, "uri": data_uri(TRIANGLE)}])
    source = saved(tmp_path / "face.gltf", json.dumps(document, indent=2) + "\n")
    animate(source, tmp_path / "out.gltf")
    assert (tmp_path / "out.gltf").read_bytes().endswith(b"}\n")


@pytest.mark.parametrize("extras", [None, 1.50, "text", "an animeme", ["targetNames"], True])
def test_extras_that_are_no_objects_are_kept(extras: Any, tmp_path: Path) -> None:
    document = face(extras=extras)
    document["nodes"][0]["extras"] = extras
    document["meshes"][0]["primitives"][0]["extras"] = extras
    binary = add_weights_animation(document, TRIANGLE, "wave", [[0, 0], [1, 0]])
    document["animations"][0]["extras"] = extras
    animate(face_glb(tmp_path, document, binary), tmp_path / "out.glb", plain=True)


def test_a_foreign_animation_whose_extras_mention_us_may_not_change(tmp_path: Path) -> None:
    document = face()
    binary = add_weights_animation(document, TRIANGLE, "wave", [[0, 0], [1, 0]])
    document["animations"][0]["extras"] = "made before animeme came"
    source = face_glb(tmp_path, document, binary)
    target = tmp_path / "out.glb"
    animate(source, target, plain=True)
    saved(
        target, glb(text_of(target).replace('"wave"', '"gone"'), (BIN_KIND, bin_of(target) or b""))
    )
    assert FORMAT.harm(FORMAT.load(source), target)


def test_what_json_calls_no_number_does_no_false_harm(tmp_path: Path) -> None:
    text = json.dumps(face())[:-1] + ', "extras": {"x": NaN, "y": -Infinity}}'
    source = face_glb(tmp_path, text)
    try:
        character = FORMAT.load(source)
    except InputError:
        return
    target = tmp_path / "out.glb"
    FORMAT.write(character, [line(speech(["jawOpen"]))], target)
    assert FORMAT.harm(character, target) == []


def test_empty_lists_grow(tmp_path: Path) -> None:
    document = face(buffers=[], bufferViews=[], accessors=[], animations=[])
    text = json.dumps(document).replace("[]", "[ \n ]")
    source = saved(tmp_path / "face.glb", glb(text))
    animate(source, tmp_path / "out.glb")
