"""From tracked lips to a character's controls: the steps, in order (2012 paper, section VII)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from animeme.curves import Floats
from animeme.errors import InputError
from animeme_stages.crossmap.head import Head
from animeme_stages.crossmap.keys import find_keys, locate, read_keys
from animeme_stages.crossmap.points import (
    CHIN,
    EYES,
    INNER,
    LIPS,
    STILL,
    STILL_ONLY,
    numbers,
    scheme_of,
)
from animeme_stages.crossmap.pose import fit_similarity, remove_motion, rest_shape
from animeme_stages.crossmap.solve import bounded_least_squares
from animeme_stages.crossmap.tracks import Take

# A millimetre between the lips is seen sooner than one anywhere else.
_OPENING_WEIGHT = 2.0


@dataclass(frozen=True)
class Settings:
    """How frames are solved.

    Attributes:
        depth: weight of displacements to and from the camera; 1 trusts them like the others.
        ridge: price of a weight of 1, as part of the squared displacement that it and the mean
            control cause: what hardly moves the front view stays low.
        symmetric: both sides of the mouth get one weight.
        keys: "auto", "none", or a CSV file.
    """

    depth: float = 0.25
    ridge: float = 0.01
    symmetric: bool = False
    keys: str = "auto"


@dataclass(frozen=True, eq=False)
class Mapped:
    """All frames of all takes, F of them.

    Attributes:
        controls: N names.
        values: shape (F, N), from 0 to 1; NaN where points were lost.
        keys: key shapes that were used, 0 for none.
        key_residual, residual: shape (F,), root of the mean squared distance between the tracked
            lips and what key shapes, and the character's controls, make of them, across the line
            of sight; in units of the distance between the eyes.
    """

    controls: tuple[str, ...]
    values: Floats
    keys: int
    key_residual: Floats
    residual: Floats


def map_takes(takes: Sequence[Take], head: Head, settings: Settings, place: str) -> Mapped:
    """Controls of every frame.

    Args:
        takes: of one speaker and camera, with the same points.
        head: the character.
        settings: how to solve.
        place: what the takes were read from, for messages.

    Raises:
        InputError: points are missing, or no frame can be used.
    """
    scheme = _scheme(takes, place)
    chin = CHIN if set(numbers(scheme, CHIN)) <= set(takes[0].ids) else {}
    table = {**LIPS, **chin}
    moving = np.concatenate([take.of(numbers(scheme, table)) for take in takes])
    extra = tuple(n for n in STILL_ONLY[scheme] if n in takes[0].ids)
    still = np.concatenate([take.of((*numbers(scheme, STILL), *extra)) for take in takes])
    points = _steadied(np.concatenate([moving, still[:, : len(STILL)]], axis=1), still, place)
    usable = np.asarray(np.isfinite(points).all(axis=(1, 2)))
    if usable.sum() < 2:
        raise _invalid(place, "has less than two frames with all points of lips and head")
    count = len(table)
    first = np.concatenate([np.arange(len(take.times_s)) == 0 for take in takes])[usable]
    known = points[usable]
    order = [*table]
    upper, lower = ([order.index(pair[side]) for pair in INNER] for side in (0, 1))
    opening = np.linalg.norm(known[:, upper] - known[:, lower], axis=2).mean(axis=1)
    rest = rest_shape(known, opening, first)
    rows = head.rows((*table, *STILL))
    in_space = bool(np.ptp(moving[usable][..., 2]) > 0)
    # From the camera's axes to the character's: x to its left, y up, z forward.
    target = head.neutral[rows] * (1.0, 1.0, 1.0 if in_space else 0.0)
    _, turn, _ = fit_similarity(rest[None], target)
    eyes = rest[count : count + len(EYES)]
    distance = float(np.linalg.norm(eyes[:2].mean(axis=0) - eyes[2:].mean(axis=0)))
    if not distance > 0:
        raise _invalid(place, "has both eyes in one place")
    moved = (known[:, :count] - rest[:count]) @ turn[0].T / distance
    at = [(take.id, float(t)) for take in takes for t in take.times_s]
    frames = [frame for frame, good in zip(at, usable, strict=True) if good]
    measure = _Measure(settings.depth if in_space else 0.0, upper, lower)
    return _solved(moved, head, rows[:count], settings, measure, frames, usable)


def _scheme(takes: Sequence[Take], place: str) -> str:
    shared = set.intersection(*(set(take.ids) for take in takes))
    if not shared:
        raise _invalid(place, "has takes with different points")
    scheme = scheme_of(shared)
    lacking = [n for n in numbers(scheme, {**LIPS, **STILL}) if n not in shared]
    if lacking:
        listed = ", ".join(str(n) for n in lacking[:8]) + (" …" if len(lacking) > 8 else "")
        name = {"ibug": "iBUG's 68 points", "mediapipe": "MediaPipe's face mesh"}[scheme]
        raise _invalid(place, f"lacks points {listed} of {name}")
    return scheme


def _invalid(place: str, problem: str) -> InputError:
    return InputError(
        "landmarks-invalid", problem, place=place,
        action="Track lips, eye corners and nose by MediaPipe's or iBUG's numbers.",
    )  # fmt: skip


def _steadied(points: Floats, still: Floats, place: str) -> Floats:
    try:
        return remove_motion(points, still)
    except ValueError as error:
        raise _invalid(place, str(error)) from error


@dataclass(frozen=True)
class _Measure:
    """What of a lip shape counts, as rows of a least-squares problem."""

    depth: float
    upper: list[int]
    lower: list[int]

    def __call__(self, shapes: Floats) -> Floats:
        """Shape (F, L, 3) → (F, M)."""
        weighted = shapes * (1.0, 1.0, self.depth)
        opening = shapes[:, self.upper, :2] - shapes[:, self.lower, :2]
        flat = len(shapes), -1
        return np.concatenate(
            [weighted.reshape(flat), _OPENING_WEIGHT * opening.reshape(flat)], axis=1
        )


def _solved(
    moved: Floats, head: Head, rows: list[int], settings: Settings, measure: _Measure,
    frames: Sequence[tuple[str, float]], usable: NDArray[np.bool_],
) -> Mapped:  # fmt: skip
    """Key shapes, then controls, of the usable frames (F', L, 3)."""
    deltas, spread = _columns(head, rows, settings.symmetric)
    seen = measure(moved)
    blended, count, controls = moved, 0, None
    if settings.keys != "none":
        given = None
        if settings.keys == "auto":
            chosen = find_keys(seen)
        else:
            path = Path(settings.keys)
            given = read_keys(path, head.controls)
            chosen = locate(given, frames, path)
        blend = bounded_least_squares(seen[chosen].T, seen)
        blended, count = np.einsum("fk,klc->flc", blend, moved[chosen]), len(chosen)
        if given is not None and given.controls:
            # The character is posed for every key shape: the blend is that of its controls.
            columns = [head.controls.index(name) for name in given.controls]
            controls = np.zeros((len(moved), len(head.controls)))
            controls[:, columns] = np.clip(blend @ given.values, 0.0, 1.0)
    if controls is None:
        size = (deltas**2).sum(axis=(1, 2))
        penalty = settings.ridge * (size + size.mean())
        solved = bounded_least_squares(
            measure(deltas).T, measure(blended), upper=1.0, penalty=penalty
        )
        controls = np.clip(solved @ spread, 0.0, 1.0)
    made = np.einsum("fn,nlc->flc", controls, head.deltas[:, rows])
    found = []
    for part in (controls, _rms(blended - moved), _rms(made - moved)):
        whole = np.full((len(usable), *part.shape[1:]), np.nan)
        whole[usable] = part
        found.append(whole)
    return Mapped(head.controls, found[0], count, found[1], found[2])


def _rms(error: Floats) -> Floats:
    """Of each frame, across the line of sight."""
    return np.asarray(np.sqrt((error[..., :2] ** 2).sum(axis=2).mean(axis=1)))


def _columns(head: Head, rows: list[int], symmetric: bool) -> tuple[Floats, Floats]:
    """What is solved for, and how controls follow: displacements (V, L, 3) and a map (V, N).

    ARKit's mouthClose closes the lips of an open jaw, and may not exceed jawOpen. The jaw is solved
    for twice, with the lips and without: the sum is jawOpen, the latter is mouthClose.
    """
    names = head.controls
    groups: dict[str, list[int]] = {}
    for index, name in enumerate(names):
        stem = name.removesuffix("Left").removesuffix("Right") if symmetric else name
        groups.setdefault(stem, []).append(index)
    spread = np.zeros((len(groups), len(names)))
    for row, members in enumerate(groups.values()):
        spread[row, members] = 1.0
    if {"jawOpen", "mouthClose"} <= set(names):
        spread[[*groups].index("mouthClose"), names.index("jawOpen")] = 1.0
    return np.einsum("vn,nlc->vlc", spread, head.deltas[:, rows]), spread
