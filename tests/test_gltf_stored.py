"""Weights of others are read in whatever form glTF allows; what is broken is told."""

from __future__ import annotations

import tracemalloc
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from animeme.validation import validate
from support.gltf_build import (
    BIN_KIND,
    TRIANGLE,
    Json,
    add_accessor,
    add_weights_animation,
    face,
    glb,
)
from support.gltf_kit import FORMAT, saved
from support.judges import khronos_findings, three_weights

WEIGHTS = np.array([[0.0, 1.0], [0.25, 0.0], [0.75, 0.5], [0.0, 1.0]])
AT_S = np.linspace(0, 3, 20)


def dense(document: Json, binary: bytes, dtype: str) -> bytes:
    """The weights as they are, or as whole numbers that stand for fractions."""
    most = 1 if dtype == "<f4" else np.iinfo(dtype).max
    weights = WEIGHTS if most == 1 else np.round(WEIGHTS * most)
    return add_weights_animation(document, binary, "theirs", weights.tolist(), dtype=dtype)


def sparse(document: Json, binary: bytes, dtype: str, *, based: bool) -> bytes:
    """Zeros, stored or not, with the weights that are none in their places."""
    binary = dense(document, binary, dtype)
    output = document["accessors"][document["animations"][0]["samplers"][0]["output"]]
    places = np.flatnonzero(WEIGHTS)
    most = 1 if dtype == "<f4" else np.iinfo(dtype).max
    indices, binary = add_accessor(document, binary, places, dtype="<u2")
    values, binary = add_accessor(document, binary, WEIGHTS.flat[places] * most, dtype=dtype)
    zeros, binary = add_accessor(document, binary, np.zeros(WEIGHTS.size), dtype=dtype)
    views = [document["accessors"][i]["bufferView"] for i in (indices, values, zeros)]
    del document["accessors"][indices:]
    output["sparse"] = {
        "count": len(places),
        "indices": {"bufferView": views[0], "componentType": 5123},
        "values": {"bufferView": views[1]},
    }
    if based:
        output["bufferView"] = views[2]
    else:
        del output["bufferView"]
    return binary


def strided(document: Json, binary: bytes) -> bytes:
    """Each weight between others that are none of them."""
    binary = dense(document, binary, "<f4")
    output = document["accessors"][document["animations"][0]["samplers"][0]["output"]]
    apart = np.full((WEIGHTS.size, 2), 7.0)
    apart[:, 1] = WEIGHTS.ravel()
    other, binary = add_accessor(document, binary, apart)
    output |= {"bufferView": document["accessors"].pop(other)["bufferView"], "byteOffset": 4}
    document["bufferViews"][-1]["byteStride"] = 8
    return binary


FORMS: dict[str, Any] = {
    "floats": lambda d, b: dense(d, b, "<f4"),
    "bytes": lambda d, b: dense(d, b, "u1"),
    "signed bytes": lambda d, b: dense(d, b, "i1"),
    "shorts": lambda d, b: dense(d, b, "<u2"),
    "signed shorts": lambda d, b: dense(d, b, "<i2"),
    "sparse": lambda d, b: sparse(d, b, "<f4", based=True),
    "sparse over nothing": lambda d, b: sparse(d, b, "<f4", based=False),
    "sparse shorts": lambda d, b: sparse(d, b, "<u2", based=False),
}


def made(folder: Path, form: Any) -> Path:
    document = face()
    binary = form(document, TRIANGLE)
    document["buffers"][0]["byteLength"] = len(binary)
    return saved(folder / "theirs.glb", glb(document, (BIN_KIND, binary)))


@pytest.mark.parametrize("case", [*FORMS, "strided"])
def test_weights_are_read_in_any_form(case: str, tmp_path: Path) -> None:
    file = made(tmp_path, FORMS.get(case, strided))
    (track,) = FORMAT.stored(FORMAT.load(file))
    assert track.fault == ("", "")
    np.testing.assert_allclose(track.weights, WEIGHTS, atol=0.5 / 127)
    np.testing.assert_allclose(track.times_s, [0, 1, 2, 3])
    curves = FORMAT.read_animations(file)["theirs"]
    np.testing.assert_allclose(curves.weights, WEIGHTS, atol=0.5 / 127)
    found = {finding.code for finding in validate([file]).all_findings}
    assert not found & {"animation-broken", "weights-count", "animation-compressed"}


@pytest.mark.slow
@pytest.mark.parametrize("case", FORMS)
def test_others_read_the_same_weights(case: str, tmp_path: Path) -> None:
    file = made(tmp_path, FORMS[case])
    codes = {code for _, code in khronos_findings(file)[file]}
    assert not {code for code in codes if "ACCESSOR" in code or "ANIMATION" in code}
    curves = FORMAT.read_animations(file)["theirs"]
    (played,) = three_weights(file, "theirs", AT_S).values()
    np.testing.assert_allclose(played, curves.sample(AT_S), atol=1e-6)


def broken(**members: Any) -> Any:
    """A sparse form with members of its accessor changed; "a.b" is b of a."""

    def form(document: Json, binary: bytes) -> bytes:
        binary = sparse(document, binary, "<f4", based=False)
        output = document["accessors"][document["animations"][0]["samplers"][0]["output"]]
        for path, value in members.items():
            *outer, name = path.split("__")
            holder = output
            for step in outer:
                holder = holder[step]
            holder[name] = value
        return binary

    return form


@pytest.mark.parametrize(
    "form",
    [
        broken(count=2**40),
        broken(count=-1),
        broken(sparse__count=2**40),
        broken(sparse__indices__componentType=5126),
        broken(sparse__indices__bufferView=99),
        broken(sparse__values__byteOffset=-8),
        broken(sparse=[]),
        broken(componentType=5125),
        broken(componentType=5123),  # whole numbers, and no word that they stand for fractions
    ],
)
def test_a_broken_form_is_told_and_takes_no_memory(form: Any, tmp_path: Path) -> None:
    character = FORMAT.load(made(tmp_path, form))
    tracemalloc.start()
    try:
        (track,) = FORMAT.stored(character)
        assert FORMAT.read_animations(character.source) == {}
        assert tracemalloc.get_traced_memory()[1] < 1_000_000
    finally:
        tracemalloc.stop()
    assert track.fault[0] == "animation-broken"


def test_what_is_compressed_is_not_called_broken(tmp_path: Path) -> None:
    def form(document: Json, binary: bytes) -> bytes:
        binary = dense(document, binary, "<f4")
        extension = {"buffer": 0, "byteOffset": 0, "byteLength": 8, "byteStride": 4, "count": 8}
        view = document["bufferViews"][-1]
        view["extensions"] = {"EXT_meshopt_compression": extension | {"mode": "ATTRIBUTES"}}
        return binary

    report = validate([made(tmp_path, form)])
    found = {finding.code: finding.severity.label for finding in report.all_findings}
    assert found.get("animation-compressed") == "info"
    assert "animation-broken" not in found
