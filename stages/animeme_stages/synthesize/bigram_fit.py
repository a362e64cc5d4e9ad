"""Polygons that, stitched by maximum, come near given curves."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Callable, Mapping
from typing import Any

import numpy as np
import scipy  # its parts load when they are first used

from animeme.curves import Floats
from animeme.dataset import CapturedLine, Dataset, Listener
from animeme.phones import PhoneTrack
from animeme_stages.synthesize.bigram_passes import Segments, segments
from animeme_stages.synthesize.bigram_set import ANY, COMMON, LOCAL, BigramSet
from animeme_stages.synthesize.numbers import rounded
from animeme_stages.synthesize.spoken import Ints

# Points of a fitted polygon, evenly spread over its pair.
POINTS = 8
# How often frames are given to the bigram that is largest there, and polygons fitted to them.
_TURNS = 6
# Each point of a fitted polygon is held to the mean of all pairs as if by this many frames.
_RIDGE = 2.0

Classes = Mapping[str, tuple[str, ...]]
Layer = Callable[[PhoneTrack], Segments]
Emphasis = Callable[[CapturedLine], Floats]


def _evenly(line: CapturedLine) -> Floats:
    return np.ones(len(line.times_s))


def polygon_matrix(points: int = POINTS) -> Floats:
    """From a polygon of even points to its spline at `LOCAL`, shape (SAMPLES, points)."""
    degree = min(3, points - 1)
    # Points at the Greville abscissae, for which the spline's time is its parameter.
    return np.asarray(
        scipy.interpolate.BSpline.design_matrix(LOCAL, _knots(points), degree).toarray()
    )


def greville(points: int = POINTS) -> Floats:
    """Local times of an even polygon's points, shape (points,)."""
    degree = min(3, points - 1)
    knots = _knots(points)
    return np.array([knots[i + 1 : i + degree + 1].mean() for i in range(points)])


def _knots(points: int) -> Floats:
    degree = min(3, points - 1)
    inner = np.linspace(0.0, 1.0, points - degree + 1)
    return np.concatenate([np.zeros(degree), inner, np.ones(degree)])


def fit_polygons_of(
    dataset: Dataset,
    classes: Classes,
    listener: Listener,
    lay: Layer = segments,
    emphasis: Emphasis = _evenly,
) -> tuple[dict[str, Floats], dict[str, int], Floats]:
    """Polygons of all pairs that occur in `dataset`.

    In turns: every frame goes to the larger of its two bigrams, and each bigram is fitted to its
    frames (a max-affine regression: Magnani & Boyd 2009).

    Args:
        dataset: tracks and curves.
        classes: class → its phones.
        listener: told of progress.
        lay: the segments of a track.
        emphasis: how much each frame of a line counts, shape (F,).

    Returns:
        Pair → polygon, shape (POINTS, N); pair → number of its frames; the mean polygon.
    """
    frames = _Frames(dataset, classes, lay, emphasis)
    controls = len(dataset.controls)
    rest = np.zeros((POINTS, controls))
    mean = fit_polygons(frames.basis, frames.values, frames.counts, rest, 0.01)
    polygons = dict.fromkeys(frames.pairs, mean)
    for turn in range(_TURNS):
        owner = frames.owners(polygons) if turn else np.ones(frames.values.shape, dtype=bool)
        polygons = {
            name: fit_polygons(
                frames.basis[rows],
                np.where(owner[rows], frames.values[rows], np.nan),
                frames.counts[rows],
                mean,
                _RIDGE,
            )
            for name, rows in frames.pairs.items()
        }
        listener("bigrams", (turn + 1) / _TURNS)
    return polygons, {name: len(rows) for name, rows in frames.pairs.items()}, mean


def fit_set(dataset: Dataset, listener: Listener) -> BigramSet:
    """The set of a dataset: its controls are the poses, and stand-ins make up what it lacks."""
    polygons, counts, mean = fit_polygons_of(dataset, COMMON, listener)
    polygons |= _wildcards(polygons, counts, mean)
    at = rounded(greville()).tolist()
    table = {
        pair: {
            control: list(zip(at, rounded(polygon[:, column]).tolist(), strict=True))
            for column, control in enumerate(dataset.controls)
        }
        for pair, polygon in sorted(polygons.items())
    }
    return BigramSet(table, dataset.controls)


class _Frames:
    """Every captured frame in each of its two bigrams."""

    def __init__(self, dataset: Dataset, classes: Classes, lay: Layer, emphasis: Emphasis) -> None:
        classify = BigramSet({}, (), classes).class_of
        matrix = polygon_matrix()
        which: dict[str, list[int]] = defaultdict(list)
        basis: list[Floats] = []
        values: list[Floats] = []
        frame: list[Ints] = []
        counts: list[Floats] = []
        count = row = 0
        for line in dataset.lines:
            parts = lay(line.track)
            names = [classify(symbol) for symbol in parts.symbols]
            counted = emphasis(line)
            for rows, pair, low, part in parts.bigrams_at(line.times_s):
                up = part[:, None]
                basis.append((1 - up) * matrix[low] + up * matrix[low + 1])
                values.append(line.values[rows])
                frame.append(count + rows)
                counts.append(counted[rows])
                for offset, p in enumerate(pair.tolist()):
                    which[f"{names[p]}|{names[p + 1]}"].append(row + offset)
                row += len(rows)
            count += len(line.times_s)
        self.basis = np.concatenate(basis)
        self.values = np.concatenate(values)
        self.frame = np.concatenate(frame)
        self.counts = np.concatenate(counts)
        self.pairs = {name: np.array(rows) for name, rows in sorted(which.items())}
        self.count = count

    def owners(self, polygons: Mapping[str, Floats]) -> Any:
        """Whether each row is the larger of its frame's two, shape (rows, N)."""
        value: Floats = np.empty(self.values.shape)
        for name, rows in self.pairs.items():
            value[rows] = self.basis[rows] @ polygons[name]
        largest = np.full((self.count, self.values.shape[-1]), -np.inf)
        np.maximum.at(largest, self.frame, value)
        return value >= largest[self.frame]


def fit_polygons(
    basis: Floats, values: Floats, counts: Floats, towards: Floats, ridge: float
) -> Floats:
    """Least squares for each control over its known rows, held `towards` a polygon; (POINTS, N)."""
    found = np.empty(towards.shape)
    for column in range(values.shape[1]):
        known = np.isfinite(values[:, column])
        own = basis[known]
        weighted = own * counts[known, None]
        matrix = weighted.T @ own + ridge * np.eye(POINTS)
        found[:, column] = np.linalg.solve(
            matrix, weighted.T @ values[known, column] + ridge * towards[:, column]
        )
    return found


def _wildcards(
    polygons: Mapping[str, Floats], counts: Mapping[str, int], mean: Floats
) -> dict[str, Floats]:
    """Averages over what comes before or after each common phone, by how often it does."""
    sums: dict[str, Any] = defaultdict(lambda: np.zeros(mean.shape))
    weights: dict[str, int] = defaultdict(int)
    for pair, polygon in polygons.items():
        first, second = pair.split("|")
        for name in (f"{first}|{ANY}", f"{ANY}|{second}"):
            sums[name] = sums[name] + counts[pair] * polygon
            weights[name] += counts[pair]
    found = {name: total / weights[name] for name, total in sums.items()}
    return {**found, f"{ANY}|{ANY}": mean}
