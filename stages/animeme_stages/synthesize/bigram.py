"""Phone bigrams: curves for pairs of phones, stitched, smoothed and kept within limits.

Xu, Feng, Marsella & Shapiro, "A practical and configurable lip sync method for games" ("the 2013
paper"), section 2.2: stitch by maximum, smooth, resolve conflicts of poses, limit speed.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from itertools import pairwise
from typing import Any, ClassVar

import numpy as np
from scipy.interpolate import BSpline

from animeme.curves import Floats
from animeme.dataset import Dataset, Listener
from animeme.phones import PhoneTrack
from animeme_stages.synthesize.bigram_set import ANY, LOCAL, PAUSE, BigramSet, common_phone
from animeme_stages.synthesize.fitted import FittedModel
from animeme_stages.synthesize.numbers import rounded
from animeme_stages.synthesize.spoken import Ints

# Section 2.2.2: thresholds of pairs of poses, 2.0 for all others, and priorities, lowest first.
CONFLICTS: dict[frozenset[str], float] = {
    frozenset({"open", other}): 0.5 for other in ("FV", "PBM", "ShCh")
}
PRIORITY = ("open", "W", "wide", "ShCh", "FV", "PBM")
# Points of a fitted polygon, evenly spread over its pair.
POINTS = 8
# How often frames are given to the bigram that is largest there, and polygons fitted to them.
_TURNS = 6
# Each point of a fitted polygon is held to the mean of all pairs as if by this many frames.
_RIDGE = 2.0
# Before the first and after the last phone the mouth is taken to rest this long.
_REST_S = 0.1


@dataclass(frozen=True)
class BigramOptions:
    """Options of `Bigram`."""

    window_s: float = field(default=0.0, metadata={"low": 0, "high": 1})
    speed: float = field(default=15.0, metadata={"low": 0.01, "high": 1e6})
    contacts: bool = False


class Bigram(FittedModel):
    """Curves of pairs of phones; fitted to captured motion, or made by an animator.

    Attributes:
        set_: the polygons of each pair.
    """

    name: ClassVar[str] = "bigram"
    Options = BigramOptions
    options: BigramOptions

    def __init__(self, options: BigramOptions | None = None) -> None:
        """See `FittedModel`."""
        super().__init__(options)
        self.set_ = BigramSet({}, ())

    def _learn(self, dataset: Dataset, listener: Listener) -> None:
        self.set_ = _seed(dataset, listener)

    def _move(self, track: PhoneTrack, times_s: Floats) -> Floats:
        curves, _ = self._stitched(track, times_s)
        for column in range(curves.shape[1]):
            curves[:, column] = smooth(times_s, curves[:, column], self.options.window_s)
        curves = resolve(curves, self.controls_)
        return limit_speed(times_s, curves, self.options.speed)

    def trace(self, track: PhoneTrack, times_s: Floats) -> list[list[str]]:
        """The entry of the set that each value comes from, so that an animator finds what to edit.

        Args:
            track: the phones.
            times_s: shape (T,).

        Returns:
            For each time, for each control, the entry (see `BigramSet.source`).
        """
        names = [common_phone(symbol) for symbol, _, _ in _segments(track)]
        _, index = self._stitched(track, times_s)
        return [[self.set_.source(names[i], names[i + 1]) for i in row] for row in index.tolist()]

    def _stitched(self, track: PhoneTrack, times_s: Floats) -> tuple[Floats, Ints]:
        """The larger of the two bigrams at each time (section 2.2.1), and which it is; (T, N)."""
        parts = _segments(track)
        names = [common_phone(symbol) for symbol, _, _ in parts]
        starts = np.array([start_s for _, start_s, _ in parts])
        bounds = np.append(starts, parts[-1][2])
        current = np.clip(np.searchsorted(starts, times_s, side="right") - 1, 0, len(parts) - 1)
        best = np.full((len(times_s), len(self.controls_)), -np.inf)
        index = np.zeros(best.shape, dtype=np.int64)
        tables = np.stack([self.set_.table(a, b) for a, b in pairwise(names)])
        for back in (1, 0):  # the pair that ends with the current phone, and the one it begins
            pair = current - back
            inside = (pair >= 0) & (pair < len(tables))
            which = pair[inside]
            local = (times_s[inside] - bounds[which]) / (bounds[which + 2] - bounds[which])
            place = np.clip(local, 0.0, 1.0) * (len(LOCAL) - 1)
            low = np.minimum(place.astype(np.int64), len(LOCAL) - 2)
            part = (place - low)[:, None]
            value = (1 - part) * tables[which, low] + part * tables[which, low + 1]
            larger = value > best[inside]
            best[inside] = np.where(larger, value, best[inside])
            index[inside] = np.where(larger, which[:, None], index[inside])
        return best, index

    def _to_json(self) -> dict[str, Any]:
        return {"bigrams": self.set_.to_json()}

    def _from_json(self, learned: Mapping[str, Any]) -> None:
        self.set_ = BigramSet.from_json(learned["bigrams"], self.controls_)


def _segments(track: PhoneTrack) -> list[tuple[str, float, float]]:
    """Symbol and borders of each phone, between rests, so that every phone is in two bigrams."""
    inner = [(s, p.start_s, p.end_s) for s, p in zip(track.ipa(), track.phones, strict=True)]
    end_s = track.duration_s
    return [("sil", -_REST_S, 0.0), *inner, ("sil", end_s, end_s + _REST_S)]


def smooth(times_s: Floats, curve: Floats, window_s: float) -> Floats:
    """Join local maxima that are closer than a window, over the valley between (section 2.2.1)."""
    middle = curve[1:-1]
    peaks = 1 + np.flatnonzero((middle >= curve[:-2]) & (middle > curve[2:]))
    joined = curve.copy()
    for first, second in pairwise(peaks.tolist()):
        if times_s[second] - times_s[first] < window_s:
            inside = slice(first, second + 1)
            line = np.interp(times_s[inside], times_s[[first, second]], curve[[first, second]])
            joined[inside] = np.maximum(joined[inside], line)
    return joined


def resolve(curves: Floats, controls: Sequence[str]) -> Floats:
    """Lower the pose of less priority where two poses do not go together (section 2.2.2)."""
    found = curves.copy()
    ranked = sorted((name for name in controls if name in PRIORITY), key=PRIORITY.index)
    # From the highest on, so that what gave way is what others are then compared with.
    for high in reversed(range(len(ranked))):
        for low in reversed(range(high)):
            a, b = controls.index(ranked[high]), controls.index(ranked[low])
            threshold = CONFLICTS.get(frozenset({ranked[high], ranked[low]}), 2.0)
            over = found[:, a] + found[:, b] - threshold
            # The paper's formula has a product where its text asks for this difference.
            found[:, b] = np.where(over > 0, np.maximum(found[:, b] - over, 0.0), found[:, b])
    return found


def limit_speed(times_s: Floats, curves: Floats, speed: float) -> Floats:
    """The largest curves below `curves` that nowhere rise or fall faster (section 2.2.3).

    Args:
        times_s: shape (T,).
        curves: shape (T, N).
        speed: in weights per second.
    """
    ramp = (speed * times_s)[:, None]
    rising = np.minimum.accumulate(curves - ramp, axis=0) + ramp
    both: Floats = np.minimum.accumulate((rising + ramp)[::-1], axis=0)[::-1] - ramp
    return both


def _polygon_matrix() -> Floats:
    """From a polygon of `POINTS` even points to its spline at `LOCAL`, shape (SAMPLES, POINTS)."""
    degree = 3
    inner = np.linspace(0.0, 1.0, POINTS - degree + 1)
    knots = np.concatenate([np.zeros(degree), inner, np.ones(degree)])
    # Points at the Greville abscissae, for which the spline's time is its parameter.
    return np.asarray(BSpline.design_matrix(LOCAL, knots, degree).toarray())


def greville() -> Floats:
    """Local times of a fitted polygon's points, shape (POINTS,)."""
    inner = np.linspace(0.0, 1.0, POINTS - 2)
    knots = np.concatenate([np.zeros(3), inner, np.ones(3)])
    return np.array([knots[i + 1 : i + 4].mean() for i in range(POINTS)])


def _seed(dataset: Dataset, listener: Listener) -> BigramSet:
    """Polygons that, stitched by maximum, come near the captured curves.

    In turns: every frame goes to the larger of its two bigrams, and each bigram is fitted to its
    frames (a max-affine regression: Magnani & Boyd 2009).
    """
    frames = _Frames(dataset)
    controls = len(dataset.controls)
    mean = fit_polygons(frames.basis, frames.values, np.zeros((POINTS, controls)), 0.01)
    polygons = dict.fromkeys(frames.pairs, mean)
    for turn in range(_TURNS):
        owner = frames.owners(polygons) if turn else np.ones(frames.values.shape, dtype=bool)
        polygons = {
            name: fit_polygons(
                frames.basis[rows], np.where(owner[rows], frames.values[rows], np.nan), mean, _RIDGE
            )
            for name, rows in frames.pairs.items()
        }
        listener("bigrams", (turn + 1) / _TURNS)
    polygons |= _wildcards(polygons, {n: len(r) for n, r in frames.pairs.items()}, mean)
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

    def __init__(self, dataset: Dataset) -> None:
        matrix = _polygon_matrix()
        which: dict[str, list[int]] = defaultdict(list)
        basis: list[Floats] = []
        values: list[Floats] = []
        frame: list[Ints] = []
        count = row = 0
        for line in dataset.lines:
            parts = _segments(line.track)
            names = [common_phone(symbol) for symbol, _, _ in parts]
            bounds = np.array([start_s for _, start_s, _ in parts] + [parts[-1][2]])
            current = np.searchsorted(bounds, line.times_s, side="right") - 1
            current = np.clip(current, 0, len(parts) - 1)
            for back in (1, 0):
                pair = current - back
                inside = np.flatnonzero((pair >= 0) & (pair < len(parts) - 1))
                first = pair[inside]
                local = (line.times_s[inside] - bounds[first]) / (bounds[first + 2] - bounds[first])
                place = np.clip(local, 0, 1) * (len(LOCAL) - 1)
                low = np.minimum(place.astype(np.int64), len(LOCAL) - 2)
                part = (place - low)[:, None]
                basis.append((1 - part) * matrix[low] + part * matrix[low + 1])
                values.append(line.values[inside])
                frame.append(count + inside)
                for offset, p in enumerate(first.tolist()):
                    which[f"{names[p]}|{names[p + 1]}"].append(row + offset)
                row += len(inside)
            count += len(line.times_s)
        self.basis = np.concatenate(basis)
        self.values = np.concatenate(values)
        self.frame = np.concatenate(frame)
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


def fit_polygons(basis: Floats, values: Floats, towards: Floats, ridge: float) -> Floats:
    """Least squares for each control over its known rows, held `towards` a polygon; (POINTS, N)."""
    found = np.empty(towards.shape)
    for column in range(values.shape[1]):
        known = np.isfinite(values[:, column])
        own = basis[known]
        matrix = own.T @ own + ridge * np.eye(POINTS)
        found[:, column] = np.linalg.solve(
            matrix, own.T @ values[known, column] + ridge * towards[:, column]
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


__all__ = ["PAUSE", "Bigram", "BigramOptions", "limit_speed", "resolve", "smooth"]
