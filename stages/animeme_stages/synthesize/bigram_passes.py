"""What happens to bigrams between the set and the result: stitch, smooth, resolve, limit.

Xu, Feng, Marsella & Shapiro, "A practical and configurable lip sync method for games" ("the 2013
paper"), section 2.2, in its order.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import combinations, pairwise

import numpy as np

from animeme.curves import Floats
from animeme.phones import SILENCE, PhoneTrack
from animeme_stages.synthesize.bigram_set import LOCAL, BigramSet
from animeme_stages.synthesize.spoken import Ints

# Section 2.2.2: the largest sum of two poses that nothing else is said about.
USUAL_LIMIT = 2.0
# Before the first and after the last phone the mouth is taken to rest this long.
REST_S = 0.1
# Weights nearer than this are the same.
_SAME = 1e-9


@dataclass(frozen=True, eq=False)
class Segments:
    """The phones of a track between rests, so that every phone is in two bigrams; J of them.

    Attributes:
        symbols: plain IPA of each.
        bounds_s: their borders, shape (J + 1,).
        lengths_s: how long each moves, shape (J,): its length, or less where it is held.
    """

    symbols: tuple[str, ...]
    bounds_s: Floats
    lengths_s: Floats

    def bigrams_at(self, times_s: Floats) -> Iterator[tuple[Ints, Ints, Ints, Floats]]:
        """The pairs that each time is in: those that end with its phone, then those it begins.

        Yields:
            Rows of `times_s`, shape (R,), and for each the pair (by its first segment), the sample
            of `LOCAL` at or before its place in the pair, and the part of the way to the next.
        """
        starts = self.bounds_s[:-1]
        now = np.clip(np.searchsorted(starts, times_s, side="right") - 1, 0, len(starts) - 1)
        since_s, until_s = times_s - starts[now], self.bounds_s[now + 1] - times_s
        length_s = self.lengths_s[now]
        held_s = np.where(
            since_s < length_s / 2, since_s, np.maximum(length_s - until_s, length_s / 2)
        )
        is_held = np.diff(self.bounds_s)[now] - length_s > _SAME
        local_s = np.where(is_held, held_s, since_s)
        for back in (1, 0):
            pair = now - back
            rows = np.flatnonzero((pair >= 0) & (pair < len(starts) - 1))
            own = pair[rows]
            span_s = self.lengths_s[own] + self.lengths_s[own + 1]
            reached_s = local_s[rows] + (self.lengths_s[own] if back else 0.0)
            place = np.clip(reached_s / span_s, 0.0, 1.0) * (len(LOCAL) - 1)
            low = np.minimum(place.astype(np.int64), len(LOCAL) - 2)
            yield rows, own, low, place - low


def segments(
    track: PhoneTrack, *, hold_s: float = np.inf, pause_hold_s: float = np.inf
) -> Segments:
    """The phones of `track` between two rests.

    Args:
        track: the phones.
        hold_s: a phone longer than this moves as it would in this time, the first half from its
            start, the second towards its end, and holds its middle.
        pause_hold_s: the same for pauses.
    """
    symbols = (SILENCE, *track.ipa(), SILENCE)
    inner = [phone.start_s for phone in track.phones]
    bounds_s = np.array([-REST_S, *inner, track.duration_s, track.duration_s + REST_S])
    most = [pause_hold_s if symbol == SILENCE else hold_s for symbol in symbols]
    return Segments(symbols, bounds_s, np.minimum(np.diff(bounds_s), most))


@dataclass(frozen=True, eq=False)
class Stitched:
    """Weights of the poses, and where they come from.

    Attributes:
        weights: shape (T, K).
        pair: which pair of segments each weight comes from, shape (T, K).
    """

    weights: Floats
    pair: Ints


def stitch(set_: BigramSet, parts: Segments, times_s: Floats) -> Stitched:
    """The larger of the two bigrams at each time, each warped over its phones (section 2.2.1)."""
    names = [set_.class_of(symbol) for symbol in parts.symbols]
    weights = np.full((len(times_s), len(set_.poses)), -np.inf)
    which = np.zeros(weights.shape, dtype=np.int64)
    tables = np.stack([set_.table(a, b) for a, b in pairwise(names)])
    for rows, pair, low, part in parts.bigrams_at(times_s):
        up = part[:, None]
        value = (1 - up) * tables[pair, low] + up * tables[pair, low + 1]
        larger = value > weights[rows]
        weights[rows] = np.where(larger, value, weights[rows])
        which[rows] = np.where(larger, pair[:, None], which[rows])
    return Stitched(weights, which)


def smooth(times_s: Floats, curve: Floats, window_s: float) -> Floats:
    """Join local maxima that fit into a window, over the valley between (section 2.2.1).

    Joining two can leave a lower one between two others as a valley of its own, so that every two
    of a window are joined, not only neighbours.

    Args:
        times_s: shape (T,).
        curve: shape (T,).
        window_s: 2 t_w of the paper.
    """
    middle = curve[1:-1]
    peaks = 1 + np.flatnonzero((middle >= curve[:-2]) & (middle > curve[2:]))
    joined = curve.copy()
    for index, first in enumerate(peaks.tolist()):
        for second in peaks[index + 1 :].tolist():
            if times_s[second] - times_s[first] > window_s + _SAME:
                break
            inside = slice(first, second + 1)
            line = np.interp(times_s[inside], times_s[[first, second]], curve[[first, second]])
            joined[inside] = np.maximum(joined[inside], line)
    return joined


def resolve(
    curves: Floats,
    poses: Sequence[str],
    limits: Mapping[frozenset[str], float],
    priority: Sequence[str],
) -> Floats:
    """Lower the pose of less priority where two poses exceed their limit (section 2.2.2).

    Args:
        curves: shape (T, K).
        poses: K names.
        limits: two poses → the largest sum of their weights, `USUAL_LIMIT` for all others.
        priority: lowest first; poses that are not in it neither give way nor make others do so.
    """
    found = curves.copy()
    ranked = [name for name in priority if name in poses]
    # From the highest on, so that what gave way is what others are then compared with.
    for low, high in reversed(list(combinations(ranked, 2))):
        a, b = poses.index(high), poses.index(low)
        over = found[:, a] + found[:, b] - limits.get(frozenset({high, low}), USUAL_LIMIT)
        # The paper's formula, as printed, does not keep the sum within the limit that its text asks
        # for; taking away what is over does.
        given = np.maximum(found[:, b] - over, np.minimum(found[:, b], 0.0))
        found[:, b] = np.where(over > 0, given, found[:, b])
    return found


def limit_speed(times_s: Floats, curves: Floats, speed: float) -> Floats:
    """The largest curves below `curves` that nowhere rise or fall faster (section 2.2.3).

    Args:
        times_s: shape (T,).
        curves: shape (T, K).
        speed: in weights per second.
    """
    ramp = (speed * times_s)[:, None]
    rising = np.minimum.accumulate(curves - ramp, axis=0) + ramp
    both: Floats = np.minimum.accumulate((rising + ramp)[::-1], axis=0)[::-1] - ramp
    return both


@dataclass(frozen=True, eq=False)
class Passes:
    """Weights after each pass, each shape (T, K).

    Attributes:
        times_s: shape (T,).
        stitched: with the pair that each weight comes from.
        smoothed, resolved, limited: after the further passes.
    """

    times_s: Floats
    stitched: Stitched
    smoothed: Floats
    resolved: Floats
    limited: Floats

    def at(self, row: int, column: int) -> list[str]:
        """The passes that changed one weight."""
        steps = (self.stitched.weights, self.smoothed, self.resolved, self.limited)
        values = [float(step[row, column]) for step in steps]
        names = ("smooth", "conflict", "speed")
        return [n for n, (a, b) in zip(names, pairwise(values), strict=True) if abs(a - b) > 1e-6]


def run_passes(
    set_: BigramSet, parts: Segments, times_s: Floats, *, window_s: float, speed: float
) -> Passes:
    """All passes, in the paper's order."""
    stitched = stitch(set_, parts, times_s)
    smoothed = stitched.weights.copy()
    for column in range(smoothed.shape[1]):
        smoothed[:, column] = smooth(times_s, smoothed[:, column], window_s)
    resolved = resolve(smoothed, set_.poses, set_.limits, set_.priority)
    return Passes(times_s, stitched, smoothed, resolved, limit_speed(times_s, resolved, speed))
