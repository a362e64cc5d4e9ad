"""Dominances, the design matrix and the fit, against the papers' equations written out."""

from __future__ import annotations

import numpy as np
import pytest

from animeme_stages.synthesize.animemes import BEYOND, Animemes, learn_animemes
from animeme_stages.synthesize.dominance import (
    EPSILON,
    NEGLIGIBLE,
    Dominance2009,
    Dominance2012,
)
from animeme_stages.synthesize.fitting import (
    Problem,
    _basis,
    _evaluate,
    design_matrix,
    fit,
    jacobian,
    known_frames,
    weights_of,
)
from animeme_stages.synthesize.spoken import Pairs, legendre, pairs_of, spoken
from support.motion import captured, random_track


def one_phone(local: np.ndarray) -> Pairs:
    outside = np.maximum(np.maximum(-local, local - 1.0), 0.0)
    index = np.arange(len(local))
    return Pairs(len(local), index, np.zeros(len(local), dtype=np.int64), local, outside)


def uncut(d: np.ndarray) -> np.ndarray:
    return d * (1 - NEGLIGIBLE) + NEGLIGIBLE


@pytest.mark.parametrize("sigma", [0.3, 1.0, 2.0])
def test_dominance_of_2012(sigma: float) -> None:
    """Eq. 1: 1 within the phone, exp(−t²/(σ²+ε)) before, exp(−(t−1)²/(σ²+ε)) after."""
    t = np.linspace(-2, 3, 101)
    d, _ = Dominance2012().value(one_phone(t), np.full((len(t), 1), sigma))
    width = sigma**2 + EPSILON
    expected = np.where(
        t < 0, np.exp(-(t**2) / width), np.where(t > 1, np.exp(-((t - 1) ** 2) / width), 1)
    )
    seen = expected > NEGLIGIBLE
    np.testing.assert_allclose(uncut(d[seen]), expected[seen], rtol=1e-9)
    assert (d[~seen] == 0).all()
    reach = Dominance2012().reach(np.array([[sigma]]))[0]
    assert (d[(t < -reach) | (t > 1 + reach)] == 0).all()


@pytest.mark.parametrize(("inner", "outer"), [(1.0, 1.0), (0.7, 0.3), (2.0, 0.5)])
def test_dominance_of_2009(inner: float, outer: float) -> None:
    """Eq. 7 in local time: a Gaussian of σ₁ inside, continued by one of σ₂ from the border on."""
    t = np.linspace(-1.5, 2.5, 161)
    sigma = np.tile([inner, outer], (len(t), 1))
    d, _ = Dominance2009().value(one_phone(t), sigma)
    expected = []
    for at in t:
        if abs(at - 0.5) < 0.5:
            expected.append(np.exp(-(((at - 0.5) / (inner + EPSILON)) ** 2)))
        else:
            border = 0.0 if at < 0.5 else 1.0
            signed = (at - border) / (outer + EPSILON) + (border - 0.5) / (inner + EPSILON)
            expected.append(np.exp(-(signed**2)))
    seen = np.array(expected) > NEGLIGIBLE
    np.testing.assert_allclose(uncut(d[seen]), np.array(expected)[seen], rtol=1e-9)


@pytest.mark.parametrize("dominance", [Dominance2012(), Dominance2009()])
def test_slopes_of_dominances(dominance: Dominance2012 | Dominance2009) -> None:
    t = np.linspace(-1, 2, 61)
    sigma = np.tile([0.8, 0.6][: dominance.parameters], (len(t), 1))
    d, slopes = dominance.value(one_phone(t), sigma)
    for k in range(dominance.parameters):
        moved = sigma.copy()
        moved[:, k] *= np.exp(1e-6)
        numeric = (dominance.value(one_phone(t), moved)[0] - d) / 1e-6
        np.testing.assert_allclose(slopes[:, k], numeric, atol=1e-5)


def test_occurrences_of_a_phone_share_their_columns() -> None:
    """Eq. 6–7: the columns of all occurrences of one phone are summed."""
    phones = spoken([random_track(3)])
    times_s = np.linspace(0, 2, 120)
    pairs = pairs_of(
        phones, times_s, reach=np.full(len(phones.symbols), 1.5), hold_s=9, seconds=False
    )
    names = sorted(set(phones.symbols))
    unit = np.array([names.index(s) for s in phones.symbols])
    d = np.exp(-(pairs.outside**2))
    basis = np.stack([pairs.local**m for m in range(3)], axis=1)
    matrix = design_matrix(pairs, d, basis, unit[pairs.phone], len(names)).toarray()
    expected = np.zeros_like(matrix)
    for i, at in enumerate(times_s):
        for j, (start, length) in enumerate(zip(phones.start_s, phones.length_s, strict=True)):
            t = (at - start) / length
            outside = max(-t, t - 1, 0)
            if outside <= 1.5:
                for m in range(3):
                    expected[i, unit[j] * 3 + m] += np.exp(-(outside**2)) * t**m
    np.testing.assert_allclose(matrix, expected, atol=1e-9)


def test_long_phones_move_at_their_ends_and_hold_between() -> None:
    phones = spoken([random_track(1)])
    long_ = int(np.argmax(phones.length_s))  # a pause of 0.3 s
    start, end = phones.start_s[long_], phones.end_s[long_]
    times_s = np.linspace(start, end, 31)
    pairs = pairs_of(phones, times_s, reach=np.zeros(len(phones.symbols)), hold_s=0.1, seconds=True)
    local = pairs.local[pairs.phone == long_]
    np.testing.assert_allclose(local[:6], np.linspace(0, 0.5, 6), atol=1e-9)
    np.testing.assert_allclose(local[6:-6], 0.5, atol=1e-9)
    np.testing.assert_allclose(local[-6:], np.linspace(0.5, 1, 6), atol=1e-9)


def test_legendre_spans_the_papers_polynomials() -> None:
    t = np.linspace(-0.2, 1.2, 50)
    powers = np.stack([t**m for m in range(5)], axis=1)
    basis = legendre(t, 4, 0.3)
    coefficients, *_ = np.linalg.lstsq(basis, powers, rcond=None)
    np.testing.assert_allclose(basis @ coefficients, powers, atol=1e-12)
    assert legendre(t, 0, 0.3).shape == (50, 1)


def problem(*, normalise: bool, two: bool = False, degree: int = 2, seed: int = 0) -> Problem:
    data = captured(lines=4, first=seed)
    phones = spoken([line.track for line in data.lines])
    times_s = np.concatenate(
        [line.times_s + o for line, o in zip(data.lines, phones.offset_s, strict=True)]
    )
    values = np.concatenate([line.values[:, 0] for line in data.lines])
    dominance = Dominance2009() if two else Dominance2012()
    names = sorted(set(phones.symbols))
    unit = np.array([names.index(s) for s in phones.symbols])
    reach = dominance.reach(np.full((len(unit), dominance.parameters), 3.0))
    pairs = pairs_of(phones, times_s, reach=reach, hold_s=9.0, seconds=False)
    return Problem(
        pairs, unit[pairs.phone], len(names), values, dominance, (0.05, 3.0), normalise,
        degree, BEYOND, 0.01,
    )  # fmt: skip


@pytest.mark.parametrize("normalise", [False, True])
@pytest.mark.parametrize("two", [False, True])
def test_jacobian_against_finite_differences(normalise: bool, two: bool) -> None:
    given = problem(normalise=normalise, two=two)
    basis = _basis(given)
    sigma = np.random.default_rng(0).uniform(0.4, 1.2, (given.units, given.dominance.parameters))
    state = _evaluate(given, sigma, basis)
    slopes = jacobian(given, state, basis).toarray()
    for column in range(0, sigma.size, 3):
        moved = sigma.ravel().copy()
        moved[column] *= np.exp(1e-6)
        shifted = _evaluate(given, moved.reshape(sigma.shape), basis, state.solution.coefficients)
        numeric = (shifted.predicted - state.predicted) / 1e-6
        np.testing.assert_allclose(slopes[:, column], numeric, atol=2e-5)


@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize("normalise", [False, True])
def test_projection_does_not_end_above_em(seed: int, normalise: bool) -> None:
    given = problem(normalise=normalise, seed=10 * seed)
    start = np.ones((given.units, 1))
    first = _evaluate(given, start, _basis(given)).solution.error
    em = fit(given, start, "em")
    assert em.error < first
    assert fit(given, em.sigma, "projection").error <= em.error


def test_projection_ends_below_em_on_the_whole() -> None:
    """From the same start; one problem alone may end in another valley."""
    sums = {"em": 0.0, "projection": 0.0}
    for seed in range(8):
        given = problem(normalise=False, seed=10 * seed)
        for method in sums:
            sums[method] += fit(given, np.ones((given.units, 1)), method).error
    assert sums["projection"] < 0.99 * sums["em"]


def test_a_fit_finds_what_made_the_motion() -> None:
    """Motion synthesised from known animemes is fitted back almost without error."""
    data = captured(lines=10)
    phones = spoken([line.track for line in data.lines])
    names = sorted(set(phones.symbols))
    unit = np.array([names.index(s) for s in phones.symbols])
    times_s = np.concatenate(
        [line.times_s + o for line, o in zip(data.lines, phones.offset_s, strict=True)]
    )
    rng = np.random.default_rng(5)
    truth = Animemes(
        Dominance2012(), rng.uniform(0.3, 0.9, (1, len(names), 1)),
        rng.normal(0, 0.1, (len(names), 3, 1)), normalise=True, seconds=False, hold_s=9.0,
    )  # fmt: skip
    values = truth.move(phones, unit, times_s)
    empty = Animemes(
        Dominance2012(), np.full((1, len(names), 1), 0.5), np.zeros((len(names), 3, 1)),
        normalise=True, seconds=False, hold_s=9.0,
    )  # fmt: skip
    found = learn_animemes(
        empty, phones, unit, times_s, values, degree=2, ridge=1e-6, method="projection",
        told=lambda _: None,
    )  # fmt: skip
    error = found.move(phones, unit, times_s) - values
    assert np.sqrt((error**2).mean()) < 0.02 * values.std()


def test_frames_with_gaps_are_left_out() -> None:
    given = problem(normalise=True)
    known = np.ones(given.pairs.frames, dtype=bool)
    known[10:40] = False
    fewer, _ = known_frames(given.pairs, known)
    assert fewer.frames == known.sum()
    basis = legendre(fewer.local, 2, BEYOND)
    weight, _ = weights_of(np.exp(-(fewer.outside**2)), fewer, normalise=True)
    unit = np.zeros(len(weight), dtype=np.int64)
    rows = design_matrix(fewer, weight, basis, unit, 1).toarray()
    all_basis = legendre(given.pairs.local, 2, BEYOND)
    all_weight, _ = weights_of(np.exp(-(given.pairs.outside**2)), given.pairs, normalise=True)
    every = design_matrix(
        given.pairs, all_weight, all_basis, np.zeros(len(all_weight), dtype=np.int64), 1
    ).toarray()
    np.testing.assert_allclose(rows, every[known], atol=1e-12)
