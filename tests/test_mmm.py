"""The trajectory against a dense solve, and its gradient against finite differences."""

from __future__ import annotations

import numpy as np
import pytest

from animeme_stages.synthesize.mmm import Mmm, _Fitting, trajectory
from support.motion import captured, random_track


@pytest.mark.parametrize("order", [1, 2, 3])
def test_trajectory_minimises_the_energy(order: int) -> None:
    """(y − μ)ᵀ Dᵀ Σ⁻¹ D (y − μ) + λ yᵀ Wᵀ W y, with the matrices written out."""
    model = Mmm.configured({"steps": 0, "order": order}).fit(captured(lines=6))
    grid = model.grid([random_track(90, 5), random_track(91, 3)], 0.02)
    tau_s = 0.015
    path, _ = trajectory(grid, model.mean_, model.precision_, tau_s, order)
    count, controls = path.shape
    inverse = model.precision_ @ np.swapaxes(model.precision_, 1, 2)
    pull = np.zeros((count * controls, count * controls))
    mu = model.mean_[grid.phone].ravel()
    for t in range(count):
        block = slice(t * controls, (t + 1) * controls)
        d = np.sqrt(grid.emphasis[t]) * np.eye(controls)
        pull[block, block] = d.T @ inverse[grid.phone[t]] @ d
    rows = []
    for track in np.unique(grid.track):
        members = np.flatnonzero(grid.track == track)
        for row in np.diff(np.eye(len(members)), n=order, axis=0):
            full = np.zeros(count)
            full[members] = row
            rows.append(full)
    w = np.kron(np.array(rows), np.eye(controls))
    lam = (tau_s / 0.02) ** (2 * order)
    expected = np.linalg.solve(pull + lam * w.T @ w, pull @ mu)
    np.testing.assert_allclose(path.ravel(), expected, atol=1e-8)


def test_gradient_against_finite_differences() -> None:
    data = captured(lines=3)
    data.lines[1].values[5:9, 1] = np.nan
    model = Mmm.configured({"steps": 0, "order": 2}).fit(data)
    fitting = _Fitting(model, data, 0.02)
    mean, factors = fitting.statistics()
    _, by_mean, by_factor = fitting.gradient(mean, factors, 0.02)
    rng = np.random.default_rng(0)
    for _ in range(12):
        unit, a, b = (int(rng.integers(n)) for n in (len(mean), 3, 3))
        a, b = max(a, b), min(a, b)
        step = 1e-6
        for array, gradient, index in (
            (mean, by_mean, (unit, a)),
            (factors, by_factor, (unit, a, b)),
        ):
            ends = []
            for sign in (1, -1):
                moved = array.copy()
                moved[index] += sign * step
                pair = (moved, factors) if array is mean else (mean, moved)
                ends.append(0.5 * fitting.error(*pair, 0.02))
            numeric = (ends[0] - ends[1]) / (2 * step)
            assert gradient[index] == pytest.approx(numeric, rel=1e-4, abs=1e-5)


def test_descent_lowers_the_error() -> None:
    data = captured(lines=20)
    errors = []
    for steps in (0, 10, 40):
        model = Mmm.configured({"steps": steps, "smoothness_s": 0.02}).fit(data)
        fitting = _Fitting(model, data, 0.02)
        errors.append(fitting.error(model.mean_, model.precision_, model.smoothness_s_))
    assert errors[0] > errors[1] > errors[2]


def test_the_path_does_not_depend_on_the_rate() -> None:
    model = Mmm.configured({"steps": 5}).fit(captured(lines=10))
    track = random_track(77)
    slow, fast = (model.synthesize(track, rate_hz=rate) for rate in (100, 400))
    at_s = np.linspace(0.1, track.duration_s - 0.1, 200)
    # Borders of phones fall between samples, so that single values differ by up to one sample.
    error = np.sqrt(((slow.sample(at_s) - fast.sample(at_s)) ** 2).mean(axis=0))
    assert (error < 0.05 * np.ptp(fast.weights, axis=0)).all()
