r"""Render glTF characters to pictures, without a graphics card.

Examples:
    python sample_assets/render.py ada.glb --weights jawOpen=0.5 --crop head --output aa.png
    python sample_assets/render.py talk.glb --animation Line1 --times 0.1 0.3 --labels m aa \
        --crop mouth --output strip.png
"""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
from PIL import Image, ImageDraw, ImageFont

from preview.scene import Scene, SceneMesh, Weights, load_scene, weights_of
from preview.shade import Camera, picture

__all__ = [
    "Camera",
    "Scene",
    "SceneMesh",
    "camera_for",
    "load_scene",
    "render",
    "strip",
]

CROPS = ("mouth", "face", "head", "all")
LABEL_HEIGHT = 0.13
"""Height of the line of labels as a share of the frame's height."""


def render(
    scene: Scene,
    weights: Weights | None = None,
    size: tuple[int, int] = (512, 512),
    camera: Camera | None = None,
    supersample: int = 2,
) -> Image.Image:
    """Draw a scene.

    Args:
        scene: What to draw.
        weights: Shape weights for all meshes, or mesh name -> shape weights.
        size: Width and height in pixels.
        camera: Point of view; by default from the front, with everything in sight.
        supersample: Samples per pixel along each side.
    """
    surfaces = [
        surface
        for mesh in scene.meshes
        for surface in mesh.surfaces(weights_of(weights or {}, mesh.name))
    ]
    return picture(surfaces, camera or camera_for(scene), size, supersample)


def camera_for(
    scene: Scene, crop: str = "all", yaw: float = 0.0, pitch: float = 0.0, aspect: float = 1.0
) -> Camera:
    """A camera for a detail of a scene.

    Args:
        scene: The scene; its lips are found by the landmarks of a mesh, else by proportions.
        crop: One of `CROPS`.
        yaw: Degrees; positive shows the left side.
        pitch: Degrees; positive looks from above.
        aspect: Width of the picture divided by its height.
    """
    low, high = scene.bounds()
    middle, extent = (low + high) / 2, high - low
    height = 1.12 * max(extent[1], extent[0] / aspect)
    lips = _lips(scene)
    if crop != "all" and lips is not None:
        left, right = lips
        width = float(np.linalg.norm(left - right))
        above = {"mouth": -0.08, "face": 0.85, "head": 1.05}[crop] * width
        height = {"mouth": 1.75, "face": 4.3, "head": 6.2}[crop] * width / min(aspect, 1.0)
        behind = {"mouth": 0.2, "face": 1.0, "head": 1.5}[crop] * width
        middle = (left + right) / 2 + [0.0, above, -behind]
    x, y, z = (float(v) for v in middle)
    return Camera((x, y, z), 6.0 * height if crop == "mouth" else 4.0 * height, height, yaw, pitch)


def _lips(scene: Scene) -> tuple[np.ndarray, np.ndarray] | None:
    """Corners of the mouth (3,) each, from landmarks or from what ``mouthSmile`` moves most."""
    for mesh in scene.meshes:
        names = ("lipCornerLeft", "lipCornerRight")
        if all(name in mesh.landmarks for name in names):
            left, right = (mesh.points[mesh.landmarks[name]].mean(0) for name in names)
            return left, right
    best: SceneMesh | None = None
    for mesh in scene.meshes:
        stretch = mesh.targets.get("mouthPucker")
        if stretch is not None and (best is None or len(mesh.points) > len(best.points)):
            best = mesh
    if best is None:
        return None
    inwards = best.targets["mouthPucker"][:, 0]
    left, right = best.points[inwards.argmin()], best.points[inwards.argmax()]
    return (left, right) if left[0] > right[0] else (right, left)


def strip(
    scene: Scene,
    frames: Sequence[Weights],
    labels: Sequence[str] = (),
    size: tuple[int, int] = (240, 240),
    camera: Camera | None = None,
    supersample: int = 2,
) -> Image.Image:
    """Draw frames side by side, with small labels below if there are any."""
    camera = camera or camera_for(scene, "mouth", aspect=size[0] / size[1])
    line = round(LABEL_HEIGHT * size[1]) if labels else 0
    image = Image.new("RGB", (size[0] * len(frames), size[1] + line), (250, 250, 250))
    draw = ImageDraw.Draw(image)
    font = ImageFont.load_default(size=max(8, round(line * 0.62)))
    for k, weights in enumerate(frames):
        image.paste(render(scene, weights, size, camera, supersample), (k * size[0], 0))
        if k < len(labels):
            middle = (k * size[0] + size[0] / 2, size[1] + line / 2)
            draw.text(middle, labels[k], fill=(60, 60, 66), font=font, anchor="mm")
    return image


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
    parser = argparse.ArgumentParser(description="Render a glTF character to a picture.")
    parser.add_argument("asset", type=Path, help="a .glb or .gltf file")
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
    parser.add_argument("--crop", choices=CROPS, default="head")
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
    frames: list[Weights] = [_parse_weights(text) for text in arguments.weights]
    if arguments.animation:
        frames += [scene.weights_at(arguments.animation, t) for t in arguments.times]
    camera = camera_for(scene, arguments.crop, arguments.yaw, arguments.pitch, size[0] / size[1])
    camera = replace(camera, height=camera.height / arguments.zoom)
    image = strip(scene, frames or [{}], arguments.labels, size, camera, arguments.supersample)
    image.save(arguments.output)


if __name__ == "__main__":
    main()
