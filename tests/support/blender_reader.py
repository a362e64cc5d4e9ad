"""Run by a Python that has Blender (`bpy`): shape key values of files at given times, as JSON.

``python blender_reader.py REQUESTS RESULTS``; REQUESTS lists {"file", "animation", "rate_hz",
"times_s"}, RESULTS gets {"object": {"shape": [value, …]}} for each. It imports nothing of ours:
Blender brings its own Python packages, of other versions than we need.
"""

from __future__ import annotations

import json
import math
import sys
from fractions import Fraction
from pathlib import Path
from typing import Any

import bpy  # type: ignore[import-not-found, unused-ignore]


def main() -> None:
    requests = json.loads(Path(sys.argv[1]).read_text("utf-8"))
    results = [values(request) for request in requests]
    Path(sys.argv[2]).write_text(json.dumps(results), "utf-8")


def values(request: dict[str, Any]) -> dict[str, dict[str, list[float]]]:
    """Object → shape key → its value at each of the times."""
    bpy.ops.wm.read_factory_settings(use_empty=True)
    scene = bpy.context.scene
    rate = Fraction(request["rate_hz"]).limit_denominator(1001)
    # Blender's rate is a whole number over a divisor; USD's time codes become its frames.
    scene.render.fps = math.ceil(rate)
    scene.render.fps_base = float(math.ceil(rate) / rate)
    file = request["file"]
    if file.endswith((".usda", ".usdc", ".usdz")):
        bpy.ops.wm.usd_import(filepath=file, set_frame_range=False)
    else:
        bpy.ops.preferences.addon_enable(module="io_scene_gltf2")
        bpy.ops.import_scene.gltf(filepath=file)
    found: dict[str, dict[str, list[float]]] = {}
    keyed = [o for o in bpy.data.objects if o.type == "MESH" and o.data.shape_keys]
    for holder in keyed:
        play(holder.data.shape_keys.animation_data, request["animation"])
    for time_s in request["times_s"]:
        frame = time_s * float(rate)
        scene.frame_set(math.floor(frame), subframe=frame - math.floor(frame))
        for holder in keyed:
            shapes = found.setdefault(holder.name, {})
            for block in holder.data.shape_keys.key_blocks[1:]:
                shapes.setdefault(block.name, []).append(block.value)
    return found


def play(data: Any, animation: str) -> None:
    """Let only the glTF animation of that name play; its importer gives each one a track.

    The tracks themselves begin a frame late, so their action is played instead.
    """
    if not data or not animation:
        return
    for track in data.nla_tracks:
        track.mute = True
        if track.name == animation:
            data.action = track.strips[0].action
            data.action_slot = track.strips[0].action_slot


if __name__ == "__main__":
    main()
