"""Where to look: the camera is placed by what moves, as no file says where its face is."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass

import numpy as np

from animeme_stages.pictures.raster import Canvas, Floats, Indices, Singles, on_screen
from animeme_stages.pictures.scene import Scene, SceneMesh
from animeme_stages.pictures.shade import Camera

# What moves at least this much of what moves most is the mouth and what goes with it.
_MUCH = 0.25
# Lips, chin and cheeks that move are about so many mouths wide, ...
_MOUTHS = 2.2
# ... and a face so many times as high as they are, from below the chin to above the brows.
_FACE = 2.75
# Of the height of the picture, what is below the lowest of them.
_BELOW = 0.14
# A view from elsewhere than +Z must show so much more of what moves.
_CLEARLY = 1.3
_LOOK_PX = 96
# Weights that vary by less do not move anything.
_STILL = 1e-4
# Height of the picture, where all of what speaks is shown, by its own.
_MARGIN = 1.15
# A little from the side, so that lips can be seen to protrude.
SIDE_DEG = 12.0


@dataclass(frozen=True, eq=False)
class _Moving:
    """Drawn meshes, how far each vertex moves, and where those get to that move much.

    (V, 3), (V,) and (R, 3).
    """

    points: Floats
    amount: Floats
    reached: Floats
    meshes: tuple[SceneMesh, ...]
    owner: Indices


def face_camera(
    scene: Scene, ranges: Mapping[str, float], *, aspect: float, side_deg: float = SIDE_DEG
) -> Camera:
    """A camera that looks at the face.

    Args:
        scene: what is looked at.
        ranges: canonical shape → by how much its weight varies.
        aspect: width of the picture divided by its height.
        side_deg: turn of the camera to the face's left.
    """
    moving = _moving(scene, ranges)
    much = moving.amount >= _MUCH * moving.amount.max()
    yaw_deg = _front(moving, much) + side_deg
    axes = Camera((0.0, 0.0, 0.0), 1.0, 1.0, yaw_deg).axes()
    seen, reached = moving.points @ axes.T, moving.reached @ axes.T
    region = np.concatenate([seen[much], reached])
    low, high = (np.percentile(region, q, axis=0) for q in (2, 98))
    size = float(max(high[0] - low[0], high[1] - low[1], 1e-9))
    # The meshes that speak, where they are no more than a head; else a part of the body.
    speaking = np.isin(moving.owner, np.unique(moving.owner[much]))
    whole = np.concatenate([seen[speaking], reached])
    head_low, head_high = whole.min(0), whole.max(0)
    wide, tall = (head_high - head_low)[:2].tolist()
    height = _FACE * size
    if tall < height:
        height = _MARGIN * max(tall, wide / aspect, 1e-9)
        across, up = (head_low[:2] + head_high[:2]) / 2
    else:
        height = max(height, 1.25 * float(high[0] - low[0]) / aspect)
        # Nothing above the head, but the mouth stays in sight.
        top = min(low[1] - _BELOW * height + height, head_high[1] + 0.06 * height)
        up = min(max(top, high[1] + 0.1 * height) - height / 2, low[1] + 0.4 * height)
        # Seen from the side, the head's middle is beside the mouth's.
        across = (low[0] + high[0]) / 2
        if wide < height * aspect * 1.5:
            across = (across + (head_low[0] + head_high[0]) / 2) / 2
    x, y, z = (np.array([across, up, high[2] - 0.5 * size]) @ axes).tolist()
    return Camera((x, y, z), height, size / _MOUTHS, yaw_deg)


def ranges_of(names: Iterable[str], weights: Floats) -> dict[str, float]:
    """By how much each weight varies, or is away from 0 all the time; (T, N)."""
    spread = np.maximum(np.ptp(weights, axis=0), np.abs(weights).max(0) * 0.25)
    return dict(zip(names, spread.tolist(), strict=True))


def limits_of(names: Iterable[str], weights: Floats) -> dict[str, tuple[float, float]]:
    """The least and the greatest of each weight; (T, N)."""
    return dict(
        zip(names, zip(weights.min(0).tolist(), weights.max(0).tolist(), strict=True), strict=True)
    )


def _moving(scene: Scene, ranges: Mapping[str, float]) -> _Moving:
    """How far the shapes that vary move each vertex; all shapes do where none varies."""
    meshes = tuple(mesh for mesh in scene.meshes if mesh.primitives)
    amounts = [_amount(mesh, ranges) for mesh in meshes]
    if not max(amount.max(initial=0.0) for amount in amounts) > 0:
        ranges = {name: 1.0 for mesh in meshes for name in mesh.targets}
        amounts = [_amount(mesh, ranges) for mesh in meshes]
    if not max(amount.max(initial=0.0) for amount in amounts) > 0:
        amounts = [np.ones(len(mesh.points)) for mesh in meshes]
    most = max(float(amount.max(initial=0.0)) for amount in amounts)
    drawn, reached = [], [np.zeros((0, 3))]
    for mesh, amount in zip(meshes, amounts, strict=True):
        used = np.zeros(len(mesh.points), dtype=bool)
        for primitive in mesh.primitives:
            used[primitive.triangles] = True
        # Only what is drawn: exporters leave vertices behind.
        drawn.append((mesh.deformed({})[used], amount[used]))
        much = used & (amount >= _MUCH * most)
        for name, target in mesh.targets.items():
            if much.any() and ranges.get(name, 0.0) > _STILL:
                reached.append(mesh.deformed({})[much] + ranges[name] * target.offsets[-1][much])
    owner = np.repeat(np.arange(len(meshes)), [len(points) for points, _ in drawn])
    return _Moving(
        np.concatenate([points for points, _ in drawn]),
        np.concatenate([amount for _, amount in drawn]),
        np.concatenate(reached),
        meshes,
        owner,
    )


def _amount(mesh: SceneMesh, ranges: Mapping[str, float]) -> Floats:
    total = np.zeros(len(mesh.points))
    for name, target in mesh.targets.items():
        if ranges.get(name, 0.0) > _STILL:
            total += ranges[name] * np.linalg.norm(target.offsets[-1], axis=1)
    return total


def _front(moving: _Moving, much: Floats) -> float:
    """The side, in degrees around +Y, from which most of what moves can be seen."""
    points = np.concatenate([mesh.deformed({}) for mesh in moving.meshes])
    starts = np.cumsum([0] + [len(mesh.points) for mesh in moving.meshes])
    triangles = np.concatenate([
        primitive.triangles + start
        for mesh, start in zip(moving.meshes, starts, strict=False)
        for primitive in mesh.primitives
    ])  # fmt: skip
    double_sided = np.concatenate([
        np.full(len(primitive.triangles), primitive.material.double_sided)
        for mesh in moving.meshes
        for primitive in mesh.primitives
    ])  # fmt: skip
    amount = np.zeros(len(points), np.float32)
    used = np.unique(triangles)
    amount[used] = moving.amount
    near = np.concatenate([moving.points[much], moving.reached])
    low, high = near.min(0), near.max(0)
    extent = 1.5 * float(max((high - low).max(), 1e-9))
    found: list[float] = []
    turns = (0.0, 180.0, 90.0, -90.0)
    for yaw in turns:
        axes = Camera((0.0, 0.0, 0.0), 1.0, 1.0, yaw).axes()
        view = (points - (low + high) / 2) @ axes.T
        screen = (view[:, :2] * [1, -1] / extent + 0.5) * _LOOK_PX
        reach = max(float(np.abs(view[:, 2]).max()), 1e-9) * 1.01
        canvas = Canvas(_LOOK_PX, _LOOK_PX)
        corners = on_screen(screen, 2.0 - view[:, 2] / reach, triangles)
        canvas.fill(corners, np.flatnonzero((corners.area < 0) | double_sided))
        _, shown = canvas.pixels()
        of_triangle: Singles = amount[triangles].mean(1)
        found.append(float(of_triangle[shown].sum()))
    best = int(np.argmax(found))
    return turns[best] if found[best] > _CLEARLY * found[0] else turns[0]
