"""What a phone's neighbours and lengths add to its animeme, linearly.

Ridge regression (Hoerl & Kennard 1970) beside the trees of `trees`: smooth in lengths where trees
have steps, additive in both neighbours where trees ask about one after the other. The two err in
different places, so that a mean of both has a lower held-out error than either.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
import scipy  # its parts load when they are first used

from animeme.curves import Floats
from animeme_stages.synthesize.articulation import CLASSES, class_of
from animeme_stages.synthesize.fitting import design_matrix
from animeme_stages.synthesize.numbers import array_from, rounded
from animeme_stages.synthesize.spoken import Ints, Pairs, Spoken

# What each phone has an effect for: itself; the class before and after it (the last: none); the
# lengths of five phones; the square of its own.
_BEFORE, _AFTER = 1, 2 + len(CLASSES)
_LENGTHS = 3 + 2 * len(CLASSES)
_OFFSETS = (-2, -1, 0, 1, 2)
PLACES = _LENGTHS + len(_OFFSETS) + 1
# Logarithms of lengths are taken from here, in units of the second.
_USUAL_S, _LOG_UNIT = 0.09, 0.6
# Added to lengths: the aligner's step, below which they are noise.
_STEP_S = 0.01
# What was met less often than this has no effect.
_FEWEST = 3


@dataclass(frozen=True, eq=False)
class Trends:
    """Effects of K pairs of a phone and something about it.

    Attributes:
        row: shape (U, `PLACES`), which effect each phone has for each place, −1 for none.
        effects: shape (K, M + 1, N), coefficients; multiples of `step`.
        step: shape (N,).
        limits: shape (U, 5, 2), least and greatest length seen of the five phones around each
            phone, as `_lengths` has them: what is beyond them counts as the nearer.
    """

    row: Ints
    effects: Floats
    step: Floats
    limits: Floats

    @classmethod
    def none(cls) -> Trends:
        """No effects: of documents that lack them."""
        return cls(
            np.zeros((0, PLACES), np.int64), np.zeros((0, 1, 0)), np.zeros(0), np.zeros((0, 5, 2))
        )

    def coefficients(self, phones: Spoken, unit: Ints) -> Floats:
        """What is added to each phone's coefficients, shape (J, M + 1, N)."""
        place, value = _places(phones, self.limits[unit])
        row = self.row[unit[:, None], place]
        value = np.where(row >= 0, value, 0.0)
        total = np.zeros((len(unit), *self.effects.shape[1:]))
        for column in range(place.shape[1]):
            total += value[:, column, None, None] * self.effects[row[:, column]]
        return total

    def to_json(self) -> dict[str, Any]:
        """What documents keep."""
        counts = np.rint(self.effects / self.step).astype(np.int64)
        return {
            "row": self.row.tolist(),
            "step": self.step.tolist(),
            "counts": counts.tolist(),
            "limits": self.limits.tolist(),
        }

    @classmethod
    def from_json(cls, entry: Mapping[str, Any], units: int, shape: tuple[int, int]) -> Trends:
        """Read what `to_json` wrote; `shape` is (M + 1, N).

        Raises:
            ValueError: it does not fit.
        """
        row = array_from(entry["row"], (units, PLACES), "row").astype(np.int64)
        counts = array_from(entry["counts"], (None, *shape), "counts")
        if row.min(initial=-1) < -1 or row.max(initial=-1) >= len(counts):
            raise ValueError("a phone has an effect that is not listed")
        step = array_from(entry["step"], shape[1:], "step")
        if (step <= 0).any():
            raise ValueError("step must be positive")
        limits = array_from(entry["limits"], (units, len(_OFFSETS), 2), "limits")
        return cls(row, np.rint(counts) * step, step, limits)


def _lengths(phones: Spoken) -> Floats:
    """Logarithms of the lengths of five phones, 0 for a usual one or none, shape (J, 5)."""
    columns = []
    for offset in _OFFSETS:
        index = phones.neighbour(offset)
        length_s = np.where(index >= 0, phones.length_s[index], _USUAL_S - _STEP_S)
        columns.append(np.log((length_s + _STEP_S) / _USUAL_S) / _LOG_UNIT)
    return np.stack(columns, axis=1)


def _places(phones: Spoken, limits: Floats) -> tuple[Ints, Floats]:
    """Which places say something about each phone, and how much; both (J, …)."""
    count = len(phones.symbols)
    code_of = {
        (symbol, end): CLASSES.index(class_of(symbol, end=end))
        for symbol in set(phones.symbols)
        for end in (False, True)
    }
    places, values = [np.zeros(count, np.int64)], [np.ones(count)]
    # A neighbour before shows its end; one after, its beginning.
    for offset, first in ((-1, _BEFORE), (1, _AFTER)):
        code = np.array([code_of[symbol, offset < 0] for symbol in phones.symbols])
        index = phones.neighbour(offset)
        places.append(first + np.where(index >= 0, code[index], len(CLASSES)))
        values.append(np.ones(count))
    lengths = np.clip(_lengths(phones), limits[..., 0], limits[..., 1])
    for k, length in enumerate(lengths.T):
        places.append(np.full(count, _LENGTHS + k))
        values.append(length)
    places.append(np.full(count, PLACES - 1))
    values.append(lengths[:, _OFFSETS.index(0)] ** 2)
    return np.stack(places, axis=1), np.stack(values, axis=1)


def learn_trends(
    pairs: Pairs,
    weight: Floats,
    basis: Floats,
    phones: Spoken,
    unit: Ints,
    units: int,
    residual: Floats,
    ridge: float,
) -> Trends:
    """Fit effects to what the phones' own animemes leave; in units of `residual`, unrounded.

    Args:
        pairs: which phone is felt at which frame.
        weight: shape (P,), (normalised) dominance of each pair.
        basis: shape (P, M + 1).
        phones, unit: of all lines; the unit of each phone.
        units: U.
        residual: shape (F, N); 0 where nothing was captured.
        ridge: penalty on the square of each coefficient, in frames.
    """
    limits = np.zeros((units, len(_OFFSETS), 2))
    lengths = _lengths(phones)
    for one in np.unique(unit):
        own = lengths[unit == one]
        limits[one] = rounded(np.stack([own.min(axis=0), own.max(axis=0)], axis=1))
    place, value = _places(phones, limits[unit])
    cell = unit[:, None] * PLACES + place
    met = np.bincount(cell.ravel(), minlength=units * PLACES) >= _FEWEST
    row = np.where(met, np.cumsum(met) - 1, -1)
    kept = row[cell] >= 0
    phone = np.broadcast_to(np.arange(len(unit))[:, None], cell.shape)
    count, width = int(met.sum()), basis.shape[1]
    features = scipy.sparse.csr_matrix(
        (value[kept], (phone[kept], row[cell][kept])), shape=(len(unit), count)
    )
    each = design_matrix(pairs, weight, basis, pairs.phone, len(unit))
    design = (each @ scipy.sparse.kron(features, scipy.sparse.identity(width))).tocsr()
    matrix = (design.T @ design).toarray()
    matrix[np.diag_indices_from(matrix)] += ridge + 1e-9
    effects = scipy.linalg.solve(
        matrix, design.T @ residual, assume_a="pos", overwrite_a=True, check_finite=False
    )
    shape = (count, width, residual.shape[1])
    return Trends(row.reshape(units, PLACES), effects.reshape(shape), np.ones(shape[2]), limits)
