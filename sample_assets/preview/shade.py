"""Camera and lighting: turns deformed meshes into a picture."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from .raster import FloatArray, Fragments, IntArray, box_blur, rasterise


@dataclass(frozen=True)
class Camera:
    """A perspective camera that looks at a target.

    Attributes:
        target: World position in the middle of the picture (metres).
        distance: From the eye to the target (metres).
        height: Height of the picture at the target (metres).
        yaw: Degrees around +Y; 0 looks at the front (+Z side), positive sees the left side.
        pitch: Degrees upwards; positive looks from above.
    """

    target: tuple[float, float, float]
    distance: float
    height: float
    yaw: float = 0.0
    pitch: float = 0.0

    def axes(self) -> FloatArray:
        """Rows: right, up and backward (towards the eye) unit vectors in world space."""
        yaw, pitch = np.radians(self.yaw), np.radians(self.pitch)
        back = np.array([np.sin(yaw) * np.cos(pitch), np.sin(pitch), np.cos(yaw) * np.cos(pitch)])
        right = np.array([np.cos(yaw), 0.0, -np.sin(yaw)])
        return np.stack([right, np.cross(back, right), back])


@dataclass(frozen=True)
class Light:
    """A directional light; the direction points towards it, in camera space."""

    direction: tuple[float, float, float]
    colour: tuple[float, float, float]
    wrap: float = 0.0


KEY = Light((-0.45, 0.62, 0.72), (1.0, 0.95, 0.88), 0.2)
FILL = Light((0.85, 0.10, 0.55), (0.20, 0.23, 0.27), 0.4)
RIM = Light((0.45, 0.55, -0.75), (0.5, 0.54, 0.62), 0.0)
SKY = (0.30, 0.32, 0.36)
GROUND = (0.20, 0.17, 0.15)
BACKGROUND = ((0.86, 0.87, 0.885), (0.64, 0.665, 0.70))


@dataclass(frozen=True)
class Surface:
    """Triangles with one material: colour is linear RGB, roughness as in glTF."""

    points: FloatArray
    triangles: IntArray
    normals: FloatArray
    colour: tuple[float, float, float]
    roughness: float = 0.6
    double_sided: bool = False


def picture(
    surfaces: Sequence[Surface], camera: Camera, size: tuple[int, int], supersample: int = 2
) -> Image.Image:
    """Render surfaces into an RGB image of ``size`` (width, height) pixels."""
    width, height = size[0] * supersample, size[1] * supersample
    points, triangles, owner = _merge(surfaces)
    axes = camera.axes()
    view = (points - np.asarray(camera.target)) @ axes.T
    depth = camera.distance - view[:, 2]
    scale = height / camera.height * camera.distance / np.maximum(depth, 1e-6)
    screen = np.stack([width / 2 + view[:, 0] * scale, height / 2 - view[:, 1] * scale], axis=1)
    keep = _front_facing(screen, triangles, owner, surfaces)
    casting = triangles
    triangles, owner = triangles[keep], owner[keep]
    fragments = rasterise(screen, depth, triangles, width, height)
    normals = np.concatenate([s.normals for s in surfaces]) @ axes.T
    image = _background(width, height)
    world = _interpolate(points, triangles, fragments)
    shadow = _shadow(points, casting, world, axes)
    lit = _shade(fragments, triangles, owner, normals, view, camera.distance, surfaces, shadow)
    lit *= _occlusion(fragments.depth, width, height, camera)[fragments.pixel][:, None]
    image.reshape(-1, 3)[fragments.pixel] = lit
    image = image.reshape(size[1], supersample, size[0], supersample, 3).mean((1, 3))
    encoded = np.clip(_tone(image), 0.0, 1.0) ** (1 / 2.2)
    return Image.fromarray((encoded * 255 + 0.5).astype(np.uint8), "RGB")


def _merge(surfaces: Sequence[Surface]) -> tuple[FloatArray, IntArray, IntArray]:
    """All points (V, 3), triangles (T, 3) and the surface that each triangle is of (T,)."""
    starts = np.cumsum([0] + [len(s.points) for s in surfaces])
    triangles = np.concatenate([s.triangles + o for s, o in zip(surfaces, starts, strict=False)])
    owner = np.repeat(np.arange(len(surfaces)), [len(s.triangles) for s in surfaces])
    return np.concatenate([s.points for s in surfaces]), triangles, owner


def _front_facing(
    screen: FloatArray, triangles: IntArray, owner: IntArray, surfaces: Sequence[Surface]
) -> NDArray[np.bool_]:
    """Triangles that show their front, or whose material is double-sided."""
    a, b, c = (screen[triangles[:, k]] for k in range(3))
    area = (b[:, 0] - a[:, 0]) * (c[:, 1] - a[:, 1]) - (b[:, 1] - a[:, 1]) * (c[:, 0] - a[:, 0])
    both = np.array([s.double_sided for s in surfaces])
    return np.asarray((area < 0) | (both[owner] & (area != 0)))


def _interpolate(values: FloatArray, triangles: IntArray, fragments: Fragments) -> FloatArray:
    """Vertex values (V, 3) at the fragments."""
    corners = values[triangles[fragments.triangle]]
    return np.asarray(np.einsum("fk,fkc->fc", fragments.bary, corners))


def _unit(vectors: FloatArray) -> FloatArray:
    """Vectors scaled to length one along the last axis."""
    length = np.linalg.norm(vectors, axis=-1, keepdims=True)
    return np.asarray(vectors / np.maximum(length, 1e-20))


def _shade(
    fragments: Fragments,
    triangles: IntArray,
    owner: IntArray,
    normals: FloatArray,
    view: FloatArray,
    distance: float,
    surfaces: Sequence[Surface],
    shadow: FloatArray,
) -> FloatArray:
    """Linear colour (F, 3) under the three lights and a sky above a darker ground."""
    normal = _unit(_interpolate(normals, triangles, fragments))
    position = _interpolate(view, triangles, fragments)
    to_eye = _unit(np.array([0.0, 0.0, distance]) - position)
    normal = np.where((normal * to_eye).sum(1, keepdims=True) < 0, -normal, normal)
    kind = owner[fragments.triangle]
    albedo = np.array([s.colour for s in surfaces])[kind]
    rough = np.array([s.roughness for s in surfaces])[kind]
    up = 0.5 + 0.5 * normal[:, 1:2]
    light = up * np.array(SKY) + (1 - up) * np.array(GROUND)
    shine = np.zeros_like(light)
    for source, visible in ((KEY, shadow), (FILL, np.ones(len(kind))), (RIM, np.ones(len(kind)))):
        toward = np.array(source.direction) / np.linalg.norm(source.direction)
        raw = (normal @ toward + source.wrap) / (1 + source.wrap)
        amount = np.clip(raw, 0, None) * visible
        light += amount[:, None] * np.array(source.colour)
        half = _unit(to_eye + toward)
        power = 2.0 / np.maximum(rough, 0.05) ** 3
        glint = (power + 8) / 25 * np.clip((normal * half).sum(1), 0, None) ** power
        glint *= 0.045 * np.minimum(amount * 4, 1)
        shine += glint[:, None] * np.array(source.colour)
    fresnel = (1 - np.clip((normal * to_eye).sum(1), 0, 1)) ** 4
    light += (0.25 * fresnel * up[:, 0])[:, None] * np.array(SKY) / max(SKY)
    return np.asarray(albedo * light + shine)


def _shadow(
    points: FloatArray, triangles: IntArray, world: FloatArray, axes: FloatArray
) -> FloatArray:
    """How much of the key light reaches each fragment (F,), from 0 to 1, with soft edges."""
    back = _unit(np.array(KEY.direction) @ axes)
    right = _unit(np.cross(np.array([0.0, 1.0, 0.0]), back))
    frame = np.stack([right, np.cross(back, right), back])
    seen = points @ frame.T
    low, high = seen.min(0), seen.max(0)
    side, extent = 1024, float((high - low)[:2].max()) * 1.02
    pixels = (seen[:, :2] - low[:2]) / extent * side
    height = high[2] - seen[:, 2] + 1.0
    hit = rasterise(pixels, height, triangles, side, side)
    at = world @ frame.T
    place = (at[:, :2] - low[:2]) / extent * side
    depth = high[2] - at[:, 2] + 1.0
    bias = extent * 0.006
    total = np.zeros(len(world))
    taps = [(x, y) for x in (-6, -3, 0, 3, 6) for y in (-6, -3, 0, 3, 6) if x * x + y * y < 50]
    for dx, dy in taps:
        cell = np.clip((place + np.array([dx, dy])).astype(np.int64), 0, side - 1)
        gap = depth - hit.depth[cell[:, 1] * side + cell[:, 0]] - bias
        total += 1.0 - np.clip(gap / (extent * 0.01), 0.0, 1.0)
    return np.asarray(0.2 + 0.8 * total / len(taps))


def _occlusion(depth: FloatArray, width: int, height: int, camera: Camera) -> FloatArray:
    """Darkening (H * W,) of places that lie behind their surroundings on the screen."""
    far = camera.distance + 0.25 * camera.height
    filled = np.where(np.isfinite(depth), depth, far).reshape(height, width)
    pixel = camera.height / height
    total = np.zeros_like(filled)
    for size, strength in ((0.003, 0.16), (0.010, 0.22), (0.022, 0.22)):
        radius = max(1, round(size / pixel))
        # Only what stands out by about the radius counts, so that far silhouettes do not glow.
        near = np.maximum(filled, box_blur(filled, radius) - size)
        behind = filled - box_blur(box_blur(np.minimum(near, far), radius), radius)
        total += strength * np.clip(behind / size, 0.0, 1.2)
    return np.asarray(np.clip(1.0 - total, 0.2, 1.0).ravel())


def _background(width: int, height: int) -> FloatArray:
    """A soft neutral gradient (H, W, 3), linear colour."""
    y, x = np.mgrid[0:height, 0:width]
    radius = np.hypot((x / width - 0.5) * 0.9, y / height - 0.42)
    blend = np.clip(radius / 0.85, 0.0, 1.0)[..., None] ** 1.5
    inner, outer = (np.array(c) ** 2.2 for c in BACKGROUND)
    return np.asarray(_untone(inner * (1 - blend) + outer * blend))


def _tone(image: FloatArray) -> FloatArray:
    """Compress highlights: linear up to about one half, then softly up to one."""
    return np.asarray(np.where(image < 0.5, image, 1.0 - 0.25 / np.maximum(image, 0.5)))


def _untone(image: FloatArray) -> FloatArray:
    """Inverse of `_tone`, for colours that must come out as given."""
    return np.asarray(np.where(image < 0.5, image, 0.25 / np.maximum(1.0 - image, 1e-3)))
