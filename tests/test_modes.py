"""Modes: affinity propagation and the A* search."""

from __future__ import annotations

import itertools

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from animeme_stages.synthesize.dam import Dam
from animeme_stages.synthesize.modes import a_star, affinity_propagation
from support.motion import captured


def exhaustive(own: list[list[float]], joints: list[np.ndarray]) -> float:
    best = np.inf
    for path in itertools.product(*(range(len(column)) for column in own)):
        total = sum(column[k] for column, k in zip(own, path, strict=True))
        total += sum(j[a, b] for j, (a, b) in zip(joints, itertools.pairwise(path), strict=True))
        best = min(best, total)
    return best


def cost(path: list[int], own: list[list[float]], joints: list[np.ndarray]) -> float:
    total = sum(column[k] for column, k in zip(own, path, strict=True))
    return total + sum(j[a, b] for j, (a, b) in zip(joints, itertools.pairwise(path), strict=True))


@settings(max_examples=150, deadline=None)
@given(st.lists(st.integers(1, 4), min_size=1, max_size=6), st.integers(0, 10**6))
def test_a_star_finds_what_exhaustive_search_finds(widths: list[int], seed: int) -> None:
    rng = np.random.default_rng(seed)
    own = [rng.exponential(1000, width).tolist() for width in widths]
    joints = [rng.exponential(500, pair) for pair in itertools.pairwise(widths)]
    path = a_star(own, joints)
    assert [0 <= k < w for k, w in zip(path, widths, strict=True)] == [True] * len(widths)
    assert cost(path, own, joints) == pytest.approx(exhaustive(own, joints), rel=1e-12)


def test_affinity_propagation_finds_clear_clusters() -> None:
    rng = np.random.default_rng(0)
    centres = np.array([[0, 0], [6, 0], [0, 6], [7, 7]])
    points = np.concatenate([c + rng.normal(0, 0.4, (25, 2)) for c in centres])
    similarity = -((points[:, None] - points[None]) ** 2).sum(-1)
    exemplars = affinity_propagation(similarity, 5 * float(np.median(similarity)))
    assert sorted(e // 25 for e in exemplars) == [0, 1, 2, 3]
    np.testing.assert_array_equal(
        exemplars, affinity_propagation(similarity, 5 * float(np.median(similarity)))
    )


@pytest.mark.parametrize("count", [1, 2, 5])
def test_affinity_propagation_of_equal_points(count: int) -> None:
    exemplars = affinity_propagation(np.zeros((count, count)), 0.0)
    assert 1 <= len(exemplars) <= count


def test_modes_of_a_line_are_the_cheapest() -> None:
    data = captured(lines=30)
    model = Dam.configured({"modes": "affinity", "degree": 3}).fit(data)
    assert len(model.modes_.units) > len(model.seen_)
    track = data.lines[0].track
    symbols = list(track.ipa())[:5]
    length_s = np.array([phone.duration_s for phone in track.phones])[:5]
    candidates, own, joints = model.modes_.costs(symbols, length_s, 1000.0, 1.0)
    chosen = model.modes_.choose(symbols, length_s, 1000.0, 1.0)
    path = [units.index(u) for units, u in zip(candidates, chosen.tolist(), strict=True)]
    assert cost(path, own, joints) == pytest.approx(exhaustive(own, joints))
    for j in range(1, 5):
        expected = model.modes_.smooth_cost(
            int(chosen[j - 1]), int(chosen[j]), length_s[j - 1], length_s[j]
        )
        assert joints[j - 1][path[j - 1], path[j]] == pytest.approx(expected)


def test_bends_are_second_derivatives_at_both_ends() -> None:
    model = Dam.configured({"modes": "affinity", "degree": 4}).fit(captured(lines=30))
    coefficients = model.animemes_.coefficients
    spread = np.array(model.modes_.spread)
    step = 1e-4
    for unit in (0, len(coefficients) - 1):
        for k, at in enumerate((0.0, 1.0)):
            inner = at + step if k == 0 else at - step
            u = 2 * np.array([inner - step, inner, inner + step]) - 1
            y = np.stack(
                [np.polynomial.legendre.legval(u, coefficients[unit][:, n]) for n in range(3)]
            )
            numeric = (y[:, 0] - 2 * y[:, 1] + y[:, 2]) / step**2 / spread
            found = model.modes_.bends[unit, k * 3 : k * 3 + 3]
            np.testing.assert_allclose(found, numeric, rtol=2e-3, atol=0.02 * np.abs(found).max())
