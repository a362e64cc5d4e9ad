"""Every form of container that glTF comes in, whole and damaged."""

from __future__ import annotations

import json
import struct
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from animeme.errors import InputError
from support.gltf_build import BIN_KIND, TRIANGLE, Reader, bin_of, data_uri, face, glb, mesh
from support.gltf_kit import (
    FORMAT,
    animate,
    external_buffer,
    face_glb,
    line,
    require_kept,
    saved,
    speech,
)


def test_a_glb_gets_its_animation_behind_the_old_bytes(tmp_path: Path) -> None:
    source = face_glb(tmp_path)
    reader = animate(source, tmp_path / "out" / "face.glb")
    (animation,) = reader.root["animations"]
    assert animation["name"] == "hello"
    assert {s["input"] for s in animation["samplers"]} == {animation["samplers"][0]["input"]}
    times = reader.root["accessors"][animation["samplers"][0]["input"]]
    assert times["min"] == [0.0]
    assert times["max"] == [3.0]


CONTAINERS: dict[str, Callable[[Path], bytes]] = {
    "BIN longer than byteLength": lambda _: glb(face(), (BIN_KIND, TRIANGLE + b"\7" * 60)),
    "BIN that ends off a multiple of four": lambda _: glb(
        face(buffers=[{"byteLength": 38}]), (BIN_KIND, TRIANGLE + b"\1\2")
    ),
    "no BIN, data URI": lambda _: glb(
        face(buffers=[{"byteLength": 36, "uri": data_uri(TRIANGLE)}])
    ),
    "no BIN, empty buffers": lambda _: glb(face(buffers=[], bufferViews=[], accessors=[])),
    "no BIN, no buffers": lambda _: glb(
        {k: v for k, v in face().items() if k not in ("buffers", "bufferViews", "accessors")}
    ),
    "no BIN, file": lambda folder: glb(external_buffer(folder)),
    "no BIN, chunk of another kind": lambda _: glb(
        face(buffers=[], bufferViews=[], accessors=[]), (b"XTRA", b"12345678")
    ),
    "BIN and another chunk": lambda _: glb(
        face(), (BIN_KIND, TRIANGLE), (b"XTRA", b"1234"), (b"MORE", b"")
    ),
    "BIN that no buffer is for": lambda _: glb(
        face(buffers=[], bufferViews=[], accessors=[]), (BIN_KIND, b"\1\2\3\4" * 3)
    ),
    "BIN beside a first buffer in a file": lambda folder: glb(
        external_buffer(folder), (BIN_KIND, b"\1\2\3\4" * 3)
    ),
    "second buffer in a data URI": lambda _: glb(
        face(buffers=[{"byteLength": 36}, {"byteLength": 3, "uri": data_uri(b"abc")}]),
        (BIN_KIND, TRIANGLE),
    ),
}


@pytest.mark.parametrize("case", CONTAINERS)
def test_every_form_of_container_takes_an_animation(case: str, tmp_path: Path) -> None:
    source = saved(tmp_path / "in" / "face.glb", CONTAINERS[case](tmp_path / "in"))
    animate(source, tmp_path / "out" / "face.glb")


def test_values_are_aligned_even_behind_a_chunk_of_odd_length(tmp_path: Path) -> None:
    text = json.dumps(face(buffers=[{"byteLength": 38}])).encode()
    text += b" " * (-len(text) % 4)
    binary = TRIANGLE + b"\1\2"
    chunks = struct.pack("<I4s", len(text), b"JSON") + text
    chunks += struct.pack("<I4s", len(binary), BIN_KIND) + binary
    header = struct.pack("<4sII", b"glTF", 2, 12 + len(chunks))
    source, target = saved(tmp_path / "face.glb", header + chunks), tmp_path / "out.glb"
    try:
        FORMAT.write(FORMAT.load(source), [line(speech(["jawOpen"]))], target)
    except InputError:
        return
    assert (bin_of(target) or b"").startswith(binary)  # checks the new chunk's length, too
    Reader(target).weights("hello", np.zeros(1))


def test_a_vrm_is_a_glb(tmp_path: Path) -> None:
    source = saved(tmp_path / "face.vrm", glb(face(), (BIN_KIND, TRIANGLE)))
    assert FORMAT.output_suffix(source) == ".vrm"
    animate(source, tmp_path / "out.vrm")


DAMAGED = {
    "empty": b"",
    "header cut": glb(face())[:10],
    "version 1": b"glTF" + struct.pack("<II", 1, 12),
    "shorter than it says": glb(face(), (BIN_KIND, TRIANGLE))[:-4],
    "bytes behind the end": glb(face()) + b"\0\0\0\0",
    "BIN first": struct.pack("<4sIII4s4s", b"glTF", 2, 24, 4, BIN_KIND, b"1234"),
    "chunk leaves the file": struct.pack("<4sII", b"glTF", 2, 20)
    + struct.pack("<I4s", 99, b"JSON"),
    "no JSON": glb("nonsense"),
    "JSON array": glb("[]"),
    "no asset": glb("{}"),
    "asset null": glb('{"asset":null}'),
    "glTF 1.0": glb('{"asset":{"version":"1.0"}}'),
    "not UTF-8": struct.pack("<4sII", b"glTF", 2, 24)
    + struct.pack("<I4s", 4, b"JSON")
    + b'"\xff" ',
    "number of 5000 digits": glb('{"asset":{"version":"2.0"},"extras":' + "1" * 5000 + "}"),
    "deep nesting": glb('{"asset":{"version":"2.0"},"x":' + "[" * 100_000 + "]" * 100_000 + "}"),
    "no mesh": glb({"asset": {"version": "2.0"}}),
    "no targets": glb(face(meshes=[mesh(0, None)])),
    "mesh index out of range": glb(face(nodes=[{"mesh": 7}])),
    "negative mesh index": glb(face(nodes=[{"mesh": -1}])),
    "mesh index no integer": glb(face(nodes=[{"mesh": 0.5}])),
    "null nodes": glb(face(nodes=None)),
    "null node": glb(face(nodes=[None])),
    "null animations": glb(face(animations=None)),
    "null animation": glb(face(animations=[None])),
    "too few weights": glb(face(nodes=[{"mesh": 0, "weights": [0.0]}])),
    "weight out of range": glb(
        json.dumps(face(nodes=[{"mesh": 0, "weights": [0, 111]}])).replace("111", "1e400")
    ),
    "weight of 400 digits": glb(face(nodes=[{"mesh": 0, "weights": [0, 10**400]}])),
    "weights of text": glb(face(nodes=[{"mesh": 0, "weights": ["a", "b"]}])),
    "meshes is an object": glb(face(meshes={})),
}


@pytest.mark.parametrize("case", DAMAGED)
def test_a_damaged_file_is_refused_when_loaded(case: str, tmp_path: Path) -> None:
    source = saved(tmp_path / "face.glb", DAMAGED[case])
    with pytest.raises(InputError) as caught:
        FORMAT.load(source)
    assert caught.value.place == str(source)
    assert caught.value.code == (
        "asset-no-blendshapes" if case in ("no mesh", "no targets") else "asset-unreadable"
    )


@pytest.mark.parametrize("member", ["buffers", "images", "bufferViews", "accessors"])
@pytest.mark.parametrize("value", [None, {}, [None]])
def test_lists_that_are_none_are_refused_and_nothing_is_written(
    member: str, value: Any, tmp_path: Path
) -> None:
    source = face_glb(tmp_path / "in", face(**{member: value}))
    target = tmp_path / "out" / "face.glb"
    try:
        character = FORMAT.load(source)
        FORMAT.write(character, [line(speech(["jawOpen"]))], target)
    except InputError as error:
        assert error.code == "asset-unreadable"  # noqa: PT017
        assert not target.exists()
    else:
        require_kept(source, target)


def test_a_missing_file_is_an_input_error(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="asset-unreadable"):
        FORMAT.load(tmp_path / "none.glb")
