"""Control curves: weights over time, and how few keys they need."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

Floats = NDArray[np.float64]


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

    Args:
        curves: any curve set.
        max_error: largest allowed deviation, in weight units, ≥ 0.

    Returns:
        A curve set with the first and last key and as many others as needed.
    """
    times_s, weights = curves.times_s, curves.weights
    keep = np.zeros(len(times_s), dtype=bool)
    keep[[0, -1]] = True
    pending = [(0, len(times_s) - 1)]
    while pending:
        left, right = pending.pop()
        if right - left < 2 or not weights.shape[1]:
            continue
        inner = slice(left + 1, right)
        ends = [left, right]
        line = interpolate(times_s[ends], weights[ends], times_s[inner])
        error = np.abs(line - weights[inner]).max(axis=1)
        worst = int(np.argmax(error))
        if error[worst] > max_error:
            split = left + 1 + worst
            keep[split] = True
            pending += [(left, split), (split, right)]
    return CurveSet(times_s[keep], curves.names, weights[keep])
