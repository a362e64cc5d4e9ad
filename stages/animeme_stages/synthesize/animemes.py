"""Animemes and their dominances, learned and put together; both DAM models are made of them."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from typing import Any, Protocol

import numpy as np

from animeme.curves import Floats
from animeme_stages.synthesize.dominance import Dominance
from animeme_stages.synthesize.fitting import (
    Method,
    Problem,
    fit,
    known_frames,
    solve,
    weights_of,
)
from animeme_stages.synthesize.numbers import array_from, rounded
from animeme_stages.synthesize.spoken import Ints, Pairs, Spoken, legendre, pairs_of

# Polynomials go on for this part of a phone beyond its ends (see `legendre`).
BEYOND = 0.3
# Smallest and largest σ, in the phone's own length and in seconds: beyond, the data cannot tell.
LIMITS = {False: (0.05, 3.0), True: (0.01, 0.6)}


class AnimemeOptions(Protocol):
    """What the options of both models have in common; see `DamOptions`."""

    @property
    def degree(self) -> int:
        """M."""
        ...

    @property
    def normalise(self) -> bool:
        """Whether dominances are divided by their sum."""
        ...

    @property
    def spread(self) -> str:
        """Unit of σ: "seconds" or "lengths"."""
        ...

    @property
    def sigma(self) -> float:
        """Where σ starts."""
        ...

    @property
    def hold_s(self) -> float:
        """See `pairs_of`."""
        ...


@dataclass(frozen=True, eq=False)
class Animemes:
    """U units with coefficients and dominances; N controls, M degree, K parameters per dominance.

    Attributes:
        dominance: family of dominance functions.
        sigma: shape (G, U, K); G is N, or 1 where the controls share their dominances.
        coefficients: shape (U, M + 1, N).
        normalise: dominances are divided by their sum (2012 paper, eq. 2: "normalized values").
        seconds: σ is in seconds, else in the phone's own length.
        hold_s: see `pairs_of`.
    """

    dominance: Dominance
    sigma: Floats
    coefficients: Floats
    normalise: bool
    seconds: bool
    hold_s: float

    @classmethod
    def empty(
        cls, dominance: Dominance, options: AnimemeOptions, units: int, controls: int
    ) -> Animemes:
        """Units that move nothing, with the σ that fitting starts from."""
        return cls(
            dominance=dominance,
            sigma=np.full((1, units, dominance.parameters), options.sigma),
            coefficients=np.zeros((units, options.degree + 1, controls)),
            normalise=options.normalise,
            seconds=options.spread == "seconds",
            hold_s=options.hold_s,
        )

    def pairs(self, phones: Spoken, unit: Ints, times_s: Floats) -> Pairs:
        """Which phone is felt at which time."""
        reach = np.max([self.dominance.reach(sigma[unit]) for sigma in self.sigma], axis=0)
        return pairs_of(phones, times_s, reach=reach, hold_s=self.hold_s, seconds=self.seconds)

    def move(
        self, phones: Spoken, unit: Ints, times_s: Floats, added: Floats | None = None
    ) -> Floats:
        """C(t) = Σ_j D_j(t_j) A_j(t_j) (2012 paper, eq. 2), shape (T, N).

        Args:
            phones: the phones on the axis of `times_s`.
            unit: shape (J,), each phone's unit.
            times_s: shape (T,), sorted.
            added: shape (J, M + 1, N), coefficients on top of the units', or None.
        """
        pairs = self.pairs(phones, unit, times_s)
        coefficients = self.coefficients[unit]
        if added is not None:
            coefficients = coefficients + added
        basis = legendre(pairs.local, coefficients.shape[1] - 1, BEYOND)
        # Phones differ, times do not: one small product per polynomial degree.
        value = np.zeros((len(pairs.phone), coefficients.shape[2]))
        for m in range(coefficients.shape[1]):
            value += basis[:, m, None] * coefficients[pairs.phone, m]
        weight = np.stack([self._weight(pairs, sigma[unit]) for sigma in self.sigma], axis=1)
        return pairs.sum_by_time(weight * value)

    def _weight(self, pairs: Pairs, sigma: Floats) -> Floats:
        d, _ = self.dominance.value(pairs, sigma[pairs.phone])
        return weights_of(d, pairs, normalise=self.normalise)[0]

    def to_json(self) -> dict[str, Any]:
        """What documents keep."""
        return {"sigma": self.sigma.tolist(), "coefficients": self.coefficients.tolist()}

    def restored(self, learned: Mapping[str, Any], units: int, degree: int, controls: int) -> Any:
        """The animemes with what `to_json` kept.

        Raises:
            ValueError: it does not fit.
        """
        sigma = array_from(learned["sigma"], (None, units, self.dominance.parameters), "sigma")
        if len(sigma) not in (1, controls) or (sigma <= 0).any() or (sigma > 100).any():
            raise ValueError("sigma must be positive, for all controls together or for each")
        shape = (units, degree + 1, controls)
        coefficients = array_from(learned["coefficients"], shape, "coefficients")
        return replace(self, sigma=sigma, coefficients=coefficients)


def learn_animemes(
    empty: Animemes,
    phones: Spoken,
    unit: Ints,
    times_s: Floats,
    values: Floats,
    *,
    degree: int,
    ridge: float,
    method: Method | None,
    told: Callable[[float], None],
) -> Animemes:
    """Fit coefficients and, with a `method`, σ of every control on its own.

    Args:
        empty: with the σ to start from, shape (1, U, K).
        phones, unit, times_s: of all lines, on one axis.
        values: shape (F, N), NaN where there is a gap.
        degree: M.
        ridge: see `Problem`.
        method: see `fit`; None keeps σ.
        told: told the part of the controls that are done.
    """
    low, high = LIMITS[empty.seconds]
    start = empty.sigma[0]
    widest = np.full_like(start, high) if method else start
    pairs = replace(empty, sigma=widest[None]).pairs(phones, unit, times_s)
    sigma, coefficients = [], []
    for column in range(values.shape[1]):
        known = np.isfinite(values[:, column])
        own, _ = known_frames(pairs, known)
        problem = Problem(
            pairs=own, unit=unit[own.phone], units=len(start), values=values[known, column],
            dominance=empty.dominance, limits=(low, high), normalise=empty.normalise,
            degree=degree, beyond=BEYOND, ridge=ridge,
        )  # fmt: skip
        found = fit(problem, start, method) if method else solve(problem, start)
        if method:  # coefficients for the σ that the document will have
            found = solve(problem, rounded(found.sigma))
        sigma.append(found.sigma)
        coefficients.append(found.coefficients)
        told((column + 1) / values.shape[1])
    kept = np.stack(sigma) if method else start[None]
    return replace(empty, sigma=kept, coefficients=rounded(np.stack(coefficients, axis=2)))
