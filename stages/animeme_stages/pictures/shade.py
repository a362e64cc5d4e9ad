"""Camera, lights and the picture: what `raster` found, made to look like something."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import uniform_filter

from animeme_stages.pictures import style, textures
from animeme_stages.pictures.motion import Body, Motion
from animeme_stages.pictures.raster import (
    Canvas,
    Corners,
    Floats,
    Indices,
    Singles,
    barycentric,
    on_screen,
)
from animeme_stages.pictures.scene import Scene

Pixels = NDArray[np.uint8]


@dataclass(frozen=True)
class Camera:
    """A perspective camera that looks at a target.

    Attributes:
        target: world position in the middle of the picture.
        height: of the picture at the target, world units.
        mouth: width of the mouth that is looked at, world units; soft shadows are sized by it.
        yaw: degrees around +Y; 0 looks at what faces +Z, positive sees its left side.
        pitch: degrees; positive looks from above.
        distance: from the eye to the target, in heights of the picture.
    """

    target: tuple[float, float, float]
    height: float
    mouth: float
    yaw: float = 0.0
    pitch: float = 0.0
    distance: float = 4.0

    def axes(self) -> Floats:
        """Rows: right, up and backward (towards the eye) unit vectors in world space."""
        yaw, pitch = np.radians(self.yaw), np.radians(self.pitch)
        back = np.array([np.sin(yaw) * np.cos(pitch), np.sin(pitch), np.cos(yaw) * np.cos(pitch)])
        right = np.array([np.cos(yaw), 0.0, -np.sin(yaw)])
        return np.stack([right, np.cross(back, right), back])


@dataclass(frozen=True)
class Light:
    """A directional light; the direction points towards it, in the camera's space."""

    direction: tuple[float, float, float]
    colour: tuple[float, float, float]
    wrap: float = 0.0


KEY = Light((-0.45, 0.62, 0.72), (0.84, 0.80, 0.75), 0.25)
FILL = Light((0.85, 0.10, 0.55), (0.22, 0.24, 0.27), 0.4)
RIM = Light((0.45, 0.55, -0.75), (0.36, 0.39, 0.45), 0.0)
SKY = (0.30, 0.32, 0.35)
GROUND = (0.23, 0.20, 0.18)
# Places that lie behind their surroundings are darkened: radius in mouth widths, strength.
_CREVICES = ((0.05, 0.16), (0.18, 0.24), (0.42, 0.24))
_SHADOW_PX = 768
# Nobody sees what moves by less than this part of a sample.
_SEEN_PX = 0.2
_SOFT_PX = (-5, -2, 0, 2, 5)


class Renderer:
    """Draws a scene again and again; what can be worked out once, is.

    Args:
        scene: what to draw.
        camera: point of view.
        size: width and height in pixels.
        supersample: samples per pixel along each side.
        ranges: canonical shape → least and greatest weight in all pictures that will be drawn;
            what stands still then is drawn once. Any picture can be drawn if None.
        lit: weights of poses; where the main light falls is worked out for these and the most lit
            decides, so that frames of one film do not flicker. Each picture's own if empty.
    """

    def __init__(
        self,
        scene: Scene,
        camera: Camera,
        size: tuple[int, int],
        *,
        supersample: int = 2,
        ranges: Mapping[str, tuple[float, float]] | None = None,
        lit: Sequence[Mapping[str, float]] = (),
    ) -> None:
        self.camera, self.size, self.samples = camera, size, supersample
        self._body = Body(scene.meshes)
        least = _SEEN_PX * camera.height / (size[1] * supersample)
        self._motion = Motion(self._body, ranges, least)
        self._axes = camera.axes()
        self._background = _background(*size)
        self._light: Singles | None = None
        for weights in lit:
            found = self._key_light(self._motion.points(weights))
            self._light = found if self._light is None else np.maximum(self._light, found)
        changing = self._motion.changing
        self._changing = np.flatnonzero(changing)
        self._is_changing = np.append(changing, False)
        self._still = Canvas(size[0] * supersample, size[1] * supersample)
        self._still_colour = np.zeros((self._still.width * self._still.height, 3), np.float32)
        if not changing.all():
            self._draw_still(np.flatnonzero(~changing))

    def picture(self, weights: Mapping[str, float]) -> Pixels:
        """Draw the scene under canonical shape weights: RGB, shape (height, width, 3)."""
        points = self._motion.points(weights)
        light = self._key_light(points) if self._light is None else self._light
        canvas, colour = self._still.copy(), self._still_colour.copy()
        corners = self._draw(canvas, points, self._changing)
        pixel, triangle = canvas.pixels()
        new = self._is_changing[triangle]
        shown = self._shown(points, light)
        colour[pixel[new]] = self._shade(pixel[new], triangle[new], corners, shown)
        s, (width, height) = self.samples, self.size
        seen = np.zeros(canvas.width * canvas.height, np.float32)
        seen[pixel] = 1.0
        # Light is averaged, not its display values; rims stay clean.
        light_here = _pooled(colour.reshape(height, s, width, s, 3), np.add) / np.float32(s**2)
        share = (_pooled(seen.reshape(height, s, width, s), np.add) / np.float32(s**2))[..., None]
        close = _pooled(canvas.closeness().reshape(height, s, width, s), np.maximum)
        light_here *= self._crevices(close)[..., None] / np.maximum(share, np.float32(1e-6))
        mixed = style.displayed(_tone(light_here)) * share + self._background * (1.0 - share)
        return np.asarray((mixed * 255.0 + 0.5).astype(np.uint8))

    def _draw_still(self, chosen: Indices) -> None:
        """What is the same in all pictures."""
        points = self._motion.still
        light = self._key_light(points) if self._light is None else self._light
        corners = self._draw(self._still, points, chosen)
        pixel, triangle = self._still.pixels()
        shown = self._shown(points, light)
        self._still_colour[pixel] = self._shade(pixel, triangle, corners, shown)

    def _draw(self, canvas: Canvas, points: Floats, chosen: Indices) -> Corners:
        """Fill some triangles; gives them all, on the screen, with nothing in those not chosen."""
        camera, body = self.camera, self._body
        view = (points - np.asarray(camera.target)) @ self._axes.T
        # In units of the picture's distance: no scene is too small or too large.
        distance = 1.0 - view[:, 2] / (camera.distance * camera.height)
        scale = canvas.height / camera.height / np.maximum(distance, 1e-6)
        screen = np.stack(
            [canvas.width / 2 + view[:, 0] * scale, canvas.height / 2 - view[:, 1] * scale], axis=1
        )
        part = on_screen(screen, distance, body.triangles[chosen])
        # y is down on the screen.
        front = (part.area < 0) | body.double_sided[chosen]
        corners = part.of(len(body.triangles), chosen, front)
        canvas.fill(corners, chosen[~body.holed[chosen]])
        canvas.fill(corners, chosen[body.holed[chosen]], self._opaque)
        return corners

    def _opaque(self, triangle: Indices, bary: Singles) -> NDArray[np.bool_]:
        """Where the texture has no hole."""
        body, seen = self._body, np.ones(len(triangle), dtype=bool)
        kind = body.material[triangle]
        for index, material in enumerate(body.materials):
            if material.texture is not None and material.cutoff is not None:
                own = np.flatnonzero(kind == index)
                uv = _between(body.uv, body.triangles[triangle[own]], bary[own])
                seen[own] = textures.looked_up(material.texture, uv)[:, 3] >= material.cutoff
        return seen

    def _shade(
        self, pixel: Indices, triangle: Indices, corners: Corners, shown: Singles
    ) -> Singles:
        """Linear colour (F, 3) of pixels, from that of the vertices and from textures."""
        body = self._body
        bary = barycentric(corners, triangle, pixel, self._still.width)
        vertices = body.triangles[triangle]
        # The back of what has two sides has its own light.
        vertices[corners.area[triangle] > 0] += len(body.welded)
        colour = _between(shown, vertices, bary)
        kind = body.material[triangle]
        for index, material in enumerate(body.materials):
            if material.texture is not None:
                own = np.flatnonzero(kind == index)
                uv = _between(body.uv, body.triangles[triangle[own]], bary[own])
                colour[own] *= textures.looked_up(material.texture, uv)[:, :3]
        return colour

    def _shown(self, points: Floats, light: Singles) -> Singles:
        """Linear colour (2 V, 3) of each vertex, from its front and from its back.

        There are three lights, and a sky above a darker ground.
        """
        body = self._body
        front = (self._motion.normals(points) @ self._axes.T).astype(np.float32)
        normal = np.concatenate([front, -front])
        lit = np.concatenate([light, light])
        up = (0.5 + 0.5 * normal[:, 1])[:, None]
        total = up * np.array(SKY, np.float32) + (1 - up) * np.array(GROUND, np.float32)
        for source in (KEY, FILL, RIM):
            toward = np.array(source.direction) / np.linalg.norm(source.direction)
            raw = (normal @ toward.astype(np.float32) + source.wrap) / (1 + source.wrap)
            amount = np.maximum(raw, 0) * (lit if source is KEY else np.float32(1))
            total += amount[:, None] * np.array(source.colour, np.float32)
        gloss = self._gloss(normal, lit, np.concatenate([body.roughness, body.roughness]))
        return np.asarray(np.concatenate([body.albedo, body.albedo]) * total + gloss[:, None])

    def _gloss(self, normal: Singles, lit: Singles, rough: Singles) -> Singles:
        """How much a surface mirrors the main light: eyes, teeth and lips live by it."""
        toward = np.array(KEY.direction) / np.linalg.norm(KEY.direction)
        half = toward + np.array([0.0, 0.0, 1.0])
        facing = np.maximum(normal @ (half / np.linalg.norm(half)).astype(np.float32), 0)
        power = 2.0 / np.maximum(rough, 0.15) ** 3
        return np.asarray((power + 8) / 25 * facing**power * 0.05 * lit)

    def _key_light(self, points: Floats) -> Singles:
        """How much of the main light reaches each vertex (V,), 0.25 to 1, with soft edges."""
        camera, body = self.camera, self._body
        back = np.array(KEY.direction) @ self._axes
        back /= np.linalg.norm(back)
        right = np.cross([0.0, 1.0, 0.0], back)
        right /= max(float(np.linalg.norm(right)), 1e-9)
        seen = (points - np.asarray(camera.target)) @ np.stack(
            [right, np.cross(back, right), back]
        ).T
        extent = 2.4 * camera.height
        place = (seen[:, :2] / extent + 0.5) * _SHADOW_PX
        reach = max(float(np.abs(seen[:, 2]).max()), extent) * 1.01
        depth = 2.0 - seen[:, 2] / reach
        canvas = Canvas(_SHADOW_PX, _SHADOW_PX)
        canvas.fill(on_screen(place, depth, body.triangles), np.flatnonzero(~body.holed))
        close = canvas.closeness()
        blocked = np.where(close > 0, 1.0 / np.maximum(close, 1e-6), np.inf)
        bias, soft = 0.12 * camera.mouth / reach, 0.2 * camera.mouth / reach
        total = np.zeros(len(points), np.float64)
        taps = [(x, y) for x in _SOFT_PX for y in _SOFT_PX if x * x + y * y < 30]
        for dx, dy in taps:
            cell = np.clip((place + np.array([dx, dy])).astype(np.int64), 0, _SHADOW_PX - 1)
            gap = depth - blocked[cell[:, 1], cell[:, 0]] - bias
            total += 1.0 - np.clip(gap / soft, 0.0, 1.0)
        return np.asarray(0.25 + 0.75 * total / len(taps), dtype=np.float32)

    def _crevices(self, close: Singles) -> Singles:
        """Darkening (height, width) of places that lie behind their surroundings."""
        camera = self.camera
        whole = camera.distance * camera.height
        far = np.float32(whole + 5 * camera.mouth)
        depth = np.where(close > 0, whole / np.maximum(close, 1e-6), far).astype(np.float32)
        total = np.zeros_like(depth)
        for share, strength in _CREVICES:
            size = np.float32(share * camera.mouth)
            across = 2 * max(1, round(float(size) / camera.height * self.size[1])) + 1
            # Only what stands out by about the radius counts, so that far rims do not glow.
            near = np.maximum(depth, uniform_filter(depth, across, mode="nearest") - size)
            behind = uniform_filter(np.minimum(near, far), across, mode="nearest")
            behind = depth - uniform_filter(behind, across, mode="nearest")
            total += np.float32(strength) * np.clip(behind / size, 0.0, 1.2)
        return np.asarray(np.clip(1.0 - total, 0.2, 1.0))


def _pooled(image: Singles, join: np.ufunc) -> Singles:
    """Samples (height, s, width, s, …) of each pixel, joined."""
    found = image[:, 0, :, 0].copy()
    for i in range(image.shape[1]):
        for j in range(image.shape[3]):
            if i or j:
                join(found, image[:, i, :, j], out=found)
    return found


def _between(values: Singles, vertices: Indices, bary: Singles) -> Singles:
    """Vertex values (V, C) within triangles (F, 3), at barycentric coordinates (F, 3)."""
    found = values[vertices[:, 0]] * bary[:, :1]
    found += values[vertices[:, 1]] * bary[:, 1:2]
    found += values[vertices[:, 2]] * bary[:, 2:]
    return np.asarray(found)


def _background(width: int, height: int) -> Singles:
    """A soft neutral gradient (height, width, 3), display values."""
    y, x = np.mgrid[0:height, 0:width]
    radius = np.hypot((x / width - 0.5) * 0.9, y / height - 0.42)
    blend = np.clip(radius / 0.85, 0.0, 1.0)[..., None] ** 1.5
    inner, outer = (np.array(colour) / 255.0 for colour in style.BACKDROP)
    return np.asarray(inner * (1 - blend) + outer * blend, dtype=np.float32)


def _tone(light: Singles) -> Singles:
    """Compress highlights: linear up to about one half, then softly up to one."""
    return np.asarray(np.where(light < 0.5, light, 1.0 - 0.25 / np.maximum(light, 0.5)))
