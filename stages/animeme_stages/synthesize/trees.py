"""Boosted regression trees over a phone's context, whose leaves are animemes.

Each tree puts questions about the context to a phone and gives it polynomial coefficients for all
controls; a phone's animeme is its own, plus what every tree adds. So each context is a mode, and a
context that was never seen falls back, question by question, to what was. Gradient boosting:
Friedman 2001; second-order gains and shrinkage as in Chen & Guestrin 2016, eq. 6–7, with a matrix
for the Hessian, because a leaf is a polynomial.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from animeme.curves import Floats
from animeme_stages.synthesize.context import Booleans
from animeme_stages.synthesize.fitting import design_matrix
from animeme_stages.synthesize.numbers import array_from
from animeme_stages.synthesize.spoken import Ints, Pairs

# Phones whose leaves are gathered at once: what they take stays within a processor's cache.
_AT_ONCE = 64
# The part of all questions that may be asked at each level of each tree, drawn anew: trees grow
# faster, and differ more (as in random forests: Breiman 2001), at the same held-out error.
_SHARE = 0.15
_SEED = 2012


@dataclass(frozen=True, eq=False)
class Forest:
    """R trees of equal depth; the nodes of a level stand side by side.

    Attributes:
        asked: shape (R, 2^depth − 1), index of each node's question, −1 where none is asked (the
            answer then is no).
        leaves: shape (R, 2^depth, M + 1, N), coefficients.
        step: shape (N,): leaves are whole multiples of it, and documents keep how many; None for
            one read from a document that keeps the coefficients themselves.
    """

    asked: Ints
    leaves: Floats
    step: Floats | None = None

    @property
    def depth(self) -> int:
        """Questions on the way to a leaf."""
        return int(self.leaves.shape[1]).bit_length() - 1

    def in_steps(self, step: Floats) -> Forest:
        """The forest with its leaves rounded to multiples of `step`, shape (N,)."""
        return Forest(self.asked, np.rint(self.leaves / step) * step, step)

    def to_json(self) -> dict[str, Any]:
        """What documents keep."""
        leaves: Any = self.leaves.tolist()
        if self.step is not None:
            counts = np.rint(self.leaves / self.step).astype(np.int64)
            leaves = {"step": self.step.tolist(), "counts": counts.tolist()}
        return {"asked": self.asked.tolist(), "leaves": leaves}

    @classmethod
    def from_json(
        cls, learned: Mapping[str, Any], *, depth: int, shape: tuple[int, int], questions: int
    ) -> Forest:
        """Read what `to_json` wrote.

        Args:
            learned: has "asked" and "leaves".
            depth: of the trees.
            shape: (M + 1, N).
            questions: how many are listed.

        Raises:
            ValueError: it does not fit.
        """
        size = 2**depth
        asked = array_from(learned["asked"], (None, size - 1), "asked").astype(np.int64)
        if len(asked) and (asked.min() < -1 or asked.max() >= questions):
            raise ValueError("a tree asks a question that is not listed")
        leaves, step = learned["leaves"], None
        whole = (len(asked), size, *shape)
        if isinstance(leaves, Mapping):
            step = array_from(leaves["step"], shape[1:], "step")
            if (step <= 0).any():
                raise ValueError("step must be positive")
            return cls(asked, np.rint(array_from(leaves["counts"], whole, "counts")) * step, step)
        return cls(asked, array_from(leaves, whole, "leaves"))

    def leaf_of(self, answers: Booleans) -> Ints:
        """The leaf of each phone in each tree: (J, Q) → (J, R)."""
        count = len(self.asked)
        tree = np.arange(count)
        place = np.zeros((len(answers), count), dtype=np.int64)
        phone = np.arange(len(answers))[:, None]
        if not answers.shape[1]:  # too little data to ask anything
            return place
        for level in range(self.depth):
            question = self.asked[tree, 2**level - 1 + place]
            yes = answers[phone, np.maximum(question, 0)] & (question >= 0)
            place = 2 * place + yes
        return place

    def coefficients(self, answers: Booleans) -> Floats:
        """What the trees add to each phone's coefficients: (J, Q) → (J, M + 1, N)."""
        leaf = self.leaf_of(answers)
        tree = np.arange(len(self.asked))
        total = np.zeros((len(answers), *self.leaves.shape[2:]))
        for first in range(0, len(answers), _AT_ONCE):
            some = slice(first, first + _AT_ONCE)
            total[some] = self.leaves[tree, leaf[some]].sum(axis=1)
        return total


@dataclass(frozen=True)
class Growth:
    """How trees are grown.

    Attributes:
        rounds: number of trees.
        depth: questions on the way to a leaf.
        rate: part of each tree's coefficients that is used.
        leaf: the fewest occurrences in a leaf.
        ridge: penalty on the square of each coefficient of a leaf, in frames.
    """

    rounds: int
    depth: int
    rate: float
    leaf: int
    ridge: float


def grow(
    pairs: Pairs,
    weight: Floats,
    basis: Floats,
    answers: Booleans,
    residual: Floats,
    growth: Growth,
    told: Callable[[float], None],
) -> Forest:
    """Fit trees to what is left of the captured motion.

    Args:
        pairs: which phone is felt at which frame.
        weight: shape (P,), (normalised) dominance of each pair.
        basis: shape (P, M + 1).
        answers: shape (J, Q).
        residual: shape (F, N), in units of each control's spread; 0 where nothing was captured.
        growth: how.
        told: told the part of the trees that are grown.
    """
    phones, width, controls = len(answers), basis.shape[1], residual.shape[1]
    design = design_matrix(pairs, weight, basis, pairs.phone, phones)
    transposed = design.T.tocsr()
    search = _Search(answers, _hessians(pairs, weight, basis, phones), growth, controls)
    asked, leaves = [], []
    residual = residual.copy()
    for number in range(growth.rounds):
        gradient = (transposed @ residual).reshape(phones, width, controls)
        tree, leaf, place = search.tree(gradient)
        residual -= design @ leaf[place].reshape(phones * width, controls)
        asked.append(tree)
        leaves.append(leaf)
        told((number + 1) / growth.rounds)
    size = 2**growth.depth
    if not asked:
        return Forest(np.zeros((0, size - 1), np.int64), np.zeros((0, size, width, controls)))
    return Forest(np.stack(asked), np.stack(leaves))


def _hessians(pairs: Pairs, weight: Floats, basis: Floats, phones: int) -> Floats:
    """GᵀG of each phone's own columns, shape (J, M + 1, M + 1).

    What phones share of a frame is left out, as in any block-diagonal approximation; `Growth.rate`
    makes up for it.
    """
    width = basis.shape[1]
    rows = weight[:, None] * basis
    found = np.empty((phones, width, width))
    for a in range(width):
        for b in range(a, width):
            found[:, a, b] = np.bincount(pairs.phone, rows[:, a] * rows[:, b], phones)
            found[:, b, a] = found[:, a, b]
    return found


class _Search:
    """Greedy search for the questions of one tree after another."""

    def __init__(self, answers: Booleans, hessians: Floats, growth: Growth, controls: int) -> None:
        self.answers = answers
        # Single precision halves the time of choosing questions; leaves are solved in double.
        self.table = answers.T.astype(np.float32)
        self.hessians = hessians
        self.growth = growth
        self.controls = controls
        self.width = hessians.shape[1]
        self.upper = np.triu_indices(self.width)
        self.packed = hessians[:, self.upper[0], self.upper[1]]
        self.draw = np.random.default_rng(_SEED)

    def tree(self, gradient: Floats) -> tuple[Ints, Floats, Ints]:
        """One tree: its questions, its leaves, and the leaf of each phone."""
        growth, phones = self.growth, len(self.answers)
        stats = np.concatenate(
            [gradient.reshape(phones, -1), self.packed, np.ones((phones, 1))], axis=1
        )
        single = stats.astype(np.float32)
        asked = np.full(2**growth.depth - 1, -1, dtype=np.int64)
        place = np.zeros(phones, dtype=np.int64)
        for level in range(growth.depth):
            drawn = self._drawn()
            table = self.table[drawn]
            for node in range(2**level):
                members = np.flatnonzero(place == node)
                if len(members) >= 2 * growth.leaf:
                    best = self._best(members, single, table)
                    asked[2**level - 1 + node] = drawn[best] if best >= 0 else -1
            question = asked[2**level - 1 + place]
            yes = self.answers[np.arange(phones), np.maximum(question, 0)] & (question >= 0)
            place = 2 * place + yes
        size = 2**growth.depth
        sums = np.zeros((size, stats.shape[1]))
        np.add.at(sums, place, stats)
        _, leaves = self._gain(sums)
        return asked, growth.rate * leaves, place

    def _drawn(self) -> Ints:
        """The questions that may be asked at one level, in order."""
        count = math.ceil(_SHARE * len(self.table))
        return np.sort(self.draw.choice(len(self.table), count, replace=False))

    def _best(self, members: Ints, single: Any, table: Any) -> int:
        """The row of `table` that lowers the error most, −1 if none divides `members`."""
        own = single[members]
        total = own.sum(axis=0, dtype=np.float64)
        everyone = len(members) == table.shape[1]
        yes = ((table if everyone else table[:, members]) @ own).astype(np.float64)
        leaf = self.growth.leaf
        able = np.flatnonzero((yes[:, -1] >= leaf) & (total[-1] - yes[:, -1] >= leaf))
        if not len(able):
            return -1
        gain = self._gain(yes[able])[0] + self._gain(total - yes[able])[0]
        return int(able[np.argmax(gain)])

    def _gain(self, sums: Floats) -> tuple[Floats, Floats]:
        """How far the best coefficients lower the error, and those: (S, …) → (S,), (S, M+1, N)."""
        split = self.width * self.controls
        gradient = sums[:, :split].reshape(-1, self.width, self.controls)
        matrix = np.empty((len(sums), self.width, self.width))
        matrix[:, self.upper[0], self.upper[1]] = sums[:, split:-1]
        matrix[:, self.upper[1], self.upper[0]] = sums[:, split:-1]
        matrix += self.growth.ridge * np.eye(self.width)
        best = np.asarray(np.linalg.solve(matrix, gradient), dtype=np.float64)
        gain: Floats = np.einsum("smn,smn->s", gradient, best)
        return gain, best
