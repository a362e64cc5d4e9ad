"""Lines into glTF: which nodes they drive, with which keys, and nothing besides."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from animeme.curves import CurveSet
from support.gltf_build import Reader, document_of, face, mesh
from support.gltf_kit import (
    FORMAT,
    animate,
    face_glb,
    line,
    require_kept,
    require_played,
    saved,
    speech,
)


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
