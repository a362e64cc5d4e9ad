"""Files crafted to take all memory or time: refused, or done without much of either."""

from __future__ import annotations

import tracemalloc
from pathlib import Path
from typing import Any

import pytest

from animeme.errors import InputError
from animeme_stages.write.gltf import GltfFormat
from support.gltf_build import (
    BIN_KIND,
    TRIANGLE,
    Json,
    add_weights_animation,
    document_of,
    face,
    glb,
    split_glb,
)
from support.gltf_kit import FORMAT, face_glb, line, saved, speech

MOST_BYTES = 50_000_000


def ours(folder: Path) -> tuple[Json, list[tuple[bytes, bytes]]]:
    """Document and chunks of an output, to be tampered with."""
    FORMAT.write(FORMAT.load(face_glb(folder)), [line(speech(["jawOpen"]))], folder / "ours.glb")
    return document_of(folder / "ours.glb"), split_glb((folder / "ours.glb").read_bytes())[1]


def read(form: GltfFormat, path: Path) -> None:
    """Look at a file before it takes its name, as a run does."""
    form.read_animations(path)


@pytest.mark.parametrize("member", ["count", "byteOffset"])
@pytest.mark.parametrize("value", [2**31, 2**53, 10**30, -(2**40), 1e300, "9", None, [9]])
def test_a_crafted_accessor_takes_no_memory(member: str, value: Any, tmp_path: Path) -> None:
    document, chunks = ours(tmp_path)
    for accessor in document["accessors"][1:]:
        accessor[member] = value
    crafted = saved(tmp_path / "crafted.glb", glb(document, *chunks))
    tracemalloc.start()
    try:
        with pytest.raises(InputError, match="asset-unreadable"):
            FORMAT.read_animations(crafted)
        character, lines = FORMAT.load(crafted), [line(speech(["jawOpen"]), "bye")]
        with pytest.raises(InputError, match="asset-unreadable"):
            FORMAT.write(character, lines, tmp_path / "out.glb", verify=lambda p: read(FORMAT, p))
        assert tracemalloc.get_traced_memory()[1] < MOST_BYTES
    finally:
        tracemalloc.stop()
    assert not (tmp_path / "out.glb").exists()


@pytest.mark.parametrize("place", ["buffers", "bufferViews"])
def test_a_crafted_length_takes_no_memory(place: str, tmp_path: Path) -> None:
    document = face()
    binary = add_weights_animation(document, TRIANGLE, "wave", [[0, 0], [1, 0]])
    document[place][0]["byteLength"] = 2**52
    source = saved(tmp_path / "face.glb", glb(document, (BIN_KIND, binary)))
    tracemalloc.start()
    try:
        FORMAT.write(FORMAT.load(source), [line(speech(["jawOpen"]))], tmp_path / "out.glb")
        FORMAT.read_animations(tmp_path / "out.glb")
        FORMAT.strip(tmp_path / "out.glb", tmp_path / "out.glb")
        assert tracemalloc.get_traced_memory()[1] < MOST_BYTES
    finally:
        tracemalloc.stop()
    assert (tmp_path / "out.glb").read_bytes() == source.read_bytes()


@pytest.mark.parametrize("depth", [300, 900, 990, 5000])
def test_deep_nesting_is_kept_or_refused(depth: int, tmp_path: Path) -> None:
    text = glb(face(), (BIN_KIND, TRIANGLE))
    document, chunks = split_glb(text)
    deep = document.rstrip()[:-1] + ', "x": ' + "[" * depth + "]" * depth + "}"
    source = saved(tmp_path / "deep.glb", glb(deep, *chunks))
    target = tmp_path / "out" / "deep.glb"
    try:
        character = FORMAT.load(source)
        FORMAT.write(character, [line(speech(["jawOpen"]))], target)
    except InputError as error:
        assert error.code == "asset-unreadable"  # noqa: PT017
        assert not target.exists()
        return
    assert FORMAT.harm(character, target) == []
    FORMAT.strip(target, target)
    assert target.read_bytes() == source.read_bytes()


def test_memory_does_not_grow_with_the_asset(tmp_path: Path) -> None:
    size = 60_000_000
    document = face()
    document["buffers"][0]["byteLength"] = 36 + size
    source = saved(tmp_path / "large.glb", glb(document, (BIN_KIND, TRIANGLE + bytes(size))))
    del document
    target = tmp_path / "out.glb"
    tracemalloc.start()
    try:
        character = FORMAT.load(source)
        FORMAT.write(character, [line(speech(["jawOpen"]))], target)
        assert FORMAT.harm(character, target) == []
        FORMAT.strip(target, target)
        assert tracemalloc.get_traced_memory()[1] < 10_000_000
    finally:
        tracemalloc.stop()
