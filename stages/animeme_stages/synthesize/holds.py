"""Phones that are held for longer than any that was seen: singing, shouts, long pauses.

Fading dominances and polynomials say little about the middle of such a phone (2012 paper, section
VIII). There, the curve settles where the captured speaker was in the middle of that phone.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from animeme.curves import Floats
from animeme.dataset import Dataset
from animeme.phones import PhoneTrack
from animeme_stages.synthesize.numbers import array_from, rounded

# Time to settle, and to leave again.
RAMP_S = 0.15


@dataclass(frozen=True)
class Holds:
    """Where phones settle.

    Attributes:
        longest_s: phone → the longest that it was seen.
        values: phone → N values.
    """

    longest_s: Mapping[str, float]
    values: Mapping[str, Sequence[float]]

    def settle(
        self, track: PhoneTrack, symbols: Sequence[str], times_s: Floats, weights: Floats
    ) -> Floats:
        """`weights` with the middle of every phone that is longer than was seen settled.

        Args:
            track: the phones.
            symbols: the seen phone that each moves like.
            times_s: shape (T,).
            weights: shape (T, N).
        """
        settled = weights
        for symbol, phone in zip(symbols, track.phones, strict=True):
            seen_s = self.longest_s[symbol]
            if phone.duration_s <= seen_s:
                continue
            if settled is weights:
                settled = weights.copy()
            first, last = np.searchsorted(times_s, [phone.start_s, phone.end_s])
            at_s = times_s[first:last]
            inside_s = np.minimum(at_s - phone.start_s, phone.end_s - at_s) - seen_s / 2
            u = np.clip(inside_s / RAMP_S, 0.0, 1.0)[:, None]
            share = u * u * (3.0 - 2.0 * u)
            value = np.asarray(self.values[symbol])
            settled[first:last] += share * (value - settled[first:last])
        return settled

    def to_json(self) -> dict[str, Any]:
        """As model documents have it."""
        return {symbol: [s, *self.values[symbol]] for symbol, s in self.longest_s.items()}

    @classmethod
    def from_json(cls, entry: Mapping[str, Any], seen: frozenset[str], controls: int) -> Holds:
        """Read what `to_json` wrote.

        Raises:
            ValueError: a phone lacks its length or a value.
        """
        if set(entry) != seen:
            raise ValueError("holds: every phone needs a length and its values")
        table = {s: array_from(row, (controls + 1,), "holds").tolist() for s, row in entry.items()}
        if any(row[0] <= 0 for row in table.values()):
            raise ValueError("holds: lengths must be positive")
        longest_s = {symbol: row[0] for symbol, row in table.items()}
        return cls(longest_s, {symbol: row[1:] for symbol, row in table.items()})


def learn_holds(dataset: Dataset) -> Holds:
    """Longest length and mean captured value in the middle half of each phone."""
    controls = len(dataset.controls)
    longest_s: dict[str, float] = defaultdict(float)
    rows: dict[str, list[Floats]] = defaultdict(list)
    for line in dataset.lines:
        for symbol, phone in zip(line.track.ipa(), line.track.phones, strict=True):
            longest_s[symbol] = max(longest_s[symbol], phone.duration_s)
            quarter_s = phone.duration_s / 4
            inside = (line.times_s >= phone.start_s + quarter_s) & (
                line.times_s <= phone.end_s - quarter_s
            )
            rows[symbol].append(line.values[inside])
    everything = np.concatenate([line.values for line in dataset.lines])
    overall = [_mean(everything[:, n], 0.0) for n in range(controls)]
    values = {}
    for symbol, parts in sorted(rows.items()):
        table = np.concatenate(parts)
        found = [_mean(table[:, n], overall[n]) for n in range(controls)]
        values[symbol] = rounded(found).tolist()
    return Holds({s: float(rounded(longest_s[s])) for s in values}, values)


def _mean(column: Floats, otherwise: float) -> float:
    known = column[np.isfinite(column)]
    return float(known.mean()) if len(known) else otherwise
