"""Strips of key frames: what they show, and what they refuse."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray
from PIL import Image

from animeme import registry
from animeme.contracts import LineAnimation
from animeme.curves import CurveSet
from animeme.errors import InputError
from animeme.phones import Phone, PhoneTrack, Word
from animeme_stages.pictures.framing import face_camera, limits_of, ranges_of
from animeme_stages.pictures.played import read_played
from animeme_stages.pictures.scene import load_scene, scene_of
from animeme_stages.pictures.shade import Renderer
from conftest import SAMPLE

CRAB = SAMPLE / "crab.glb"
LINE = "ama"
TRACK = PhoneTrack(
    "en",
    "arpabet",
    (
        Phone("sil", 0.0, 0.2),
        Phone("AA", 0.2, 0.5),
        Phone("M", 0.5, 0.7),
        Phone("AA", 0.7, 1.0),
        Phone("sil", 1.0, 1.2),
    ),
    (Word("ama", 0.2, 1.0),),
)
# Starts and ends at rest, opens for the vowels, closes in the middle.
TIMES_S = np.array([0.0, 0.2, 0.35, 0.5, 0.7, 0.85, 1.0, 1.2])
OPENING = np.array([0.0, 0.0, 0.9, 0.0, 0.0, 0.9, 0.0, 0.0])


def speaking(source: Path, target: Path, shape: str, lead_s: float = 0.0) -> Path:
    """A character with one line in it, written by the format's own writer."""
    form = registry.format_of(source)
    character = form.load(source)
    times_s, weights = TIMES_S + lead_s, OPENING[:, None]
    if lead_s:
        times_s, weights = np.append(0.0, times_s), np.vstack([weights[:1], weights])
    line = LineAnimation(
        LINE, "en", CurveSet(times_s, (shape,), weights), 1.2, audio_start_s=lead_s
    )
    form.write(character, [line], target)
    return target


@pytest.fixture(scope="module")
def crab(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return speaking(CRAB, tmp_path_factory.mktemp("crab") / "crab.glb", "MawGape")


def pictures(asset: Path, *times_s: float) -> list[NDArray[np.uint8]]:
    """Small pictures of the asset's line at some times of its recording."""
    scene = load_scene(asset)
    played = read_played(scene.character, LINE)
    curves = played.curves
    camera = face_camera(scene, ranges_of(curves.names, curves.weights), aspect=1.0)
    renderer = Renderer(
        scene, camera, (96, 96), supersample=1, ranges=limits_of(curves.names, curves.weights),
        lit=[{}],
    )  # fmt: skip
    return [renderer.picture(played.weights(time_s)) for time_s in times_s]


def apart(first: NDArray[np.uint8], second: NDArray[np.uint8]) -> float:
    """Part of the pixels that differ by more than rounding."""
    return float((np.abs(first.astype(int) - second.astype(int)).max(2) > 8).mean())


def draw(asset: Path, output: Path, **options: object) -> Image.Image:
    registry.stage("draw-strip")(asset, LINE, TRACK, output, **options)
    with Image.open(output) as image:
        return image.convert("RGB")


def test_mouth_is_open_for_a_vowel_and_as_at_rest_for_a_bilabial(crab: Path) -> None:
    rest, vowel, bilabial = pictures(crab, 0.1, 0.35, 0.6)
    assert apart(rest, bilabial) == 0.0
    assert apart(rest, vowel) > 0.01


@pytest.mark.parametrize("suffix", [".gltf", ".usdc"])
def test_other_formats_open_as_wide(crab: Path, tmp_path: Path, suffix: str) -> None:
    if suffix == ".gltf":
        import pygltflib

        source = tmp_path / "source.gltf"
        loaded = pygltflib.GLTF2().load(str(CRAB))
        assert loaded is not None
        loaded.convert_buffers(pygltflib.BufferFormat.DATAURI)
        loaded.save(str(source))
    else:
        source = SAMPLE / "crab.usdc"
    other = speaking(source, tmp_path / f"crab{suffix}", "MawGape")
    expected, found = (pictures(asset, 0.1, 0.35) for asset in (crab, other))
    assert apart(*found) == pytest.approx(apart(*expected), rel=0.2)
    assert apart(expected[1], found[1]) < 0.05


def test_lead_in_before_the_recording_is_left_out(crab: Path, tmp_path: Path) -> None:
    later = speaking(CRAB, tmp_path / "later.glb", "MawGape", lead_s=0.5)
    (expected,), (found,) = pictures(crab, 0.35), pictures(later, 0.35)
    assert apart(expected, found) == 0.0


def test_what_stands_still_is_drawn_as_what_moves(crab: Path) -> None:
    scene = load_scene(crab)
    played = read_played(scene.character, LINE)
    camera = face_camera(scene, {"MawGape": 0.9}, aspect=1.0)
    limits = limits_of(played.curves.names, played.curves.weights)
    weights = played.weights(0.3)
    split = Renderer(scene, camera, (96, 96), supersample=1, ranges=limits, lit=[{}])
    whole = Renderer(scene, camera, (96, 96), supersample=1, lit=[{}])
    assert apart(split.picture(weights), whole.picture(weights)) < 0.002


def test_strip_has_a_frame_per_phone_and_the_same_bytes_twice(crab: Path, tmp_path: Path) -> None:
    first = draw(crab, tmp_path / "a.png", title="ama", moments=9)
    draw(crab, tmp_path / "b.png", title="ama", moments=9)
    assert (tmp_path / "a.png").read_bytes() == (tmp_path / "b.png").read_bytes()
    narrow = draw(crab, tmp_path / "c.png", moments=1)
    # Three phones are spoken; a gap of two pixels is between their frames.
    assert first.width == 3 * narrow.width + 2 * 2
    assert first.height > narrow.height
    with Image.open(tmp_path / "a.png") as image:
        assert not image.info


def test_strip_without_phones_is_evenly_spaced(crab: Path, tmp_path: Path) -> None:
    registry.stage("draw-strip")(crab, LINE, None, tmp_path / "even.png", moments=2)
    with Image.open(tmp_path / "even.png") as image:
        assert image.width == 2 * 230 + 2


def test_title_that_cannot_be_written_is_left_out(crab: Path, tmp_path: Path) -> None:
    assert draw(crab, tmp_path / "t.png", title="𝄞 שלום", moments=1).width == 230


@pytest.mark.parametrize("moments", [0, 49])
def test_number_of_moments_is_checked(crab: Path, tmp_path: Path, moments: int) -> None:
    with pytest.raises(ValueError, match="moments"):
        draw(crab, tmp_path / "x.png", moments=moments)


def refused(asset: Path, animation: str, output: Path) -> InputError:
    with pytest.raises(InputError) as caught:
        registry.stage("draw-strip")(asset, animation, TRACK, output)
    assert not [path for path in output.parent.glob("*") if path != asset]
    return caught.value


def test_unknown_animation_is_told_with_the_one_that_is_meant(crab: Path, tmp_path: Path) -> None:
    error = refused(crab, "amma", tmp_path / "x.png")
    assert error.code == "picture-animation-unknown"
    assert "'ama'" in error.action


def test_unwritable_output_and_wrong_suffix(crab: Path, tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    with pytest.raises(InputError) as caught:
        draw(crab, tmp_path / "file" / "x.png", moments=1)
    assert caught.value.code == "output-unwritable"
    with pytest.raises(InputError) as caught:
        draw(crab, tmp_path / "x.jpg")
    assert caught.value.code == "output-suffix"


def broken(asset: Path, target: Path, edit: str) -> Path:
    """The crab as text, with one thing broken."""
    import pygltflib

    loaded = pygltflib.GLTF2().load(str(asset))
    assert loaded is not None
    loaded.convert_buffers(pygltflib.BufferFormat.DATAURI)
    root = json.loads(loaded.to_json())
    primitive = next(mesh for mesh in root["meshes"])["primitives"][0]
    if edit == "indices":
        primitive["indices"] = 10_000
    elif edit == "position":
        primitive["attributes"]["POSITION"] = primitive["indices"]
    elif edit == "draco":
        primitive["extensions"] = {"KHR_draco_mesh_compression": {"bufferView": 0}}
    elif edit == "meshopt":
        view = root["accessors"][primitive["attributes"]["POSITION"]]["bufferView"]
        root["bufferViews"][view]["extensions"] = {"EXT_meshopt_compression": {}}
    elif edit == "buffer":
        root["buffers"][0]["uri"] = "data:application/octet-stream;base64,AAAA"
    elif edit == "far":
        for node in root["nodes"]:
            node["scale"] = [1e100, 1.0, 1.0]
    elif edit == "count":
        root["accessors"][primitive["attributes"]["POSITION"]]["count"] = 10**15
    elif edit == "circle":
        root["nodes"][0].setdefault("children", []).append(0)
    target.write_text(json.dumps(root), encoding="utf-8")
    return target


@pytest.mark.parametrize(
    ("edit", "code"),
    [
        ("indices", "asset-unreadable"),
        ("position", "asset-unreadable"),
        ("buffer", "asset-unreadable"),
        ("far", "asset-unreadable"),
        ("count", "asset-unreadable"),
        ("draco", "picture-compressed"),
        ("meshopt", "picture-compressed"),
    ],
)
def test_damaged_meshes_are_refused(crab: Path, tmp_path: Path, edit: str, code: str) -> None:
    with pytest.raises(InputError) as caught:
        load_scene(broken(crab, tmp_path / "broken.gltf", edit))
    assert caught.value.code == code
    assert load_scene(broken(crab, tmp_path / "sound.gltf", "")).meshes


def test_nodes_in_a_circle_end(crab: Path, tmp_path: Path) -> None:
    assert load_scene(broken(crab, tmp_path / "circle.gltf", "circle")).meshes


def test_face_is_found_on_whichever_side_it_is(crab: Path) -> None:
    scene = load_scene(crab)
    turn = np.array([[-1.0, 0, 0], [0, 1, 0], [0, 0, -1]])

    def turned() -> object:
        meshes = []
        for mesh in scene.meshes:
            targets = {n: replace(t, offsets=t.offsets @ turn) for n, t in mesh.targets.items()}
            meshes.append(replace(mesh, points=mesh.points @ turn, targets=targets))
        return replace(scene, meshes=tuple(meshes))

    front = face_camera(scene, {"MawGape": 1.0}, aspect=1.0)
    behind = face_camera(turned(), {"MawGape": 1.0}, aspect=1.0)  # type: ignore[arg-type]
    assert behind.yaw - front.yaw == pytest.approx(180.0)
    assert behind.height == pytest.approx(front.height, rel=1e-3)


def test_asset_that_changed_is_read_anew(crab: Path, tmp_path: Path) -> None:
    asset = tmp_path / "crab.glb"
    asset.write_bytes(crab.read_bytes())
    before = scene_of(asset)
    assert scene_of(asset) is before
    asset.write_bytes(CRAB.read_bytes())
    assert scene_of(asset) is not before
