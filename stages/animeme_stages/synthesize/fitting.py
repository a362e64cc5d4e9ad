"""Learning animemes and their dominances: C(t) = Σ_j D_j(t_j) A_j(t_j) (2012 paper, eq. 2).

A *unit* is what shares coefficients and σ: a phone, or one mode of a phone. U units, P pairs of
times and phones, M the degree of the polynomials, K parameters of a dominance.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any, Literal

import numpy as np
import scipy  # its parts load when they are first used

from animeme.curves import Floats
from animeme_stages.synthesize.dominance import Dominance
from animeme_stages.synthesize.spoken import Ints, Pairs, legendre

# Iterations end when the error falls by less than this part of itself.
CONVERGED = 1e-4
LONGEST = {"projection": 15, "em": 60}
# No Gauss–Newton step changes a σ by more than this factor's logarithm.
_LARGEST_STEP = 1.0
_ATTEMPTS = 6

Method = Literal["projection", "em"]


@dataclass(frozen=True, eq=False)
class Problem:
    """What the fit of one control is given.

    Attributes:
        pairs: of the frames whose value is known.
        unit: shape (P,), unit of each pair's phone.
        units: U.
        values: shape (F,), the captured control.
        dominance: family of dominance functions.
        limits: smallest and largest σ.
        normalise: divide dominances by their sum.
        degree: M.
        beyond: see `legendre`.
        ridge: penalty on the square of each coefficient, in frames.
    """

    pairs: Pairs
    unit: Ints
    units: int
    values: Floats
    dominance: Dominance
    limits: tuple[float, float]
    normalise: bool
    degree: int
    beyond: float
    ridge: float


@dataclass(frozen=True, eq=False)
class Solution:
    """Coefficients for given σ, and what they leave.

    Attributes:
        sigma: shape (U, K).
        coefficients: shape (U, M + 1).
        error: sum of squared residuals and penalties.
    """

    sigma: Floats
    coefficients: Floats
    error: float


@dataclass(frozen=True, eq=False)
class _State:
    """Everything about one σ that the next step needs."""

    solution: Solution
    design: Any  # sparse (F, U (M + 1)), eq. 7
    gram: Any  # Cholesky factor of the normal equations' matrix
    slopes: Floats  # (P, K), of the (normalised) dominance by log σ
    predicted: Floats  # (F,)


def weights_of(dominance: Floats, pairs: Pairs, *, normalise: bool) -> tuple[Floats, Floats]:
    """The weight of each pair, and the sum of dominances at each time (1 without `normalise`)."""
    if not normalise:
        return dominance, np.ones(pairs.frames)
    total = np.maximum(pairs.sum_by_time(dominance), 1e-9)
    return dominance / total[pairs.time], total


def design_matrix(pairs: Pairs, weight: Floats, basis: Floats, unit: Ints, units: int) -> Any:
    """The dominance matrix with the occurrences of a unit summed (2012 paper, eq. 5–7).

    Returns:
        Sparse, shape (F, U (M + 1)).
    """
    width = basis.shape[1]
    used = weight > 0
    rows = np.repeat(pairs.time[used], width)
    columns = (unit[used][:, None] * width + np.arange(width)).ravel()
    entries = (weight[used][:, None] * basis[used]).ravel()
    shape = (pairs.frames, units * width)
    return scipy.sparse.csr_matrix((entries, (rows, columns)), shape=shape)


def solve(problem: Problem, sigma: Floats) -> Solution:
    """The best coefficients for given dominances: normal equations (2012 paper, eq. 5)."""
    return _evaluate(problem, sigma, _basis(problem)).solution


def fit(problem: Problem, sigma: Floats, method: Method = "projection") -> Solution:
    """Coefficients and σ that fit the captured values.

    "em" is the papers' way: coefficients for fixed σ (eq. 5), then Gauss–Newton on σ for fixed
    coefficients (eq. 8–9), in turns. "projection" steps on σ with the coefficients eliminated
    (variable projection: Golub & Pereyra 1973, with the Jacobian of Kaufman 1975). Both are damped
    (Levenberg 1944, Marquardt 1963), so that the error never rises.

    Args:
        problem: what to fit.
        sigma: where to start, shape (U, K).
        method: see above.
    """
    basis = _basis(problem)
    state = _evaluate(problem, sigma, basis)
    damping = 1e-3
    for _ in range(LONGEST[method]):
        before = state.solution.error
        state, damping = _step(problem, state, basis, method, damping)
        if state.solution.error > before * (1.0 - CONVERGED):
            break
    return state.solution


def _basis(problem: Problem) -> Floats:
    return legendre(problem.pairs.local, problem.degree, problem.beyond)


def _evaluate(
    problem: Problem, sigma: Floats, basis: Floats, coefficients: Floats | None = None
) -> _State:
    """The state at `sigma`, with the best coefficients or those given."""
    d, slopes = problem.dominance.value(problem.pairs, sigma[problem.unit])
    weight, total = weights_of(d, problem.pairs, normalise=problem.normalise)
    design = design_matrix(problem.pairs, weight, basis, problem.unit, problem.units)
    gram = None
    if coefficients is None:
        matrix = (design.T @ design).toarray()
        matrix[np.diag_indices_from(matrix)] += problem.ridge + 1e-9
        gram = scipy.linalg.cho_factor(matrix, overwrite_a=True, check_finite=False)
        flat = scipy.linalg.cho_solve(gram, design.T @ problem.values, check_finite=False)
        coefficients = flat.reshape(problem.units, -1)
    predicted = design @ coefficients.ravel()
    residual = problem.values - predicted
    error = float(residual @ residual + problem.ridge * (coefficients**2).sum())
    slopes = slopes / total[problem.pairs.time][:, None]
    return _State(Solution(sigma, coefficients, error), design, gram, slopes, predicted)


def jacobian(problem: Problem, state: _State, basis: Floats) -> Any:
    """Derivatives of the prediction by log σ, coefficients fixed (eq. 8); sparse (F, U K)."""
    count = problem.dominance.parameters
    shape = np.einsum("pm,pm->p", basis, state.solution.coefficients[problem.unit])
    # With normalised dominances, more of one phone is less of all others.
    above = shape - state.predicted[problem.pairs.time] if problem.normalise else shape
    entries = (state.slopes * above[:, None]).ravel()
    rows = np.repeat(problem.pairs.time, count)
    columns = (problem.unit[:, None] * count + np.arange(count)).ravel()
    size = (problem.pairs.frames, problem.units * count)
    return scipy.sparse.csr_matrix((entries, (rows, columns)), shape=size)


def _step(
    problem: Problem, state: _State, basis: Floats, method: Method, damping: float
) -> tuple[_State, float]:
    """One accepted Gauss–Newton step on log σ; the state itself if none lowers the error."""
    slopes = jacobian(problem, state, basis)
    normal = (slopes.T @ slopes).toarray()
    if method == "projection":
        across = (state.design.T @ slopes).toarray()
        normal -= across.T @ scipy.linalg.cho_solve(state.gram, across, check_finite=False)
    downhill = slopes.T @ (problem.values - state.predicted)
    scale = np.maximum(np.diag(normal), 1e-9 * max(np.diag(normal).max(), 1e-30))
    for _ in range(_ATTEMPTS):
        step = np.linalg.solve(normal + np.diag(damping * scale), downhill)
        step = np.clip(step, -_LARGEST_STEP, _LARGEST_STEP).reshape(state.solution.sigma.shape)
        sigma = np.clip(state.solution.sigma * np.exp(step), *problem.limits)
        fixed = state.solution.coefficients if method == "em" else None
        moved = _evaluate(problem, sigma, basis, fixed)
        if moved.solution.error < state.solution.error:
            if method == "em":  # the E-step
                moved = _evaluate(problem, sigma, basis)
            return moved, max(damping / 5.0, 1e-6)
        damping *= 8.0
    return state, damping


def known_frames(pairs: Pairs, known: Any) -> tuple[Pairs, Any]:
    """The pairs of the frames where `known` holds, renumbered, and which pairs they are."""
    if known.all():
        return pairs, slice(None)
    number = np.cumsum(known) - 1
    kept = known[pairs.time]
    fewer = replace(
        pairs,
        frames=int(known.sum()),
        time=number[pairs.time[kept]],
        phone=pairs.phone[kept],
        local=pairs.local[kept],
        outside=pairs.outside[kept],
    )
    return fewer, kept
