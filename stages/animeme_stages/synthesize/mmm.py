"""Trajectories through Gaussian regions, by regularisation.

Ezzat, Geiger & Poggio, "Trainable Videorealistic Speech Animation" (2002), its
trajectory part: each phone is a Gaussian (μ, Σ) over the controls, and the trajectory y minimises
(y − μ)ᵀ Dᵀ Σ⁻¹ D (y − μ) + λ yᵀ Wᵀ W y. D weights short phones up, W takes differences. μ and Σ
start from statistics and follow the gradient of the trajectory's error; here by L-BFGS (Liu &
Nocedal 1989) in place of plain descent. λ is chosen by cross-validation.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, ClassVar

import numpy as np
import scipy  # its parts load when they are first used

from animeme.curves import Floats, interpolate
from animeme.dataset import Dataset, Listener, folds
from animeme.phones import PhoneTrack
from animeme_stages.synthesize.fitted import FittedModel, spreads
from animeme_stages.synthesize.numbers import array_from, rounded
from animeme_stages.synthesize.spoken import Ints, spoken

# Time constants tried, seconds; λ is the constant to the power of twice the order of W.
_SMOOTHNESS_S = (0.005, 0.01, 0.02, 0.03, 0.045, 0.065)
# A phone's covariance counts as if it had been seen this often with that of all phones, so that a
# phone seen once has one too.
_PRIOR = 5.0
# A control that never varies within a phone still gets this part of its spread.
_FLOOR = 0.05


@dataclass(frozen=True)
class MmmOptions:
    """Options of `Mmm`."""

    order: int = field(default=1, metadata={"low": 1, "high": 4})
    smoothness_s: float = field(default=0.0, metadata={"low": 0, "high": 1})
    steps: int = field(default=80, metadata={"low": 0, "high": 1000})
    contacts: bool = False


@dataclass(frozen=True, eq=False)
class Grid:
    """Uniform samples of some tracks, one after another; T samples, N controls.

    Attributes:
        step_s: between samples.
        phone: shape (T,), which phone (a row of μ) each is in.
        emphasis: shape (T,), diagonal of DᵀD: mean length of phones over that of this one.
        first: shape (T,), true at the first sample of each track.
        track: shape (T,), which track it is of.
    """

    step_s: float
    phone: Ints
    emphasis: Floats
    first: Any
    track: Ints


class Mmm(FittedModel):
    """Gaussian regions and a smooth path through them.

    Attributes:
        mean_: μ, shape (U, N), in units of `spread_`.
        precision_: Cholesky factors L of Σ⁻¹ = L Lᵀ, shape (U, N, N).
        spread_: shape (N,).
        mean_s_: mean length of a phone.
        smoothness_s_: λ to the power of 1/(2 order).
    """

    name: ClassVar[str] = "mmm"
    Options = MmmOptions
    options: MmmOptions

    def __init__(self, options: MmmOptions | None = None) -> None:
        """See `FittedModel`."""
        super().__init__(options)
        self.mean_ = np.zeros((0, 0))
        self.precision_ = np.zeros((0, 0, 0))
        self.spread_ = np.zeros(0)
        self.mean_s_ = 1.0
        self.smoothness_s_ = 0.0

    def _learn(self, dataset: Dataset, listener: Listener) -> None:
        options = self.options
        steps_s = np.concatenate([np.diff(line.times_s) for line in dataset.lines])
        step_s = float(np.clip(np.median(steps_s), 1 / 60, 1 / 20))
        self.spread_ = rounded(spreads(np.concatenate([line.values for line in dataset.lines])))
        lengths = [p.duration_s for line in dataset.lines for p in line.track.phones]
        self.mean_s_ = float(rounded(np.mean(lengths)))
        fitting = _Fitting(self, dataset, step_s)
        self.mean_, self.precision_ = fitting.statistics()
        self.smoothness_s_ = options.smoothness_s or self._cross_validated(
            dataset, step_s, listener
        )
        if options.steps:
            self.mean_, self.precision_ = fitting.descend(
                self.smoothness_s_, lambda part: listener("descent", part)
            )
        self.mean_, self.precision_ = rounded(self.mean_), rounded(self.precision_)

    def _cross_validated(self, dataset: Dataset, step_s: float, listener: Listener) -> float:
        """The smoothness with the least error on lines that gave no statistics."""
        parts = folds(dataset, 3) if len(dataset.lines) >= 3 else [list(range(len(dataset.lines)))]
        errors = np.zeros(len(_SMOOTHNESS_S))
        for number, held in enumerate(parts):
            rest = [line for i, line in enumerate(dataset.lines) if i not in set(held)]
            fitted = _Fitting(self, dataset.subset(rest or dataset.lines), step_s).statistics()
            judged = _Fitting(self, dataset.subset([dataset.lines[i] for i in held]), step_s)
            for i, smoothness_s in enumerate(_SMOOTHNESS_S):
                errors[i] += judged.error(*fitted, smoothness_s)
            listener("smoothness", (number + 1) / len(parts))
        return _SMOOTHNESS_S[int(errors.argmin())]

    def grid(self, tracks: list[PhoneTrack], step_s: float) -> Grid:
        """Uniform samples over `tracks`, each to its end."""
        phones = spoken(tracks)
        row = self.rows(phones.symbols)
        counts = [math.ceil(track.duration_s / step_s - 1e-9) + 1 for track in tracks]
        track = np.repeat(np.arange(len(tracks)), counts)
        starts = np.cumsum([0, *counts[:-1]])
        since_s = (np.arange(len(track)) - starts[track]) * step_s
        at_s = phones.offset_s[track] + since_s
        index = np.maximum(np.searchsorted(phones.start_s, at_s + 1e-9, side="right") - 1, 0)
        emphasis = self.mean_s_ / phones.length_s[index]
        return Grid(step_s, row[index], emphasis, since_s == 0, track)

    def _move(self, track: PhoneTrack, times_s: Floats) -> Floats:
        # Keys for contacts come on top of the model's own samples.
        step_s = float(np.median(np.diff(times_s))) if len(times_s) > 1 else 1 / 60
        grid = self.grid([track], step_s)
        path, _ = trajectory(
            grid, self.mean_, self.precision_, self.smoothness_s_, self.options.order
        )
        at_s = np.arange(len(path), dtype=np.float64) * step_s
        return interpolate(at_s, path * self.spread_, times_s)

    def _to_json(self) -> dict[str, Any]:
        return {
            "mean": self.mean_.tolist(),
            "precision": self.precision_.tolist(),
            "spread": self.spread_.tolist(),
            "mean_s": self.mean_s_,
            "smoothness_s": self.smoothness_s_,
        }

    def _from_json(self, learned: Mapping[str, Any]) -> None:
        units, controls = len(self.seen_), len(self.controls_)
        self.mean_ = array_from(learned["mean"], (units, controls), "mean")
        self.precision_ = array_from(learned["precision"], (units, controls, controls), "precision")
        self.spread_ = array_from(learned["spread"], (controls,), "spread")
        self.mean_s_ = float(array_from([learned["mean_s"]], (1,), "mean_s")[0])
        self.smoothness_s_ = float(array_from([learned["smoothness_s"]], (1,), "smoothness_s")[0])
        diagonal = np.einsum("unn->un", self.precision_)
        positive = (diagonal > 0).all() and (self.spread_ > 0).all() and self.mean_s_ > 0
        if not positive or self.smoothness_s_ < 0:
            raise ValueError("precision, spread and mean_s must be positive")


def trajectory(
    grid: Grid, mean: Floats, precision: Floats, smoothness_s: float, order: int
) -> tuple[Floats, Any]:
    """The path that minimises the paper's energy: one banded linear solve.

    Args:
        grid: T samples.
        mean: μ, shape (U, N).
        precision: Cholesky factors of Σ⁻¹, shape (U, N, N).
        smoothness_s: λ to the power of 1/(2 order).
        order: of the differences in W.

    Returns:
        The path, shape (T, N), and the Cholesky factor of the system, for its gradient.
    """
    count, controls = len(grid.phone), mean.shape[1]
    inverse = precision @ np.swapaxes(precision, 1, 2)
    band = np.zeros((order * controls + controls, count * controls))
    for a in range(controls):
        for b in range(a, controls):  # lower form: band[i − j, j]
            band[b - a, a::controls] = grid.emphasis * inverse[grid.phone, b, a]
    for apart, column in enumerate(_roughness(grid, order)):
        # λ (1/h²)^order, so that the path does not depend on the step of the grid.
        scaled = column * (smoothness_s / grid.step_s) ** (2 * order)
        for a in range(controls):
            band[apart * controls, a::controls] += scaled
    target = np.einsum("tab,tb->ta", inverse[grid.phone], mean[grid.phone])
    target *= grid.emphasis[:, None]
    factor = scipy.linalg.cholesky_banded(band, lower=True, check_finite=False)
    path = scipy.linalg.cho_solve_banded((factor, True), target.ravel(), check_finite=False)
    return path.reshape(count, controls), factor


def _roughness(grid: Grid, order: int) -> list[Floats]:
    """Diagonals 0 … order of WᵀW, W the differences of `order` within each track; each (T,)."""
    stencil = np.array([(-1.0) ** (order - k) * math.comb(order, k) for k in range(order + 1)])
    count = len(grid.phone)
    diagonals = [np.zeros(count) for _ in range(order + 1)]
    if count > order:
        rows = np.flatnonzero(grid.track[: count - order] == grid.track[order:])
        for i in range(order + 1):
            for j in range(i + 1):
                np.add.at(diagonals[i - j], rows + j, stencil[i] * stencil[j])
    return diagonals


class _Fitting:
    """A dataset on a grid, and how far trajectories are from it."""

    def __init__(self, model: Mmm, dataset: Dataset, step_s: float) -> None:
        self.order = model.options.order
        self.steps = model.options.steps
        self.grid = model.grid([line.track for line in dataset.lines], step_s)
        starts = np.flatnonzero(self.grid.first)
        place = np.concatenate(
            [
                start + line.times_s / step_s
                for start, line in zip(starts, dataset.lines, strict=True)
            ]
        )
        low = np.minimum(place.astype(np.int64), len(self.grid.phone) - 2)
        part = place - low
        rows = np.arange(len(place))
        self.sampler = scipy.sparse.csr_matrix(
            (
                np.concatenate([1.0 - part, part]),
                (np.concatenate([rows, rows]), np.concatenate([low, low + 1])),
            ),
            shape=(len(place), len(self.grid.phone)),
        )
        self.values = np.concatenate([line.values for line in dataset.lines]) / model.spread_
        self.known = np.isfinite(self.values)
        self.phone = self.grid.phone[
            np.rint(place).astype(np.int64).clip(0, len(self.grid.phone) - 1)
        ]
        self.units = len(model.seen_)

    def statistics(self) -> tuple[Floats, Floats]:
        """μ and the Cholesky factors of Σ⁻¹ from the frames of each phone."""
        controls = self.values.shape[1]
        overall = np.nan_to_num(np.nanmean(self.values, axis=0))
        filled = np.where(self.known, self.values, overall)
        mean = np.empty((self.units, controls))
        factors = np.empty((self.units, controls, controls))
        everywhere = np.cov(filled.T).reshape(controls, controls)
        for unit in range(self.units):
            own = filled[self.phone == unit]
            mean[unit] = (own.sum(0) + overall) / (len(own) + 1)
            centred = own - mean[unit]
            covariance = (centred.T @ centred + _PRIOR * everywhere) / (len(own) + _PRIOR)
            covariance[np.diag_indices(controls)] += _FLOOR**2
            factors[unit] = np.linalg.cholesky(np.linalg.inv(covariance))
        return mean, factors

    def error(self, mean: Floats, precision: Floats, smoothness_s: float) -> float:
        """Sum of squared differences from what was captured."""
        path, _ = trajectory(self.grid, mean, precision, smoothness_s, self.order)
        return float((self._residual(path) ** 2).sum())

    def _residual(self, path: Floats) -> Floats:
        return np.where(self.known, self.sampler @ path - np.nan_to_num(self.values), 0.0)

    def gradient(
        self, mean: Floats, precision: Floats, smoothness_s: float
    ) -> tuple[float, Floats, Floats]:
        """Half the squared error, and its gradients by μ and by the factors of Σ⁻¹.

        With A y = P μ, one more solve A v = ∂E/∂y gives ∂E/∂μ = P v and ∂E/∂P = v (μ − y)ᵀ.
        """
        grid = self.grid
        path, factor = trajectory(grid, mean, precision, smoothness_s, self.order)
        residual = self._residual(path)
        v = scipy.linalg.cho_solve_banded(
            (factor, True), (self.sampler.T @ residual).ravel(), check_finite=False
        ).reshape(path.shape)
        weighted = v * grid.emphasis[:, None]
        inverse = precision @ np.swapaxes(precision, 1, 2)
        sums = self._by_phone(weighted)
        by_mean = np.einsum("uab,ub->ua", inverse, sums)
        outer = weighted[:, :, None] * (mean[grid.phone] - path)[:, None, :]
        flat = self._by_phone(outer.reshape(len(outer), -1)).reshape(precision.shape)
        by_factor = np.tril((flat + np.swapaxes(flat, 1, 2)) @ precision)
        return 0.5 * float((residual**2).sum()), by_mean, by_factor

    def _by_phone(self, values: Floats) -> Floats:
        columns = [np.bincount(self.grid.phone, column, self.units) for column in values.T]
        return np.stack(columns, axis=1)

    def descend(self, smoothness_s: float, told: Any) -> tuple[Floats, Floats]:
        """μ and factors after following the error's gradient, from `statistics`."""
        mean, precision = self.statistics()
        lower = np.tril_indices(mean.shape[1])
        diagonal = lower[0] == lower[1]
        steps = 0

        def unpack(x: Floats) -> tuple[Floats, Floats]:
            entries = x[mean.size :].reshape(self.units, -1).copy()
            entries[:, diagonal] = np.exp(np.clip(entries[:, diagonal], -20, 20))
            factors = np.zeros(precision.shape)
            factors[:, lower[0], lower[1]] = entries
            return x[: mean.size].reshape(mean.shape), factors

        def value(x: Floats) -> tuple[float, Floats]:
            m, factors = unpack(x)
            error, by_mean, by_factor = self.gradient(m, factors, smoothness_s)
            entries = by_factor[:, lower[0], lower[1]]
            entries[:, diagonal] *= factors[:, lower[0], lower[1]][:, diagonal]
            return error, np.concatenate([by_mean.ravel(), entries.ravel()])

        def step(_: Any) -> None:
            nonlocal steps
            steps += 1
            told(min(steps / self.steps, 1.0))

        entries = precision[:, lower[0], lower[1]].copy()
        entries[:, diagonal] = np.log(entries[:, diagonal])
        start = np.concatenate([mean.ravel(), entries.ravel()])
        found = scipy.optimize.minimize(
            value, start, jac=True, method="L-BFGS-B", callback=step,
            options={"maxiter": self.steps, "maxcor": 20},
        )  # fmt: skip
        return unpack(found.x)
