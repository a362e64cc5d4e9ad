"""Dominance functions: how much a phone is felt, within it and around it.

Both give D and its derivatives by the logarithms of their parameters, which keeps those positive.
"""

from __future__ import annotations

from typing import Protocol

import numpy as np

from animeme.curves import Floats
from animeme_stages.synthesize.spoken import Pairs

# "A small constant to prevent dividing by zero" (2012 paper, eq. 1; 2009 paper, eq. 7).
EPSILON = 1e-6
# Where a dominance would be below this it is 0. What is left is scaled so that no jump remains.
NEGLIGIBLE = 1e-3


class Dominance(Protocol):
    """A family of dominance functions with K parameters per phone."""

    parameters: int

    def reach(self, sigma: Floats) -> Floats:
        """How far outside itself a phone is felt: (J, K) → (J,), in the unit of σ."""
        ...

    def value(self, pairs: Pairs, sigma: Floats) -> tuple[Floats, Floats]:
        """D, shape (P,), and its derivatives by log σ, shape (P, K).

        Args:
            pairs: P pairs of times and phones.
            sigma: shape (P, K), of each pair's phone.
        """
        ...


def _cut(d: Floats, slopes: Floats) -> tuple[Floats, Floats]:
    """End a dominance where it is negligible, without a jump."""
    kept = d > NEGLIGIBLE
    value = np.where(kept, (d - NEGLIGIBLE) / (1.0 - NEGLIGIBLE), 0.0)
    return value, np.where(kept[:, None], slopes / (1.0 - NEGLIGIBLE), 0.0)


class Dominance2012:
    """Eq. 1 of the 2012 paper: 1 within the phone, a Gaussian of width σ on either side."""

    parameters = 1

    def reach(self, sigma: Floats) -> Floats:
        """See `Dominance.reach`."""
        reach: Floats = np.sqrt((sigma[:, 0] ** 2 + EPSILON) * -np.log(NEGLIGIBLE))
        return reach

    def value(self, pairs: Pairs, sigma: Floats) -> tuple[Floats, Floats]:
        """See `Dominance.value`."""
        width = sigma[:, 0] ** 2 + EPSILON
        exponent = pairs.outside**2 / width
        d = np.exp(-exponent)
        return _cut(d, (d * exponent * 2.0 * sigma[:, 0] ** 2 / width)[:, None])


class Dominance2009:
    """Eq. 7 of the 2009 paper: a Gaussian of σ₁ within the phone, of σ₂ outside, continuous.

    In local time, with the centre at ½: exp(−((t − ½)/(σ₁ + ε))²) for |t − ½| < ½, and outside
    exp(−(o/(σ₂ + ε) + ½/(σ₁ + ε))²), where o is the distance from the nearer border.
    """

    parameters = 2

    def reach(self, sigma: Floats) -> Floats:
        """See `Dominance.reach`."""
        inner = 0.5 / (sigma[:, 0] + EPSILON)
        left = np.maximum(np.sqrt(-np.log(NEGLIGIBLE)) - inner, 0.0)
        reach: Floats = left * (sigma[:, 1] + EPSILON)
        return reach

    def value(self, pairs: Pairs, sigma: Floats) -> tuple[Floats, Floats]:
        """See `Dominance.value`."""
        within = sigma[:, 0] + EPSILON
        beyond = sigma[:, 1] + EPSILON
        inside = np.minimum(np.abs(pairs.local - 0.5), 0.5) / within
        out = np.where(pairs.outside > 0, pairs.outside / beyond, 0.0)
        total = inside + out
        d = np.exp(-(total**2))
        slopes = np.stack(
            [d * 2.0 * total * inside * sigma[:, 0] / within,
             d * 2.0 * total * out * sigma[:, 1] / beyond],
            axis=1,
        )  # fmt: skip
        return _cut(d, slopes)
