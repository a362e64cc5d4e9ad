"""Run by a Python that has Blender (`bpy`): shape key values of files at given times, as JSON.

``python blender_reader.py REQUESTS RESULTS``; REQUESTS lists {"file", "animation", "rate_hz",
"times_s"}, RESULTS gets for each {"object": {"shape": [value, …]}}, or, of a file that Blender
cannot import, the sentence in which it says so. Objects of a glTF are called "/nodes/INDEX", after
the node that they were made from, and their shapes after the index of the target: names need not be
unique in glTF, but Blender makes them so. It imports nothing of ours: Blender brings its own Python
packages, of other versions than we need.
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


def values(request: dict[str, Any]) -> dict[str, dict[str, list[float]]] | str:
    """Object → shape key → its value at each of the times; or why it cannot be imported."""
    bpy.ops.wm.read_factory_settings(use_empty=True)
    scene = bpy.context.scene
    rate = Fraction(request["rate_hz"]).limit_denominator(1001)
    # Blender's rate is a whole number over a divisor; USD's time codes become its frames.
    scene.render.fps = math.ceil(rate)
    scene.render.fps_base = float(math.ceil(rate) / rate)
    try:
        keyed = imported(request["file"])
    except RuntimeError as error:
        return str(error)
    for holder, _, _ in keyed:
        play(holder.data.shape_keys.animation_data, request["animation"])
    found: dict[str, dict[str, list[float]]] = {}
    for time_s in request["times_s"]:
        frame = time_s * float(rate)
        scene.frame_set(math.floor(frame), subframe=frame - math.floor(frame))
        for holder, name, names in keyed:
            shapes = found.setdefault(name, {})
            for block in holder.data.shape_keys.key_blocks[1:]:
                shapes.setdefault(names.get(block.name, block.name), []).append(block.value)
    return found


def imported(file: str) -> list[tuple[Any, str, dict[str, str]]]:
    """Objects with shape keys, each with its name, and names of its keys where they are others.

    Raises:
        RuntimeError: Blender cannot import the file.
    """
    if file.endswith((".usd", ".usda", ".usdc", ".usdz")):
        bpy.ops.wm.usd_import(filepath=file, set_frame_range=False)
        made = [(holder, holder.name, {}) for holder in bpy.data.objects]
    else:
        made = imported_gltf(file)
    return [one for one in made if one[0].type == "MESH" and one[0].data.shape_keys]


def imported_gltf(file: str) -> list[tuple[Any, str, dict[str, str]]]:
    """Objects made from nodes; the importer itself tells which from which."""
    bpy.ops.preferences.addon_enable(module="io_scene_gltf2")
    from io_scene_gltf2.blender.imp.node import (  # type: ignore[import-not-found, unused-ignore]
        BlenderNode,
    )

    made = []
    create = BlenderNode.create_mesh_object

    def noted(gltf: Any, vnode: Any) -> Any:
        holder = create(gltf, vnode)
        if vnode.mesh_node_idx is None:  # a copy by EXT_mesh_gpu_instancing
            return holder
        keys = gltf.data.meshes[gltf.data.nodes[vnode.mesh_node_idx].mesh].shapekey_names
        names = {key: str(index) for index, key in enumerate(keys)}
        made.append((holder, f"/nodes/{vnode.mesh_node_idx}", names))
        return holder

    BlenderNode.create_mesh_object = noted
    try:
        bpy.ops.import_scene.gltf(filepath=file)
    finally:
        BlenderNode.create_mesh_object = create
    return made


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
