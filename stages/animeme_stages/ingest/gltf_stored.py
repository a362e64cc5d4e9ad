"""Weight animations of glTF as they are stored, broken or not, for those who judge them."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping
from typing import Any

import numpy as np

from animeme.curves import Floats
from animeme.delivery import StoredTrack
from animeme.errors import InputError
from animeme.rig import Character, MeshShapes
from animeme_stages.ingest.glb import open_container
from animeme_stages.ingest.gltf_data import Buffers
from animeme_stages.ingest.gltf_document import MALFORMED, mark_of

# Points between two keys of a cubic spline: at 30 keys a second they are 4 ms apart.
_STEPS = 8


def stored(character: Character, names: Collection[str] | None = None) -> tuple[StoredTrack, ...]:
    """Every weights channel of the character's file, or of some animations, in file order."""
    container = open_container(character.source)
    buffers = Buffers(container)
    found: list[StoredTrack] = []
    for index, animation in enumerate(container.json.get("animations", [])):
        name = str(animation.get("name", f"animation {index}"))
        note = mark_of(animation) or {}
        if names is not None and note.get("line", name) not in names:
            continue
        found += _tracks(animation, f"/animations/{index}", name, note, buffers, character)
    return tuple(found)


def _tracks(
    animation: Mapping[str, Any],
    pointer: str,
    name: str,
    note: Mapping[str, Any],
    buffers: Buffers,
    character: Character,
) -> Iterator[StoredTrack]:
    meshes = {mesh.path: mesh for mesh in character.meshes}
    channels = animation.get("channels", [])
    if not isinstance(channels, list):
        yield _faulty(name, pointer, (), note, "animation-broken", "its channels are no list")
        return
    for number, channel in enumerate(channels):
        place = f"{pointer}/channels/{number}"
        target = channel.get("target") if isinstance(channel, dict) else None
        if not isinstance(target, dict):
            yield _faulty(name, place, (), note, "animation-broken", "it has no target")
            continue
        if target.get("path") != "weights":
            continue
        mesh = meshes.get(f"/nodes/{target.get('node')}")
        if mesh is None:
            said = f"it moves the weights of node {target.get('node')}, which has no morph target"
            yield _faulty(name, place, (), note, "animation-broken", said)
            continue
        shapes = tuple(character.canonical[shape] for shape in mesh.shapes)
        try:
            sampler = animation["samplers"][channel["sampler"]]
            yield _track(name, place, shapes, note, sampler, mesh, buffers)
        except InputError as error:
            compressed = error.code == "animation-compressed"
            code = error.code if compressed else "animation-broken"
            yield _faulty(name, place, shapes, note, code, f"it {error.problem}")
        except MALFORMED as error:
            said = f"its sampler cannot be followed ({error})"
            yield _faulty(name, place, shapes, note, "animation-broken", said)


def _track(
    name: str,
    place: str,
    shapes: tuple[str, ...],
    note: Mapping[str, Any],
    sampler: Mapping[str, Any],
    mesh: MeshShapes,
    buffers: Buffers,
) -> StoredTrack:
    times_s = buffers.floats(sampler["input"])[:, 0].astype(np.float64)
    values = buffers.floats(sampler["output"]).reshape(-1).astype(np.float64)
    kind = sampler.get("interpolation", "LINEAR")
    per_key = len(shapes) * (3 if kind == "CUBICSPLINE" else 1)
    if len(times_s) == 0 or len(values) != len(times_s) * per_key:
        said = f"it has {len(values)} weights for {len(times_s)} keys of {len(shapes)} shapes"
        return _faulty(name, place, shapes, note, "weights-count", said)
    if kind == "CUBICSPLINE":
        cube = values.reshape(len(times_s), 3, len(shapes))
        played = _spline(times_s, cube)
        return StoredTrack(name, place, shapes, times_s, cube[:, 1], played=played, note=note)
    weights = values.reshape(len(times_s), len(shapes))
    steps = _steps(times_s, weights) if kind == "STEP" else None
    return StoredTrack(name, place, shapes, times_s, weights, played=steps, note=note)


def _faulty(
    name: str, place: str, shapes: tuple[str, ...], note: Mapping[str, Any], code: str, said: str
) -> StoredTrack:
    none = np.zeros((0, len(shapes)))
    return StoredTrack(name, place, shapes, np.zeros(0), none, (code, said), note=note)


def _spline(times_s: Floats, cube: Floats) -> tuple[Floats, Floats]:
    """A cubic Hermite spline, sampled; glTF 2.0, appendix C.5. `cube` is (T, 3, N)."""
    if len(times_s) < 2:
        return times_s, cube[:, 1]
    step_s = np.diff(times_s)[:, None, None]
    t = (np.arange(_STEPS) / _STEPS)[None, :, None]
    v0, b0 = cube[:-1, None, 1], cube[:-1, None, 2] * step_s
    v1, a1 = cube[1:, None, 1], cube[1:, None, 0] * step_s
    seen = (
        (2 * t**3 - 3 * t**2 + 1) * v0
        + (t**3 - 2 * t**2 + t) * b0
        + (-2 * t**3 + 3 * t**2) * v1
        + (t**3 - t**2) * a1
    )
    at_s = times_s[:-1, None] + step_s[:, :, 0] * t[:, :, 0]
    weights = seen.reshape(-1, cube.shape[2])
    return np.append(at_s.reshape(-1), times_s[-1]), np.vstack([weights, cube[-1:, 1]])


def _steps(times_s: Floats, weights: Floats) -> tuple[Floats, Floats]:
    """Steps as lines: a second key just before each but the first."""
    if len(times_s) < 2 or not (np.diff(times_s) > 0).all():
        return times_s, weights
    before_s = times_s[1:] - np.minimum(1e-3, np.diff(times_s) / 2)
    at_s = np.concatenate([times_s, before_s])
    order = np.argsort(at_s, kind="stable")
    return at_s[order], np.vstack([weights, weights[:-1]])[order]
