"""Curves for pairs of phones, and how a pair that is not there is made up.

Xu, Feng, Marsella & Shapiro, "A practical and configurable lip sync method for games" ("the 2013
paper").
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import numpy as np
import scipy  # its parts load when they are first used

from animeme.curves import Floats
from animeme.phones import SILENCE
from animeme_stages.synthesize.articulation import distance, nearest

# Table 1 of the 2013 paper, in IPA: common phone → the phones it stands for.
COMMON: dict[str, tuple[str, ...]] = {
    "ah": ("æ", "ʌ", "ə", "ɐ"),
    "aa": ("ɑ", "a"),
    "ao": ("ɔ", "ɒ"),
    "eh": ("eɪ", "ɛ", "e"),
    "er": ("ɝ", "ɚ", "ɜ"),
    "ih": ("ɪ", "i"),
    "w": ("w", "u", "ʊ"),
    "ow": ("oʊ", "o"),
    "aw": ("aʊ",),
    "oy": ("ɔɪ",),
    "ay": ("aɪ",),
    "h": ("h",),
    "r": ("ɹ", "r"),
    "l": ("l",),
    "z": ("s", "z"),
    "sh": ("ʃ", "tʃ", "dʒ", "ʒ", "j"),
    "th": ("θ", "ð"),
    "f": ("f", "v"),
    "d": ("d", "t", "n", "ŋ"),
    "kg": ("k", "ɡ"),
    "bmp": ("p", "b", "m"),
}
PAUSE = "_"
"""The class of a pause, as the published sets call it."""
ANY = "*"
"""In a pair: whatever comes before or after."""
# What a pause is compared with: /h/ has no shape of its own and takes its neighbours'.
_LIKE_A_PAUSE = "h"

# Samples of a curve over its pair: finer than a frame in a pair of half a second.
SAMPLES = 33
LOCAL = np.linspace(0.0, 1.0, SAMPLES)

Polygon = Sequence[tuple[float, float]]
"""Keys of a control polygon: (local time over both phones, weight)."""


def spline(times: Sequence[float], weights: Sequence[float]) -> Floats:
    """The B-spline whose control polygon these points are, at `LOCAL`; shape (SAMPLES,).

    "A piecewise linear curve is the control curve for a smooth B-spline curve" (2013 paper, section
    2.1.2): cubic, clamped at both ends, in time and weight; it keeps its ends beyond them.
    """
    degree = min(3, len(times) - 1)
    inner = np.linspace(0.0, 1.0, len(times) - degree + 1)
    knots = np.concatenate([np.zeros(degree), inner, np.ones(degree)])
    curve = scipy.interpolate.BSpline(knots, np.stack([times, weights], axis=1), degree)(
        np.linspace(0, 1, 129)
    )
    along = np.maximum.accumulate(curve[:, 0])
    found: Floats = np.interp(LOCAL, along, curve[:, 1])
    return found


@dataclass(frozen=True)
class BigramSet:
    """Polygons of pairs of classes of phones.

    Attributes:
        polygons: "first|second" → pose → its polygon; "first|*" and "*|second" stand in for pairs
            that are not there.
        poses: K names.
        classes: class → the phones in it, in plain IPA; pauses are `PAUSE`.
        limits: two poses → the largest sum of their weights (C of the paper, section 2.2.2).
        priority: poses of which the earlier gives way, lowest first; others never do.
    """

    polygons: Mapping[str, Mapping[str, Polygon]]
    poses: tuple[str, ...]
    classes: Mapping[str, tuple[str, ...]] = field(default_factory=lambda: COMMON)
    limits: Mapping[frozenset[str], float] = field(default_factory=dict)
    priority: tuple[str, ...] = ()
    _tables: dict[str, Floats] = field(default_factory=dict, compare=False)
    _sources: dict[str, str] = field(default_factory=dict, compare=False)
    _known: dict[str, str] = field(default_factory=dict, compare=False)
    _apart: dict[tuple[str, str], float] = field(default_factory=dict, compare=False)

    @cached_property
    def _class_of(self) -> dict[str, str]:
        return {symbol: name for name, symbols in self.classes.items() for symbol in symbols}

    def has(self, symbol: str) -> bool:
        """Whether one of the classes names this plain IPA symbol."""
        return symbol == SILENCE or symbol in self._class_of

    def class_of(self, symbol: str) -> str:
        """The class of a plain IPA symbol: its own, or that of the nearest in the table."""
        if symbol == SILENCE:
            return PAUSE
        if symbol not in self._known:
            self._known[symbol] = self._class_of[nearest(symbol, self._class_of)]
        return self._known[symbol]

    def source(self, first: str, second: str) -> str:
        """The entry that moves a pair: its own, or what it is made up from; "" for nothing."""
        pair = f"{first}|{second}"
        if pair in self.polygons:
            return pair
        if pair not in self._sources:
            self._sources[pair] = self._made_from(first, second)
        return self._sources[pair]

    def _made_from(self, first: str, second: str) -> str:
        halves = [name for name in (f"{first}|{ANY}", f"{ANY}|{second}") if name in self.polygons]
        if halves:
            return "+".join(halves)
        if f"{ANY}|{ANY}" in self.polygons:
            return f"{ANY}|{ANY}"
        if first == second == PAUSE:
            return ""
        pauses = (first == PAUSE, second == PAUSE)
        alike = [p for p in self._pairs if (p[0] == PAUSE, p[1] == PAUSE) == pauses]
        # Where the set has no pauses at all: from or to rest, as if from or to /h/.
        chosen = alike or [p for p in self._pairs if PAUSE not in p]
        if not chosen:
            return ""
        best = min(chosen, key=lambda p: (self._far(first, p[0]) + self._far(second, p[1]), p))
        return "|".join(best)

    @cached_property
    def _pairs(self) -> list[tuple[str, str]]:
        found = (pair.partition("|") for pair in self.polygons if ANY not in pair)
        return [(first, second) for first, _, second in found]

    def _far(self, one: str, other: str) -> float:
        """How different two classes look: the least distance between phones of theirs."""
        if one == other:
            return 0.0
        if (one, other) not in self._apart:
            pairs = ((a, b) for a in self._symbols(one) for b in self._symbols(other))
            # Even a class that is split off looks a little different from what is left.
            self._apart[one, other] = 0.01 + min((distance(a, b) for a, b in pairs), default=100.0)
        return self._apart[one, other]

    def _symbols(self, name: str) -> tuple[str, ...]:
        return (_LIKE_A_PAUSE,) if name == PAUSE else self.classes.get(name, ())

    def table(self, first: str, second: str) -> Floats:
        """The curves of a pair at `LOCAL`, shape (SAMPLES, K)."""
        pair = f"{first}|{second}"
        if pair not in self._tables:
            names = self.source(first, second).split("+")
            if len(names) == 2:  # the first phone's half, then the second's
                share = np.clip((LOCAL - 0.25) / 0.5, 0.0, 1.0)[:, None]
                made = (1 - share) * self._curves(names[0]) + share * self._curves(names[1])
            else:
                made = self._curves(names[0]) * _rest(pair, names[0])[:, None]
            self._tables[pair] = made
        return self._tables[pair]

    def _curves(self, name: str) -> Floats:
        found = np.zeros((SAMPLES, len(self.poses)))
        for pose, points in self.polygons.get(name, {}).items():
            times, weights = zip(*points, strict=True)
            found[:, self.poses.index(pose)] = spline(times, weights)
        return found

    def to_json(self) -> dict[str, Any]:
        """As model documents of fitted sets have it."""
        return {
            pair: {pose: [list(p) for p in points] for pose, points in curves.items()}
            for pair, curves in self.polygons.items()
        }

    @classmethod
    def from_json(cls, entry: Mapping[str, Any], poses: tuple[str, ...]) -> BigramSet:
        """Read what `to_json` wrote.

        Raises:
            ValueError: a polygon makes no sense; says which.
        """
        polygons = {
            pair: {pose: polygon(pose, pair, points, poses) for pose, points in curves.items()}
            for pair, curves in entry.items()
        }
        for pair in polygons:
            if pair.count("|") != 1 or not all(pair.split("|")):
                raise ValueError(f"'{pair}' is not a pair of phones")
        return cls(polygons, poses)


def polygon(pose: str, pair: str, points: Any, poses: Sequence[str]) -> list[tuple[float, float]]:
    """The keys of a pose in a pair.

    Raises:
        ValueError: they make no sense; says where.
    """
    array = np.array(points, dtype=np.float64)
    right = array.ndim == 2 and array.shape[1:] == (2,) and len(array) >= 2
    if pose not in poses or not right or not np.isfinite(array).all():
        raise ValueError(f"the curve of '{pose}' in '{pair}' makes no sense")
    if (np.diff(array[:, 0]) < 0).any() or array[0, 0] < 0 or array[-1, 0] > 1:
        raise ValueError(f"times of '{pose}' in '{pair}' go back, or leave the range 0 to 1")
    return [(float(t), float(w)) for t, w in array.tolist()]


def _rest(pair: str, source: str) -> Floats:
    """What is left of a pair that is made from one without its pause: it starts or ends at rest."""
    left = np.ones(SAMPLES)
    if source:
        (first, _, second), (like, _, then) = pair.partition("|"), source.partition("|")
        if first == PAUSE != like:
            left *= np.clip(2 * LOCAL, 0.0, 1.0)
        if second == PAUSE != then:
            left *= np.clip(2 - 2 * LOCAL, 0.0, 1.0)
    return left
