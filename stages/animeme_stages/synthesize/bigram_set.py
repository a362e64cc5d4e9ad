"""Curves for pairs of phones, and how a pair that is not there is made up.

Xu, Feng, Marsella & Shapiro, "A practical and configurable lip sync method for games" ("the 2013
paper").
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import lru_cache
from typing import Any

import numpy as np
from scipy.interpolate import BSpline

from animeme.curves import Floats
from animeme.phones import SILENCE
from animeme_stages.synthesize.articulation import nearest

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

_CLASS_OF = {symbol: name for name, symbols in COMMON.items() for symbol in symbols}
# Samples of a curve over its pair: finer than a frame in a pair of half a second.
SAMPLES = 33
LOCAL = np.linspace(0.0, 1.0, SAMPLES)


@lru_cache(maxsize=1024)
def common_phone(symbol: str) -> str:
    """The common phone of a plain IPA symbol: its own, or that of the nearest in the table."""
    return PAUSE if symbol == SILENCE else _CLASS_OF[nearest(symbol, _CLASS_OF)]


def spline(times: Sequence[float], weights: Sequence[float]) -> Floats:
    """The B-spline whose control polygon these points are, at `LOCAL`; shape (SAMPLES,).

    "A piecewise linear curve is the control curve for a smooth B-spline curve" (2013 paper, section
    2.1.2): cubic, clamped at both ends, in time and weight.
    """
    degree = min(3, len(times) - 1)
    inner = np.linspace(0.0, 1.0, len(times) - degree + 1)
    knots = np.concatenate([np.zeros(degree), inner, np.ones(degree)])
    curve = BSpline(knots, np.stack([times, weights], axis=1), degree)(np.linspace(0, 1, 129))
    along = np.maximum.accumulate(curve[:, 0])
    found: Floats = np.interp(LOCAL, along, curve[:, 1])
    return found


@dataclass(frozen=True)
class BigramSet:
    """Polygons of pairs of common phones.

    Attributes:
        polygons: "first|second" → control → [(local time over both phones, weight), …]; "first|*"
            and "*|second" stand in for pairs that are not there.
        controls: N names.
    """

    polygons: Mapping[str, Mapping[str, Sequence[tuple[float, float]]]]
    controls: tuple[str, ...]
    _tables: dict[str, Floats] = field(default_factory=dict, compare=False)

    def source(self, first: str, second: str) -> str:
        """The entry that moves a pair: its own, or what it is made up from."""
        pair = f"{first}|{second}"
        if pair in self.polygons:
            return pair
        halves = [name for name in (f"{first}|{ANY}", f"{ANY}|{second}") if name in self.polygons]
        return "+".join(halves) or f"{ANY}|{ANY}"

    def table(self, first: str, second: str) -> Floats:
        """The curves of a pair at `LOCAL`, shape (SAMPLES, N)."""
        source = self.source(first, second)
        if source not in self._tables:
            names = source.split("+")
            if len(names) == 2:  # the first phone's half, then the second's
                share = np.clip((LOCAL - 0.25) / 0.5, 0.0, 1.0)[:, None]
                made = (1 - share) * self._curves(names[0]) + share * self._curves(names[1])
            else:
                made = self._curves(source)
            self._tables[source] = made
        return self._tables[source]

    def _curves(self, name: str) -> Floats:
        found = np.zeros((SAMPLES, len(self.controls)))
        for control, points in self.polygons.get(name, {}).items():
            times, weights = zip(*points, strict=True)
            found[:, self.controls.index(control)] = spline(times, weights)
        return found

    def to_json(self) -> dict[str, Any]:
        """As model documents have it."""
        return {
            pair: {control: [list(p) for p in points] for control, points in curves.items()}
            for pair, curves in self.polygons.items()
        }

    @classmethod
    def from_json(cls, entry: Mapping[str, Any], controls: tuple[str, ...]) -> BigramSet:
        """Read what `to_json` wrote.

        Raises:
            ValueError: a polygon makes no sense; says which.
        """
        polygons: dict[str, dict[str, list[tuple[float, float]]]] = {}
        for pair, curves in entry.items():
            if pair.count("|") != 1:
                raise ValueError(f"'{pair}' is not a pair of phones")
            polygons[pair] = {}
            for control, points in curves.items():
                array = np.array(points, dtype=np.float64)
                right = array.ndim == 2 and array.shape[1:] == (2,) and len(array) >= 2
                if control not in controls or not right or not np.isfinite(array).all():
                    raise ValueError(f"the curve of '{control}' in '{pair}' makes no sense")
                if (np.diff(array[:, 0]) < 0).any():
                    raise ValueError(f"times of '{control}' in '{pair}' go back")
                polygons[pair][control] = [(float(t), float(w)) for t, w in points]
        return cls(polygons, controls)
