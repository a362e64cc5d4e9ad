"""Control curves: weights over time, and how few keys they need."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

Floats = NDArray[np.float64]
Keys = NDArray[np.intp]


@dataclass(frozen=True, eq=False)
class CurveSet:
    """Named curves that share one time axis, linear between keys, constant outside them.

    Attributes:
        times_s: shape (T,), strictly increasing, finite, at least one key.
        names: N distinct names, one per column.
        weights: shape (T, N), finite.

    Raises:
        ValueError: an invariant does not hold; the message names the first offender.
    """

    times_s: Floats
    names: tuple[str, ...]
    weights: Floats

    def __post_init__(self) -> None:
        times_s = np.array(self.times_s, dtype=np.float64)
        weights = np.array(self.weights, dtype=np.float64)
        names = tuple(self.names)
        if times_s.ndim != 1 or len(times_s) == 0:
            raise ValueError(f"times_s must have shape (T,) with T ≥ 1, not {times_s.shape}")
        if not np.isfinite(times_s).all() or (np.diff(times_s) <= 0).any():
            raise ValueError("times_s must be finite and strictly increasing")
        if len(set(names)) != len(names):
            twice = sorted({name for name in names if names.count(name) > 1})
            raise ValueError(f"curve names must be distinct; repeated: {', '.join(twice)}")
        if weights.shape != (len(times_s), len(names)):
            raise ValueError(
                f"weights must have shape ({len(times_s)}, {len(names)}), not {weights.shape}"
            )
        if not np.isfinite(weights).all():
            column = int(np.argwhere(~np.isfinite(weights))[0, 1])
            raise ValueError(f"weights of '{names[column]}' are not finite")
        times_s.flags.writeable = False
        weights.flags.writeable = False
        object.__setattr__(self, "times_s", times_s)
        object.__setattr__(self, "names", names)
        object.__setattr__(self, "weights", weights)

    def __eq__(self, other: object) -> bool:
        return (
            isinstance(other, CurveSet)
            and self.names == other.names
            and np.array_equal(self.times_s, other.times_s)
            and np.array_equal(self.weights, other.weights)
        )

    __hash__ = None  # type: ignore[assignment]

    @property
    def duration_s(self) -> float:
        """Time of the last key in seconds."""
        return float(self.times_s[-1])

    def curve(self, name: str) -> Floats:
        """Weights of one curve, shape (T,).

        Raises:
            KeyError: there is no curve of that name.
        """
        try:
            return self.weights[:, self.names.index(name)]
        except ValueError:
            raise KeyError(name) from None

    def sample(self, times_s: ArrayLike) -> Floats:
        """Weights at any times, shape (len(times_s), N)."""
        at = np.atleast_1d(np.asarray(times_s, dtype=np.float64))
        return interpolate(self.times_s, self.weights, at)

    def to_document(self) -> dict[str, Any]:
        """An ``animeme.curves/1`` document."""
        return {
            "schema": "animeme.curves/1",
            "times_s": self.times_s.tolist(),
            "curves": {name: self.weights[:, i].tolist() for i, name in enumerate(self.names)},
        }

    @classmethod
    def from_document(cls, document: dict[str, Any]) -> CurveSet:
        """Read what `to_document` wrote.

        Raises:
            ValueError: the document breaks an invariant.
        """
        names = tuple(document["curves"])
        times_s = np.array(document["times_s"], dtype=np.float64)
        columns = [document["curves"][name] for name in names]
        for name, column in zip(names, columns, strict=True):
            if len(column) != len(times_s):
                raise ValueError(f"'{name}' has {len(column)} weights for {len(times_s)} times")
        weights = np.array(columns, dtype=np.float64).T.reshape(len(times_s), len(names))
        return cls(times_s, names, weights)


def interpolate(times_s: Floats, weights: Floats, at_s: Floats) -> Floats:
    """Linear interpolation of all columns at once, constant beyond the ends.

    Args:
        times_s: shape (T,), strictly increasing.
        weights: shape (T, N).
        at_s: shape (K,).

    Returns:
        Shape (K, N).
    """
    if len(times_s) == 1:
        return np.repeat(weights, len(at_s), axis=0)
    right = np.clip(np.searchsorted(times_s, at_s, side="right"), 1, len(times_s) - 1)
    left = right - 1
    span = times_s[right] - times_s[left]
    fraction = np.clip((at_s - times_s[left]) / span, 0.0, 1.0)[:, None]
    return weights[left] * (1.0 - fraction) + weights[right] * fraction


def reduce_keys(curves: CurveSet, max_error: float) -> CurveSet:
    """Drop keys while linear interpolation stays within `max_error` of every dropped one.

    All curves keep sharing one time axis, so a key stays if any curve needs it. Between the kept
    keys the error is piecewise linear with its corners at the dropped keys, so bounding it there
    bounds it everywhere. Ramer 1972 and Douglas & Peucker 1973, with the vertical distance and the
    largest error over all curves.

    Files hold float32. The bound holds for what they play too: what rounding costs is taken off
    beforehand. Only where rounding alone costs more than `max_error` is that the bound.

    Args:
        curves: any curve set.
        max_error: largest allowed deviation, in weight units, ≥ 0.

    Returns:
        A curve set with the first and last key and as many others as needed.
    """
    rounded = _rounded(curves)
    left_over = max(0.0, max_error - _rounding_error(curves, rounded))
    keep = np.zeros(len(curves.times_s), dtype=bool)
    keep[[0, -1]] = True
    # What becomes of a span depends on nothing outside it, so all that are open go together: first
    # by the curves as they are, and what needs no key for these by the rounded ones.
    spans = np.array([[0], [len(keep) - 1]])[:, : len(curves.names)]
    while spans.size:
        settled = []
        while spans.size:
            spans, whole = _split(curves.times_s, curves.weights, max_error, spans, keep)
            settled.append(whole)
        spans, _ = _split(*rounded, left_over, np.concatenate(settled, axis=1), keep)
    return CurveSet(curves.times_s[keep], curves.names, curves.weights[keep])


def _split(
    times_s: Floats, weights: Floats, max_error: float, spans: Keys, keep: NDArray[np.bool_]
) -> tuple[Keys, Keys]:
    """Split spans at their worst key where it exceeds the bound.

    Args:
        times_s: shape (T,).
        weights: shape (T, N), N ≥ 1.
        max_error: the bound.
        spans: first and last key of each, shape (2, S).
        keep: whether a key stays, shape (T,); is set for those that spans are split at.

    Returns:
        What spans were split into, and those that were not and have keys to drop.
    """
    spans = spans[:, spans[1] - spans[0] > 1]
    if not spans.size:
        return spans, spans
    left, right = spans
    count = right - left - 1
    start = count.cumsum() - count
    span = np.arange(len(count)).repeat(count)  # of each key within any of them
    key = np.arange(len(span)) + (left + 1 - start)[span]
    from_s, to_s = times_s[spans]
    moment = to_s == from_s  # in float32; there is nothing to choose between
    length_s = np.where(moment, 1.0, to_s - from_s)
    fraction = ((times_s[key] - from_s[span]) / length_s[span])[:, None]
    error = weights[left[span]] * (1.0 - fraction)  # in place, as this is most of the work
    error += weights[right[span]] * fraction
    error -= weights[key]
    largest = np.abs(error, out=error).max(axis=1)
    worst = np.maximum.reduceat(largest, start)
    over = (worst > max_error) & ~moment
    if not over.any():
        return spans[:, :0], spans
    candidates = (largest == worst[span]).nonzero()[0][::-1]
    split = np.zeros_like(left)
    split[span[candidates]] = key[candidates]  # of several, the first: it is assigned last
    split = split[over]
    keep[split] = True
    parts = [[left[over], split], [split, right[over]]]
    return np.concatenate(parts, axis=1), spans[:, ~over]


def _rounded(curves: CurveSet) -> tuple[Floats, Floats]:
    """Times and weights as a file of float32 gives them back."""
    return (
        curves.times_s.astype(np.float32).astype(np.float64),
        curves.weights.astype(np.float32).astype(np.float64),
    )


def _rounding_error(curves: CurveSet, rounded: tuple[Floats, Floats]) -> float:
    """Largest deviation that rounding every key to float32 causes, in weight units."""
    times_s, weights = rounded
    distinct = np.append(True, np.diff(times_s) > 0)
    times_s, weights = times_s[distinct], weights[distinct]
    # Two polygons differ most at a corner of one of them.
    corners = np.union1d(curves.times_s, times_s)
    error = interpolate(times_s, weights, corners) - curves.sample(corners)
    return float(np.abs(error).max(initial=0.0))


def drop_still(
    lines: Sequence[CurveSet], rest: Mapping[str, float], meshes: Sequence[Collection[str]]
) -> list[CurveSet]:
    """The lines of one file without the curves that stay at rest.

    A shape without a curve is at rest in every format. But a player that goes from one line to the
    next leaves a mesh as it is if the next line has nothing to say about it: so each mesh that any
    of the lines has a curve for keeps one in all of them.

    Args:
        lines: curves of each line.
        rest: weight of each shape when nothing drives it.
        meshes: shape names of each mesh.
    """
    named = {name for curves in lines for name in curves.names}
    spoken = [[name for name in mesh if name in named] for mesh in meshes]
    return [_without_still(curves, rest, [mesh for mesh in spoken if mesh]) for curves in lines]


def _without_still(
    curves: CurveSet, rest: Mapping[str, float], meshes: Sequence[Sequence[str]]
) -> CurveSet:
    at_rest = np.array([rest.get(name, 0.0) for name in curves.names]).astype(np.float32)
    moves = (curves.weights.astype(np.float32) != at_rest).any(axis=0)
    kept = dict.fromkeys(name for name, moving in zip(curves.names, moves, strict=True) if moving)
    for mesh in meshes:
        if not any(name in kept for name in mesh):
            kept[mesh[0]] = None
    columns = {name: i for i, name in enumerate(curves.names)}
    still = np.ones(len(curves.times_s))
    weights = [
        curves.weights[:, columns[name]] if name in columns else still * rest.get(name, 0.0)
        for name in kept
    ]
    stacked = np.array(weights).reshape(len(kept), len(still)).T
    return CurveSet(curves.times_s, tuple(kept), stacked)
