"""The glTF format, seen from outside: what was there stays, what was asked for plays."""

from __future__ import annotations

import json
import struct
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any
from urllib.parse import quote

import numpy as np
import pytest

from animeme.contracts import LineAnimation
from animeme.curves import CurveSet
from animeme.errors import InputError
from animeme_stages.write.gltf import GltfFormat
from support.gltf_build import (
    BIN_KIND,
    TRIANGLE,
    Json,
    Reader,
    add_weights_animation,
    bin_of,
    data_uri,
    document_of,
    face,
    glb,
    kept,
    mesh,
    raw_tree,
    split_glb,
    text_of,
)

FORMAT = GltfFormat()
SHARED = Path(__file__).parents[2] / "shared" / "assets"
REAL = sorted(
    path
    for folder in ("gltf", "vrm")
    for path in (SHARED / folder).rglob("*")
    if path.suffix in (".glb", ".gltf", ".vrm", ".vrma")
)
# Times are float32 in the file: 2.4e-7 s at 3 s, and the test's curves rise by 50/s at most.
CLOSE = 2e-5


def speech(names: Sequence[str], *, seed: int = 0, keys: int = 12) -> CurveSet:
    """Any curves: irregular keys from 0 to 3 s, weights from 0 to 1."""
    random = np.random.default_rng(seed)
    times_s = np.concatenate([[0.0], np.cumsum(random.uniform(0.02, 1.0, keys - 1))])
    times_s *= 3.0 / times_s[-1]
    return CurveSet(times_s, tuple(names), random.uniform(0, 1, (keys, len(names))))


def line(curves: CurveSet, name: str = "hello") -> LineAnimation:
    return LineAnimation(name, "en", curves, curves.duration_s)


def saved(path: Path, data: bytes | str | Mapping[str, Any]) -> Path:
    path.parent.mkdir(parents=True, exist_ok=True)
    if isinstance(data, bytes):
        path.write_bytes(data)
    else:
        path.write_text(data if isinstance(data, str) else json.dumps(data), newline="")
    return path


def face_glb(folder: Path, document: Json | str | None = None, binary: bytes = TRIANGLE) -> Path:
    return saved(folder / "face.glb", glb(document or face(), (BIN_KIND, binary)))


def animate(
    source: Path, target: Path, curves: CurveSet | None = None, *, plain: bool = False
) -> Reader:
    """Write one line, and require everything that holds for every asset."""
    before = source.read_bytes()
    character = FORMAT.load(source)
    curves = curves or speech(character.shapes[:1])
    written = FORMAT.write(character, [line(curves)], target)
    assert source.read_bytes() == before
    assert written[0] == target
    assert all(path.is_file() for path in written)
    assert FORMAT.harm(character, target) == []
    require_kept(source, target)
    name = "hello_en" if "hello" in foreign_names(source) else "hello"
    reader = Reader(target, plain=plain)
    require_played(reader, name, curves, character.canonical)
    np.testing.assert_allclose(
        FORMAT.read_animations(target)[name].sample(curves.times_s)[
            :, [FORMAT.read_animations(target)[name].names.index(n) for n in curves.names]
        ],
        curves.weights,
        atol=CLOSE,
    )
    return reader


def is_mine(animation: Mapping[str, Any]) -> bool:
    extras = animation.get("extras")
    return isinstance(extras, dict) and "animeme" in extras


def foreign_names(path: Path) -> list[Any]:
    return [a.get("name") for a in document_of(path).get("animations", []) if not is_mine(a)]


def require_kept(source: Path, target: Path) -> None:
    """Every old value, byte and file of `source` is in `target`."""
    root = document_of(source)
    buffers = root.get("buffers", [])
    mine = {f"/animations/{i}" for i, a in enumerate(root.get("animations", [])) if is_mine(a)}
    binary = source.read_bytes()[:4] == b"glTF"
    if binary and bin_of(source) is not None and "uri" not in (buffers or [{}])[0]:
        mine.add("/buffers/0/byteLength")
    assert kept(raw_tree(text_of(source)), raw_tree(text_of(target)), mine=mine) == []
    if binary:
        old = split_glb(source.read_bytes())[1]
        new = split_glb(target.read_bytes())[1]
        grown = [data for kind, data in new if kind == BIN_KIND]
        for kind, data in old:
            if kind == BIN_KIND:
                assert grown[0].startswith(data)
            else:
                assert (kind, data) in new
        if "/buffers/0/byteLength" in mine:
            assert len(grown[0]) > len(bin_of(source) or b"")
    for holder in [*buffers, *root.get("images", [])]:
        uri = holder.get("uri", "data:")
        if not uri.startswith("data:") and (source.parent / uri).is_file():
            assert (target.parent / uri).read_bytes() == (source.parent / uri).read_bytes()


def owners(root: Json) -> dict[int, tuple[list[str] | None, list[float]]]:
    """Node → target names (None where the file has none) and rest weights, from the JSON alone."""
    found = {}
    for index, node in enumerate(root["nodes"]):
        shape = root["meshes"][node["mesh"]] if "mesh" in node else {"primitives": []}
        count = max((len(p.get("targets", [])) for p in shape["primitives"]), default=0)
        if count:
            carriers = [shape, *shape["primitives"]]
            extras = [c["extras"] for c in carriers if isinstance(c.get("extras"), dict)]
            names = next((e["targetNames"] for e in extras if "targetNames" in e), None)
            rest = node.get("weights") or shape.get("weights") or [0.0] * count
            found[index] = names, rest
    return found


def require_played(
    reader: Reader, name: str, curves: CurveSet, canonical: Mapping[str, str]
) -> None:
    """At any time the file plays the curves; undriven targets keep their rest weight."""
    at = np.concatenate([curves.times_s, np.linspace(-0.5, curves.duration_s + 1, 200)])
    wanted = dict(zip(curves.names, curves.sample(at).T, strict=True))
    played = reader.weights(name, at)
    driven = set()
    for node, (names, rest) in owners(document_of(reader.path)).items():
        names = names or [f"target_{i}" for i in range(len(rest))]
        own = [canonical[n] for n in names]
        if not set(own) & set(wanted):
            assert node not in played
            continue
        driven |= set(own) & set(wanted)
        expected = [wanted.get(n, np.full(len(at), r)) for n, r in zip(own, rest, strict=True)]
        np.testing.assert_allclose(played[node], np.stack(expected, axis=1), atol=CLOSE)
        played.pop(node)
    assert played == {}
    assert driven == set(wanted)


# Containers


def test_a_glb_gets_its_animation_behind_the_old_bytes(tmp_path: Path) -> None:
    source = face_glb(tmp_path)
    reader = animate(source, tmp_path / "out" / "face.glb")
    (animation,) = reader.root["animations"]
    assert animation["name"] == "hello"
    assert {s["input"] for s in animation["samplers"]} == {animation["samplers"][0]["input"]}
    times = reader.root["accessors"][animation["samplers"][0]["input"]]
    assert times["min"] == [0.0]
    assert times["max"] == [3.0]


def external_buffer(folder: Path, binary: bytes = TRIANGLE) -> Json:
    saved(folder / "face.bin", binary)
    return face(buffers=[{"uri": "face.bin", "byteLength": len(binary)}])


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


# JSON as people write it


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


# Names and meshes


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


def test_every_node_of_a_shared_mesh_is_driven_with_its_own_rest(tmp_path: Path) -> None:
    document = face(
        nodes=[{"mesh": 0}, {"mesh": 0, "weights": [0.25, 0.75]}, {"mesh": 0}, {"name": "empty"}],
        scenes=[{"nodes": [0, 1, 2, 3]}],
    )
    document["meshes"][0]["weights"] = [0.5, 0.125]
    reader = animate(face_glb(tmp_path, document), tmp_path / "out.glb", speech(["mouthClose"]))
    (animation,) = reader.root["animations"]
    samplers = {c["target"]["node"]: c["sampler"] for c in animation["channels"]}
    assert samplers[0] == samplers[2] != samplers[1]


def test_a_node_without_driven_shapes_gets_no_channel(tmp_path: Path) -> None:
    document = face(
        nodes=[{"mesh": 0}, {"mesh": 1}, {"mesh": 2}],
        meshes=[mesh(1, ["jawOpen"]), mesh(1, ["blink"]), mesh(0, None)],
    )
    reader = animate(face_glb(tmp_path, document), tmp_path / "out.glb", speech(["jawOpen"]))
    assert [c["target"]["node"] for c in reader.root["animations"][0]["channels"]] == [0]


def test_copies_that_an_exporter_numbered_move_together(tmp_path: Path) -> None:
    document = face(
        nodes=[{"mesh": 0}, {"mesh": 1}, {"mesh": 2}],
        meshes=[
            mesh(2, ["jawOpen", "smile"]),
            mesh(1, ["jawOpen2"]),
            mesh(2, ["smile.001", "jawOpen.001"]),
        ],
    )
    reader = animate(face_glb(tmp_path, document), tmp_path / "out.glb", speech(["jawOpen"]))
    assert {c["target"]["node"] for c in reader.root["animations"][0]["channels"]} == {0, 1, 2}


def test_primitives_of_a_mesh_share_one_channel(tmp_path: Path) -> None:
    document = face(meshes=[mesh(3, ["a", "b", "c"], primitives=3)])
    reader = animate(face_glb(tmp_path, document), tmp_path / "out.glb", speech(["c", "a"]))
    assert len(reader.root["animations"][0]["channels"]) == 1


@pytest.mark.parametrize("names", [['quote"d'], ["line\nbreak"], ["😀"], ["é", "e\u0301"], [""]])
def test_any_string_can_be_a_name(names: list[str], tmp_path: Path) -> None:
    animate(face_glb(tmp_path, face(names)), tmp_path / "out.glb", speech(names[-1:]))


def test_one_key_is_an_animation(tmp_path: Path) -> None:
    animate(face_glb(tmp_path), tmp_path / "out.glb", CurveSet([0.0], ("jawOpen",), [[0.5]]))


def test_keys_that_coincide_in_float32_stay_increasing(tmp_path: Path) -> None:
    times_s = np.array([0.0, 1.0, 1.0 + 1e-12, 2.0])
    curves = CurveSet(times_s, ("jawOpen",), np.array([[0.0], [0.5], [0.5], [1.0]]))
    reader = animate(face_glb(tmp_path), tmp_path / "out.glb", curves)
    keys = reader.accessor(reader.root["animations"][0]["samplers"][0]["input"])
    assert (np.diff(keys) > 0).all()


def test_every_line_is_an_animation_in_order(tmp_path: Path) -> None:
    source, target = face_glb(tmp_path), tmp_path / "out.glb"
    lines = [line(speech(["jawOpen"], seed=i), f"ä/{i} 😀") for i in range(3)]
    FORMAT.write(FORMAT.load(source), lines, target)
    reader = Reader(target)
    assert reader.animation_names() == [spoken.name for spoken in lines]
    for spoken in lines:
        require_played(reader, spoken.name, spoken.curves, FORMAT.load(source).canonical)


def test_curves_without_names_leave_no_animation_without_channels(tmp_path: Path) -> None:
    source, target = face_glb(tmp_path), tmp_path / "out.glb"
    curves = CurveSet([0.0, 1.0], (), np.zeros((2, 0)))
    FORMAT.write(FORMAT.load(source), [line(curves)], target)
    assert all(a["channels"] and a["samplers"] for a in document_of(target).get("animations", []))


def test_without_lines_nothing_empty_is_added(tmp_path: Path) -> None:
    source, target = face_glb(tmp_path), tmp_path / "out.glb"
    FORMAT.write(FORMAT.load(source), [], target)
    assert all(view["byteLength"] for view in document_of(target)["bufferViews"])


def test_writing_twice_gives_the_same_bytes(tmp_path: Path) -> None:
    source = face_glb(tmp_path)
    animate(source, tmp_path / "a.glb")
    animate(source, tmp_path / "b.glb")
    assert (tmp_path / "a.glb").read_bytes() == (tmp_path / "b.glb").read_bytes()


def test_a_source_can_be_written_over_itself(tmp_path: Path) -> None:
    source = face_glb(tmp_path)
    before = source.read_bytes()
    FORMAT.write(FORMAT.load(source), [line(speech(["jawOpen"]))], source)
    copy = saved(tmp_path / "before.glb", before)
    require_kept(copy, source)


# Animations that were there


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
    animate(first, second, speech(["mouthClose"], seed=2))
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


# Files beside a .gltf


def gltf_with_files(folder: Path, *, buffer: str = "face.bin", image: str = "skin.png") -> Path:
    """A .gltf whose buffer and image are files; `buffer` and `image` are their URIs."""
    return saved(
        folder / "face.gltf",
        face(buffers=[{"uri": buffer, "byteLength": 36}], images=[{"uri": image}]),
    )


@pytest.mark.parametrize(
    ("uri", "name"),
    [
        ("skin.png", "skin.png"),
        ("textures/deep/skin.png", "textures/deep/skin.png"),
        ("./skin.png", "skin.png"),
        ("my%20skin.png", "my skin.png"),
        ("my skin.png", "my skin.png"),
        ("caf%C3%A9.png", "café.png"),
        ("café.png", "café.png"),
        ("a%23b.png", "a#b.png"),
        ("a..b/..c.png", "a..b/..c.png"),
        ("100%25.png", "100%.png"),
    ],
)
def test_files_of_a_gltf_come_along_to_the_same_place(uri: str, name: str, tmp_path: Path) -> None:
    source = gltf_with_files(tmp_path / "in", image=uri)
    saved(tmp_path / "in" / "face.bin", TRIANGLE)
    saved(tmp_path / "in" / name, b"picture")
    target = tmp_path / "out" / "face.gltf"
    animate(source, target)
    written = {p.relative_to(target.parent).as_posix() for p in target.parent.rglob("*.*")}
    assert (target.parent / name).read_bytes() == b"picture"
    assert (target.parent / "face.bin").read_bytes() == TRIANGLE
    new = document_of(target)["buffers"][-1]["uri"]
    files = {path for path in written if (target.parent / path).is_file()}
    assert files == {"face.gltf", "face.bin", name, new}


def test_every_file_written_is_reported(tmp_path: Path) -> None:
    source = gltf_with_files(tmp_path / "in")
    saved(tmp_path / "in" / "face.bin", TRIANGLE)
    saved(tmp_path / "in" / "skin.png", b"picture")
    target = tmp_path / "out" / "face.gltf"
    written = FORMAT.write(FORMAT.load(source), [line(speech(["jawOpen"]))], target)
    assert sorted(written) == sorted(p for p in target.parent.rglob("*") if p.is_file())


@pytest.mark.parametrize("name", ["a b", "a#1", "a?b", "a%20b", "50%", "é😀", "a.b.c", "a+b&c"])
def test_the_new_buffer_is_found_whatever_the_output_is_called(name: str, tmp_path: Path) -> None:
    source = saved(
        tmp_path / "in" / "face.gltf",
        face(buffers=[{"byteLength": 36, "uri": data_uri(TRIANGLE)}]),
    )
    animate(source, tmp_path / "out" / f"{name}.gltf")


def test_a_gltf_in_its_own_folder_needs_no_copies(tmp_path: Path) -> None:
    source = saved(tmp_path / "face.gltf", external_buffer(tmp_path))
    animate(source, tmp_path / "talking.gltf")
    assert (tmp_path / "face.bin").read_bytes() == TRIANGLE


def test_a_new_export_of_the_asset_replaces_what_the_last_run_copied(tmp_path: Path) -> None:
    source = gltf_with_files(tmp_path / "in")
    saved(tmp_path / "in" / "face.bin", TRIANGLE)
    saved(tmp_path / "in" / "skin.png", b"first")
    animate(source, tmp_path / "out" / "face.gltf")
    saved(tmp_path / "in" / "skin.png", b"second")
    animate(source, tmp_path / "out" / "face.gltf")
    assert (tmp_path / "out" / "skin.png").read_bytes() == b"second"


def test_a_new_export_replaces_what_all_files_of_one_asset_share(tmp_path: Path) -> None:
    source = gltf_with_files(tmp_path / "in")
    saved(tmp_path / "in" / "face.bin", TRIANGLE)
    for picture in (b"first", b"second"):
        saved(tmp_path / "in" / "skin.png", picture)
        for name in ("line1", "line2", "line3"):
            animate(source, tmp_path / "out" / f"{name}.gltf")
        assert (tmp_path / "out" / "skin.png").read_bytes() == picture


def test_a_new_export_of_a_glb_replaces_the_image_beside_it(tmp_path: Path) -> None:
    source = face_glb(tmp_path / "in", face(images=[{"uri": "skin.png"}]))
    for picture in (b"first", b"second"):
        saved(tmp_path / "in" / "skin.png", picture)
        animate(source, tmp_path / "out" / "face.glb")
        assert (tmp_path / "out" / "skin.png").read_bytes() == picture


def test_an_image_that_a_glb_of_another_asset_uses_is_not_replaced(tmp_path: Path) -> None:
    first = face_glb(tmp_path / "a", face(images=[{"uri": "skin.png"}]))
    second = gltf_with_files(tmp_path / "b")
    saved(tmp_path / "b" / "face.bin", TRIANGLE)
    for folder in ("a", "b"):
        saved(tmp_path / folder / "skin.png", b"same")
    animate(first, tmp_path / "out" / "a.glb")
    animate(second, tmp_path / "out" / "b.gltf")
    saved(tmp_path / "b" / "skin.png", b"new")
    with pytest.raises(InputError, match="asset-file-clash"):
        animate(second, tmp_path / "out" / "b.gltf")
    assert (tmp_path / "out" / "skin.png").read_bytes() == b"same"


def test_two_assets_whose_files_clash_do_not_overwrite_each_other(tmp_path: Path) -> None:
    for folder, picture in (("a", b"first"), ("b", b"second")):
        gltf_with_files(tmp_path / folder)
        saved(tmp_path / folder / "face.bin", TRIANGLE)
        saved(tmp_path / folder / "skin.png", picture)
    out = tmp_path / "out"
    animate(tmp_path / "a" / "face.gltf", out / "a.gltf")
    before = {path: path.read_bytes() for path in out.iterdir()}
    with pytest.raises(InputError, match="asset-file-clash"):
        animate(tmp_path / "b" / "face.gltf", out / "b.gltf")
    assert {path: path.read_bytes() for path in out.iterdir()} == before


REFUSED_URIS = {
    "absolute": "/etc/hostname",
    "parent": "../secret.bin",
    "parent within": "a/../../secret.bin",
    "parent that stays inside": "a/../face.bin",
    "encoded parent": "%2e%2e/secret.bin",
    "encoded parent and slash": "%2E%2E%2Fsecret.bin",
    "encoded absolute": "%2fetc%2fhostname",
    "http": "http://example.com/face.bin",
    "https upper case": "HTTPS://example.com/face.bin",
    "host without scheme": "//example.com/face.bin",
    "file": "file:///etc/hostname",
    "file relative": "file:face.bin",
    "backslash parent": "..\\secret.bin",
    "backslash": "a\\face.bin",
    "encoded backslash": "%5C%5Chost%5Cface.bin",
    "drive": "C:/face.bin",
    "drive with backslash": "C:\\face.bin",
    "encoded drive": "C%3A/face.bin",
    "empty": "",
    "the folder": ".",
    "broken host": "http://[face.bin",
    "NUL": "face%00.bin",
    "NUL as it is": "face\0.bin",
}


@pytest.mark.parametrize("where", ["buffer", "image", "glb image"])
@pytest.mark.parametrize("case", REFUSED_URIS)
def test_a_uri_that_leaves_the_folder_is_refused_and_nothing_is_written(
    case: str, where: str, tmp_path: Path
) -> None:
    uri = REFUSED_URIS[case]
    saved(tmp_path / "secret.bin", TRIANGLE)
    saved(tmp_path / "in" / "face.bin", TRIANGLE)
    saved(tmp_path / "in" / "skin.png", b"picture")
    (tmp_path / "in" / "a").mkdir()
    if where == "glb image":
        source = face_glb(tmp_path / "in", face(images=[{"uri": uri}]))
    else:
        source = gltf_with_files(tmp_path / "in", **{where: uri})
    character = FORMAT.load(source)
    target = tmp_path / "out" / source.name
    with pytest.raises(InputError) as caught:
        FORMAT.write(character, [line(speech(["jawOpen"]))], target)
    assert caught.value.code == "asset-uri-refused"
    assert caught.value.place == str(source)
    assert not target.parent.exists() or not list(target.parent.iterdir())


# harm() names what was lost


def damaged_glb(target: Path, edit: Callable[[str], str], binary: bytes | None = None) -> None:
    text, chunks = split_glb(target.read_bytes())
    changed = edit(text)
    if binary is not None:
        chunks = [(BIN_KIND, binary), *chunks[1:]]
    else:
        assert changed != text
    target.write_bytes(glb(changed, *chunks))


def edited(edit: Callable[[Json], object]) -> Callable[[str], str]:
    def apply(text: str) -> str:
        document = json.loads(text)
        edit(document)
        return json.dumps(document)

    return apply


TEXT_DAMAGE: dict[str, tuple[Callable[[str], str], str]] = {
    "number reformatted": (lambda t: t.replace('"scene": 0', '"scene": 0.0', 1), "/scene"),
    "number with fewer zeros": (lambda t: t.replace("1.50", "1.5", 1), "/extras/n"),
    "value changed": (edited(lambda d: d["nodes"][0].update(name="mask")), "/nodes/0/name"),
    "null dropped": (edited(lambda d: d["extras"].pop("z")), "/extras/z"),
    "element removed": (edited(lambda d: d["scenes"].pop()), "/scenes"),
    "inner element removed": (edited(lambda d: d["extras"]["list"].pop()), "/extras/list"),
    "elements swapped": (edited(lambda d: d["extras"]["list"].reverse()), "/extras/list/0"),
    "member removed": (edited(lambda d: d.pop("extensions")), "/extensions"),
    "object became a list": (edited(lambda d: d.update(extensions=[])), "/extensions"),
    "true became 1": (edited(lambda d: d["extras"].update(flag=1)), "/extras/flag"),
    "their animation changed": (
        edited(lambda d: d["animations"][0].update(name="wink")),
        "/animations/0/name",
    ),
    "buffer 0 shorter than it was": (
        edited(lambda d: d["buffers"][0].update(byteLength=8)),
        "/buffers/0/byteLength",
    ),
}


def rich_source(folder: Path) -> Path:
    document = face(
        extensions={"VENDOR_x": {}},
        extras={"z": None, "list": [1, 2], "flag": True, "n": 111},
        scenes=[{"nodes": [0]}, {}],
    )
    binary = add_weights_animation(document, TRIANGLE, "blink", [[0, 0], [1, 0.5]])
    text = json.dumps(document).replace("111", "1.50")
    return saved(folder / "face.glb", glb(text, (BIN_KIND, binary), (b"XTRA", b"12345678")))


@pytest.mark.parametrize("case", TEXT_DAMAGE)
def test_harm_names_the_value_that_changed(case: str, tmp_path: Path) -> None:
    edit, pointer = TEXT_DAMAGE[case]
    source, target = rich_source(tmp_path), tmp_path / "out.glb"
    animate(source, target)
    damaged_glb(target, edit)
    assert any(pointer in sentence for sentence in FORMAT.harm(FORMAT.load(source), target))


def flipped(data: bytes, at: int) -> bytes:
    return data[:at] + bytes([data[at] ^ 1]) + data[at + 1 :]


@pytest.mark.parametrize("at", [0, 17, -1])
def test_harm_names_the_binary_chunk_when_an_old_byte_changed(at: int, tmp_path: Path) -> None:
    source, target = rich_source(tmp_path), tmp_path / "out.glb"
    animate(source, target)
    old = bin_of(source) or b""
    damaged_glb(target, lambda t: t, flipped(bin_of(target) or b"", at % len(old)))
    assert any("binary" in sentence for sentence in FORMAT.harm(FORMAT.load(source), target))


def test_harm_names_a_binary_chunk_that_was_cut_or_dropped(tmp_path: Path) -> None:
    source, target = rich_source(tmp_path), tmp_path / "out.glb"
    animate(source, target)
    text, chunks = split_glb(target.read_bytes())
    for rest in ([(BIN_KIND, chunks[0][1][:16]), chunks[1]], [chunks[1]], []):
        target.write_bytes(glb(text, *rest))
        assert any("binary" in sentence for sentence in FORMAT.harm(FORMAT.load(source), target))


def test_harm_names_another_chunk_that_was_lost_changed_or_lengthened(tmp_path: Path) -> None:
    source, target = rich_source(tmp_path), tmp_path / "out.glb"
    animate(source, target)
    text, (binary, (kind, data)) = split_glb(target.read_bytes())
    for rest in ([], [(kind, b"12345679")], [(b"OTHR", data)], [(kind, data + b"1234")]):
        target.write_bytes(glb(text, binary, *rest))
        assert any("chunk" in sentence for sentence in FORMAT.harm(FORMAT.load(source), target))


@pytest.mark.parametrize("damage", ["changed", "gone"])
@pytest.mark.parametrize("name", ["face.bin", "skin.png"])
def test_harm_names_a_file_that_was_lost_or_changed(name: str, damage: str, tmp_path: Path) -> None:
    source = gltf_with_files(tmp_path / "in")
    saved(tmp_path / "in" / "face.bin", TRIANGLE)
    saved(tmp_path / "in" / "skin.png", b"picture")
    target = tmp_path / "out" / "face.gltf"
    animate(source, target)
    copy = target.parent / name
    if damage == "gone":
        copy.unlink()
    else:
        copy.write_bytes(flipped(copy.read_bytes(), 3))
    assert any(name in sentence for sentence in FORMAT.harm(FORMAT.load(source), target))


# Real assets

# Neither has a single morph target.
REFUSED = {
    "saturday06_Example.vrm": "asset-no-blendshapes",
    "test.vrma": "asset-no-blendshapes",
}


@pytest.mark.skipif(not REAL, reason="../shared/assets is not here")
@pytest.mark.parametrize("source", REAL, ids=lambda path: path.relative_to(SHARED).as_posix())
def test_a_real_asset_speaks_and_loses_nothing(source: Path, tmp_path: Path) -> None:
    if source.name in REFUSED:
        with pytest.raises(InputError, match=REFUSED[source.name]):
            FORMAT.load(source)
        return
    shapes = FORMAT.load(source).shapes
    curves = speech(shapes[:: max(1, len(shapes) // 5)], seed=7)
    target = tmp_path / f"out{FORMAT.output_suffix(source)}"
    if source.suffix == ".gltf":
        target = tmp_path / quote(source.name)
    animate(source, target, curves)
