r"""Render characters to pictures, without a graphics card.

Examples:
    python sample_assets/render.py ada.glb --weights jawOpen=0.5 --crop head --output aa.png
    python sample_assets/render.py talk.glb --animation Line1 --times 0.1 0.3 --labels m aa \
        --crop mouth --output strip.png
"""

from __future__ import annotations

import argparse
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path

import numpy as np

from animeme_stages.pictures.played import read_played
from animeme_stages.pictures.scene import Scene, load_scene
from animeme_stages.pictures.shade import Camera
from animeme_stages.pictures.strip import sheet

# Crop → height of the picture in widths of the mouth, and by how many its middle is raised.
CROPS = {"mouth": (1.75, 0.0), "face": (4.6, 0.9), "head": (6.4, 1.2)}


def camera_for(
    scene: Scene, crop: str = "all", yaw: float = 0.0, pitch: float = 0.0, aspect: float = 1.0
) -> Camera:
    """A camera for a detail of a scene.

    Args:
        scene: what is looked at.
        crop: one of `CROPS`, or "all".
        yaw: degrees; positive shows the left side.
        pitch: degrees; positive looks from above.
        aspect: width of the picture divided by its height.
    """
    low, high = scene.bounds()
    middle, extent = (low + high) / 2, high - low
    lips = _lips(scene)
    if crop == "all" or lips is None:
        height = 1.12 * max(extent[1], extent[0] / aspect)
        mouth = height / 8
    else:
        left, right = lips
        mouth = float(np.linalg.norm(left - right))
        height, up = CROPS[crop]
        height *= mouth / min(aspect, 1.0)
        behind = 0.2 if crop == "mouth" else 1.2
        middle = (left + right) / 2 + np.array([0.0, up * mouth, -behind * mouth])
    x, y, z = (float(v) for v in middle)
    return Camera((x, y, z), float(height), mouth, yaw, pitch)


def _lips(scene: Scene) -> tuple[np.ndarray, np.ndarray] | None:
    """Corners of the mouth (3,) each, from landmarks or from what ``mouthPucker`` moves most."""
    for mesh in scene.meshes:
        names = ("lipCornerLeft", "lipCornerRight")
        if all(name in mesh.landmarks for name in names):
            left, right = (mesh.points[mesh.landmarks[name]].mean(0) for name in names)
            return left, right
    puckering = [mesh for mesh in scene.meshes if "mouthPucker" in mesh.targets]
    if not puckering:
        return None
    best = max(puckering, key=lambda mesh: len(mesh.points))
    inwards = best.targets["mouthPucker"].offsets[-1][:, 0]
    return best.points[inwards.argmin()], best.points[inwards.argmax()]


def _parse_weights(text: str) -> dict[str, float]:
    """Weights from ``name=value,name=value``; ``*`` stands for Left and Right."""
    weights: dict[str, float] = {}
    for item in filter(None, text.split(",")):
        name, _, value = item.partition("=")
        sides = ("Left", "Right") if name.endswith("*") else ("",)
        for side in sides:
            weights[name.rstrip("*") + side] = float(value)
    return weights


def _arguments() -> argparse.Namespace:
    """Parse the command line."""
    parser = argparse.ArgumentParser(description="Render a character to a picture.")
    parser.add_argument("asset", type=Path, help="a glTF or USD file")
    parser.add_argument("--animation", help="name of an animation with weight channels")
    parser.add_argument("--times", type=float, nargs="+", default=[0.0], help="seconds")
    parser.add_argument(
        "--weights",
        action="append",
        default=[],
        metavar="NAME=VALUE,...",
        help="a frame with these weights (repeatable; NAME* means NAMELeft and NAMERight)",
    )
    parser.add_argument("--labels", nargs="+", default=[], help="one text per frame")
    parser.add_argument("--crop", choices=[*CROPS, "all"], default="head")
    parser.add_argument("--yaw", type=float, default=0.0, help="degrees, to the left side")
    parser.add_argument("--pitch", type=float, default=0.0, help="degrees, from above")
    parser.add_argument("--size", type=int, nargs=2, default=(320, 320), metavar=("W", "H"))
    parser.add_argument("--zoom", type=float, default=1.0, help="magnification of the crop")
    parser.add_argument("--supersample", type=int, default=2)
    parser.add_argument("--output", type=Path, required=True, help="a .png file")
    return parser.parse_args()


def main() -> None:
    """Render what the command line asks for."""
    arguments = _arguments()
    scene = load_scene(arguments.asset)
    size = (arguments.size[0], arguments.size[1])
    frames: list[Mapping[str, float]] = [_parse_weights(text) for text in arguments.weights]
    if arguments.animation:
        played = read_played(scene.character, arguments.animation)
        frames += [played.weights(time_s) for time_s in arguments.times]
    camera = camera_for(scene, arguments.crop, arguments.yaw, arguments.pitch, size[0] / size[1])
    camera = replace(camera, height=camera.height / arguments.zoom)
    image = sheet(
        scene, frames or [{}], camera, labels=arguments.labels, frame_px=size,
        supersample=arguments.supersample,
    )  # fmt: skip
    image.save(arguments.output)


if __name__ == "__main__":
    main()
