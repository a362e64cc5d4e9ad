"""Tiny glTF characters, written with a line and held to all that is promised of every asset."""

from __future__ import annotations

import json
import shutil
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from animeme.contracts import LineAnimation
from animeme.curves import CurveSet, Floats
from animeme.rig import Character
from animeme_stages.ingest.gltf_data import external_uris, local_file
from animeme_stages.write.gltf import GltfFormat
from support.gltf_build import (
    BIN_KIND,
    TRIANGLE,
    Json,
    Reader,
    bin_of,
    document_of,
    face,
    glb,
    kept,
    raw_tree,
    split_glb,
    text_of,
)

FORMAT = GltfFormat()
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
    source: Path,
    target: Path,
    curves: CurveSet | None = None,
    *,
    plain: bool = False,
    origin: Path | None = None,
) -> Reader:
    """Write one line, and require everything that holds for every asset.

    Args:
        source, target: the asset, and where to.
        curves: of the line; any, of its first shape, if None.
        plain: read it back from the bare JSON.
        origin: what `source`, an output of ours, was made from.
    """
    before = source.read_bytes()
    character = FORMAT.load(source)
    curves = curves or speech(character.shapes[:1])
    written = FORMAT.write(character, [line(curves)], target)
    assert source.read_bytes() == before
    assert written[0] == target
    assert all(path.is_file() for path in written)
    assert FORMAT.harm(character, target) == []
    require_kept(origin or source, target)
    require_strippable(origin or source, target)
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


def require_strippable(source: Path, target: Path) -> None:
    """Without our animations `target` is `source`, and every file beside it is as it was."""
    back = target.parent / "stripped" / source.name
    before = {p: p.read_bytes() for p in target.parent.rglob("*") if p.is_file()}
    assert FORMAT.strip(target, back)
    assert back.read_bytes() == source.read_bytes()
    for uri in external_uris(document_of(source)):
        if local_file(source, uri).is_file():
            assert local_file(back, uri).read_bytes() == local_file(source, uri).read_bytes()
    assert {p: p.read_bytes() for p in before} == before
    shutil.rmtree(back.parent)


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
    # Targets without names may be called after a VRM's expressions.
    loaded = {int(m.path.rpartition("/")[2]): m.shapes for m in FORMAT.load(reader.path).meshes}
    for node, (names, rest) in owners(document_of(reader.path)).items():
        names = names or [*loaded[node]]
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


def require_agreement(
    played: Mapping[str, Floats], ours: CurveSet, at_s: Floats, character: Character
) -> None:
    """A judge's weights per node are those of `ours`, on every mesh of the character."""
    meshes = {mesh.path.rpartition("/")[2]: mesh for mesh in character.meshes}
    assert {node.partition("/")[0] for node in played} == meshes.keys()
    wanted = ours.sample(at_s)
    for node, weights in played.items():
        names = [character.canonical[shape] for shape in meshes[node.partition("/")[0]].shapes]
        columns = [ours.names.index(name) for name in names]
        np.testing.assert_allclose(weights, wanted[:, columns], atol=1e-4)
        assert np.ptp(weights, axis=0).max() > 0.1


def external_buffer(folder: Path, binary: bytes = TRIANGLE) -> Json:
    saved(folder / "face.bin", binary)
    return face(buffers=[{"uri": "face.bin", "byteLength": len(binary)}])


def gltf_with_files(folder: Path, *, buffer: str = "face.bin", image: str = "skin.png") -> Path:
    """A .gltf whose buffer and image are files; `buffer` and `image` are their URIs."""
    return saved(
        folder / "face.gltf",
        face(buffers=[{"uri": buffer, "byteLength": 36}], images=[{"uri": image}]),
    )
