"""Weight animations of USD as they are stored, broken or not, for those who judge them."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from typing import Any

import numpy as np
from pxr import Usd, UsdSkel

from animeme.delivery import StoredTrack
from animeme.rig import Character
from animeme_stages.ingest.usd import (
    CUSTOM_DATA,
    animations,
    open_stage,
    shape_names,
    usd_errors,
    weight_samples,
)


def stored(character: Character, names: Collection[str] | None = None) -> tuple[StoredTrack, ...]:
    """Every SkelAnimation of the character's file, or some, that has shapes, in stage order."""
    path = character.source
    stage = open_stage(path)
    with usd_errors(path):
        tracks = [
            _track(stage, animation, character)
            for animation in animations(stage)
            if names is None or _name(animation.GetPrim()) in names
        ]
    return tuple(track for track in tracks if track is not None)


def _note(prim: Usd.Prim) -> Mapping[str, Any]:
    return prim.GetCustomData().get(CUSTOM_DATA) or {}


def _name(prim: Usd.Prim) -> str:
    return str(_note(prim).get("line", prim.GetName()))


def _track(
    stage: Usd.Stage, animation: UsdSkel.Animation, character: Character
) -> StoredTrack | None:
    prim = animation.GetPrim()
    place = str(prim.GetPath())
    names = shape_names(animation)
    codes, rows = weight_samples(animation)
    if not names or not rows:
        return None
    note, name = _note(prim), _name(prim)
    shapes = tuple(character.canonical.get(shape, shape) for shape in names)
    strangers = [shape for shape in names if shape not in character.canonical]
    wrong = next((i for i, row in enumerate(rows) if len(row) != len(names)), None)
    fault = ("", "")
    if wrong is not None:
        said = f"it has {len(rows[wrong])} weights for {len(names)} shapes"
        fault = ("weights-count", f"{said} at frame {codes[wrong]:g}")
    elif len(set(names)) != len(names):
        fault = ("animation-broken", "it names a shape twice")
    elif strangers and note:
        listed = ", ".join(strangers[:3])
        fault = ("animation-broken", f"it moves {listed}, which no mesh has")
    if fault[0]:
        none = np.zeros((0, len(shapes)))
        return StoredTrack(name, place, shapes, np.zeros(0), none, fault, note=note)
    times_s = codes / stage.GetTimeCodesPerSecond()
    weights = np.array(rows, dtype=np.float64)
    return StoredTrack(name, place, shapes, times_s, weights, note=note)
