"""Modes of phones: found by affinity propagation, chosen by A* (2012 paper, V.A and VI)."""

from __future__ import annotations

import heapq
import math
from collections import Counter, defaultdict
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
import scipy  # its parts load when they are first used

from animeme.curves import Floats
from animeme_stages.synthesize.fitted import spreads
from animeme_stages.synthesize.numbers import array_from
from animeme_stages.synthesize.spoken import Ints, Spoken

# Points of a phone's motion that are compared.
_POINTS = 8
# Affinity propagation compares all with all; of a phone seen more often, every n-th occurrence
# competes, and the others join the nearest exemplar.
_MOST = 400
# A mode of fewer occurrences cannot be told from noise, and joins the nearest other.
_FEWEST = 8
# Weight of what is known about one neighbour against what is known about both, in occurrences.
_BACK_OFF = 4.0
# The paper counts time in frames; second derivatives here are per frame of a film.
_FRAME_S = 1 / 25

EDGE = "#"
"""The neighbour of the first and of the last phone."""


@dataclass(frozen=True, eq=False)
class Modes:
    """The modes of all phones; U modes.

    Attributes:
        units: (phone, number of the mode) of each.
        seen: (mode, phone before, phone after, count) in training.
        bends: shape (U, 2 N), second derivatives in local time at the start and at the end, in
            units of each control's spread (see `with_shapes`).
        spread: of each control, N numbers.
    """

    units: tuple[tuple[str, int], ...]
    seen: tuple[tuple[int, str, str, int], ...]
    bends: Floats
    spread: tuple[float, ...]
    _of: dict[str, list[int]] = field(init=False)
    _counts: dict[Any, float] = field(init=False)

    def __post_init__(self) -> None:
        of: dict[str, list[int]] = defaultdict(list)
        for unit, (symbol, _) in enumerate(self.units):
            of[symbol].append(unit)
        counts: Counter[Any] = Counter()
        for unit, before, after, count in self.seen:
            for key in ((before, after), (before, None), (None, after), (None, None)):
                counts[unit, *key] += count
                counts[self.units[unit][0], *key] += count
        object.__setattr__(self, "_of", dict(of))
        object.__setattr__(self, "_counts", dict(counts))

    def with_shapes(self, coefficients: Floats, spread: Any) -> Modes:
        """The modes with the bends of their animemes.

        Args:
            coefficients: shape (U, M + 1, N), of Legendre polynomials on [0, 1].
            spread: N numbers.
        """
        scale = np.asarray(spread, dtype=np.float64)
        series = np.polynomial.legendre.legder(np.moveaxis(coefficients, 1, 0), 2)
        # d²/dt² of a polynomial in u = 2t − 1 is four times that by u.
        ends = [4.0 * np.polynomial.legendre.legval(u, series) / scale for u in (-1.0, 1.0)]
        return replace(self, bends=np.concatenate(ends, axis=1), spread=tuple(scale.tolist()))

    def context_cost(self, unit: int, before: str, after: str) -> float:
        """E_c: −log of the likelihood of a mode between its neighbours (2012 paper, eq. 10)."""
        get, symbol = self._counts.get, self.units[unit][0]
        plain = (get((unit, None, None), 0.0) + 0.5) / (
            get((symbol, None, None), 0.0) + 0.5 * len(self._of[symbol])
        )
        sides = [
            (get((unit, *key), 0.0) + _BACK_OFF * plain) / (get((symbol, *key), 0.0) + _BACK_OFF)
            for key in ((before, None), (None, after))
        ]
        one = (sides[0] + sides[1]) / 2
        both = (get((unit, before, after), 0.0) + _BACK_OFF * one) / (
            get((symbol, before, after), 0.0) + _BACK_OFF
        )
        return -math.log(both)

    def smooth_cost(self, first: int, second: int, first_s: float, second_s: float) -> float:
        """E_s: squared jump of the second derivative where two modes meet (2012 paper, eq. 10)."""
        half = self.bends.shape[1] // 2
        end = self.bends[first, half:] * (_FRAME_S / first_s) ** 2
        start = self.bends[second, :half] * (_FRAME_S / second_s) ** 2
        return float(((end - start) ** 2).sum())

    def costs(
        self, symbols: Sequence[str], length_s: Floats, context: float, smooth: float
    ) -> tuple[list[list[int]], list[list[float]], list[Floats]]:
        """Candidates of each phone, w_c E_c of each, and w_s E_s between neighbours' candidates."""
        candidates = [self._of[symbol] for symbol in symbols]
        around = [EDGE, *symbols, EDGE]
        own = [
            [context * self.context_cost(unit, around[j], around[j + 2]) for unit in units]
            for j, units in enumerate(candidates)
        ]
        half = self.bends.shape[1] // 2
        joints = []
        for j in range(1, len(symbols)):
            scales = (_FRAME_S / length_s[j - 1]) ** 2, (_FRAME_S / length_s[j]) ** 2
            ends = self.bends[candidates[j - 1], half:] * scales[0]
            starts = self.bends[candidates[j], :half] * scales[1]
            joints.append(smooth * ((ends[:, None] - starts[None]) ** 2).sum(axis=2))
        return candidates, own, joints

    def choose(
        self, symbols: Sequence[str], length_s: Floats, context: float, smooth: float
    ) -> Ints:
        """The cheapest sequence of modes (2012 paper, eq. 10), shape (J,)."""
        candidates, own, joints = self.costs(symbols, length_s, context, smooth)
        path = a_star(own, joints)
        return np.array([units[k] for units, k in zip(candidates, path, strict=True)])

    def to_json(self) -> dict[str, Any]:
        """As model documents have it."""
        return {
            "units": [list(unit) for unit in self.units],
            "seen": [list(entry) for entry in self.seen],
            "spread": list(self.spread),
        }

    @classmethod
    def from_json(cls, entry: Mapping[str, Any], phones: frozenset[str]) -> Modes:
        """Read what `to_json` wrote.

        Raises:
            ValueError: a phone has no mode, or a mode makes no sense.
        """
        units = tuple((str(symbol), int(number)) for symbol, number in entry["units"])
        if {symbol for symbol, _ in units} != phones or len(set(units)) != len(units):
            raise ValueError("every phone needs modes of its own")
        seen = tuple((int(u), str(b), str(a), int(n)) for u, b, a, n in entry["seen"])
        if any(not 0 <= unit < len(units) or n < 1 for unit, _, _, n in seen):
            raise ValueError("modes were seen that are not listed")
        spread = array_from(entry["spread"], (None,), "spread")
        if (spread <= 0).any():
            raise ValueError("spread must be positive")
        return cls(units, seen, np.zeros((len(units), 1)), tuple(spread.tolist()))


def a_star(own: Sequence[Sequence[float]], joints: Sequence[Floats]) -> list[int]:
    """The cheapest path through a trellis by A* (Hart, Nilsson & Raphael 1968).

    The heuristic is the cost of the cheapest node of every column still to come. No joint costs
    less than nothing, so it never overestimates, and the first path that is complete is the best.

    Args:
        own: cost of each node, column by column, none negative.
        joints: joints[j][a, b] is the cost from node a of column j to node b of the next.

    Returns:
        The node taken in each column.
    """
    ahead = [0.0]
    for column in reversed(own):
        ahead.append(ahead[-1] + min(column))
    ahead.reverse()
    queue: list[tuple[float, int, int, float]] = []
    parent: dict[tuple[int, int], int] = {}
    best: dict[tuple[int, int], float] = {}
    for node, cost in enumerate(own[0]):
        best[0, node] = cost
        # Among equals the longest path goes first, then the lowest node: no choice is left open.
        heapq.heappush(queue, (cost + ahead[1], 0, node, cost))
    while queue:
        _, minus, node, cost = heapq.heappop(queue)
        place = -minus
        if cost > best[place, node]:
            continue
        if place == len(own) - 1:
            break
        for following, price in enumerate(own[place + 1]):
            total = cost + price + float(joints[place][node, following])
            if total < best.get((place + 1, following), math.inf):
                best[place + 1, following] = total
                parent[place + 1, following] = node
                heapq.heappush(queue, (total + ahead[place + 2], minus - 1, following, total))
    path = [node]
    for place in range(len(own) - 1, 0, -1):
        path.append(parent[place, path[-1]])
    return path[::-1]


def find_modes(
    phones: Spoken, times_s: Floats, values: Floats, preference: float
) -> tuple[Modes, Ints]:
    """Cluster the occurrences of every phone by their motion (2012 paper, section V.A).

    Args:
        phones, times_s: of all lines, on one axis.
        values: shape (F, N), NaN where there is a gap.
        preference: how much an exemplar has to be better than the median similarity; more gives
            fewer modes.

    Returns:
        The modes, and the mode of each phone, shape (J,).
    """
    shapes = _resampled(phones, times_s, values)
    symbols = np.array(phones.symbols)
    unit = np.zeros(len(symbols), dtype=np.int64)
    units: list[tuple[str, int]] = []
    for symbol in sorted(set(phones.symbols)):
        members = np.flatnonzero(symbols == symbol)
        label = _clusters(shapes[members], preference)
        unit[members] = len(units) + label
        units += [(symbol, number) for number in range(int(label.max()) + 1)]
    counts: Counter[tuple[int, str, str]] = Counter()
    before, after = phones.neighbour(-1), phones.neighbour(1)
    for j in range(len(symbols)):
        left = phones.symbols[before[j]] if before[j] >= 0 else EDGE
        right = phones.symbols[after[j]] if after[j] >= 0 else EDGE
        counts[int(unit[j]), left, right] += 1
    seen = tuple((*key, count) for key, count in sorted(counts.items()))
    spread = tuple(spreads(values).tolist())
    return Modes(tuple(units), seen, np.zeros((len(units), 1)), spread), unit


def _resampled(phones: Spoken, times_s: Floats, values: Floats) -> Floats:
    """Each phone's motion at `_POINTS` local times by cubic splines, shape (J, _POINTS N)."""
    local = np.linspace(0.0, 1.0, _POINTS)
    at_s = phones.start_s[:, None] + local * phones.length_s[:, None]
    spread = spreads(values)
    columns = []
    for column in range(values.shape[1]):
        known = np.isfinite(values[:, column])
        spline = (
            scipy.interpolate.CubicSpline(times_s[known], values[known, column])
            if known.sum() > 1
            else None
        )
        found = spline(at_s) if spline else np.zeros(at_s.shape)
        # A spline through a gap may swing; motion stays within what was captured.
        limits = (np.nanmin(values[:, column]), np.nanmax(values[:, column]))
        columns.append(np.clip(found, *limits) / spread[column])
    return np.concatenate(columns, axis=1)


def _clusters(shapes: Floats, preference: float) -> Ints:
    """A cluster number, from 0, for each row."""
    count = len(shapes)
    if count < 2 * _FEWEST:
        return np.zeros(count, dtype=np.int64)
    few = np.arange(count)[:: math.ceil(count / _MOST)]
    similarity = -_squared_distances(shapes[few], shapes[few])
    off = similarity[~np.eye(len(few), dtype=bool)]
    exemplars = few[affinity_propagation(similarity, preference * float(np.median(off)))]
    while True:
        label: Ints = _squared_distances(shapes, shapes[exemplars]).argmin(axis=1)
        sizes = np.bincount(label, minlength=len(exemplars))
        if len(exemplars) == 1 or sizes.min() >= _FEWEST:
            return label
        exemplars = np.delete(exemplars, int(sizes.argmin()))


def _squared_distances(a: Floats, b: Floats) -> Floats:
    squares: Floats = (a**2).sum(1)[:, None] + (b**2).sum(1)[None] - 2.0 * a @ b.T
    return np.maximum(squares, 0.0)


def affinity_propagation(
    similarity: Floats, preference: float, *, damping: float = 0.9, longest: int = 300
) -> Ints:
    """Exemplars by passing messages (Frey & Dueck 2007, eq. 1–3).

    Ties are broken by adding to each similarity a little that depends on its place alone, where the
    authors add noise, so that the result is always the same.

    Args:
        similarity: shape (n, n), symmetric, larger is more similar.
        preference: self-similarity; larger gives more exemplars.
        damping: part of each message that stays from one iteration to the next.
        longest: iterations at most; it ends when the exemplars stay for 30.

    Returns:
        Indices of the exemplars, sorted, at least one.
    """
    count = len(similarity)
    if count == 1:
        return np.array([0])
    s = similarity.copy()
    np.fill_diagonal(s, preference)
    scale = max(float(np.abs(s).max()), 1e-300)
    s += 1e-9 * scale * np.modf(np.arange(count * count).reshape(count, count) * 0.618033988749)[0]
    responsibility = np.zeros_like(s)
    availability = np.zeros_like(s)
    rows = np.arange(count)
    previous, same = np.zeros(count, dtype=bool), 0
    for _ in range(longest):
        total = availability + s
        first = total.argmax(axis=1)
        largest = total[rows, first]
        total[rows, first] = -np.inf
        second = total.max(axis=1)
        new = s - largest[:, None]
        new[rows, first] = s[rows, first] - second
        responsibility = damping * responsibility + (1.0 - damping) * new
        positive = np.maximum(responsibility, 0.0)
        positive[rows, rows] = responsibility[rows, rows]
        new = positive.sum(axis=0)[None] - positive
        own = new[rows, rows].copy()
        new = np.minimum(new, 0.0)
        new[rows, rows] = own
        availability = damping * availability + (1.0 - damping) * new
        chosen = (availability + responsibility)[rows, rows] > 0
        same = same + 1 if (chosen == previous).all() else 0
        previous = chosen
        if same >= 30 and chosen.any():
            break
    exemplars = np.flatnonzero(previous)
    if not len(exemplars):
        exemplars = np.array([int(s.sum(axis=0).argmax())])
    return exemplars
