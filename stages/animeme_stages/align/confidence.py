"""How sure it is that a recording says its transcript, and where it does not.

Each word and each gap between words is judged by a linear score over a few measures: by how much
rivals beat it (see `animeme_stages.align.acoustic.rivals`), how its phones' fit and length compare
with what is usual for them. A line is as doubtful as its most doubtful places (log-sum-exp of their
scores). Weights, usual values and thresholds are fitted on lines whose transcript was damaged
(``tests/bench/confidence.py``) and kept in ``confidence.json``; docs/alignment.md has the figures.
"""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from importlib.resources import files
from typing import Any

import numpy as np
from numpy.typing import NDArray

from animeme_stages.align.acoustic.hear import Heard

Doubles = NDArray[np.float64]

# Standard scores further out than this are cut: a single broken measure must not decide.
_FURTHEST = 6.0
# Places of a short line: six words, and the gaps around them.
_PLACES = 13
# Frames: a phone this short was squeezed in.
_SQUEEZED = (3, 4)


@dataclass(frozen=True)
class Usual:
    """Mean and standard deviation of a phone's log length, and of its gain per frame."""

    log_length: tuple[float, float]
    gain: tuple[float, float]


@dataclass(frozen=True, eq=False)
class Weights:
    """A linear score of standardised measures: (M,) each."""

    mean: Doubles
    deviation: Doubles
    weight: Doubles
    bias: float

    def __call__(self, measures: Doubles) -> Doubles:
        """Scores of places, (N,), from their measures, (N, M)."""
        standard = np.clip((measures - self.mean) / self.deviation, -_FURTHEST, _FURTHEST)
        result: Doubles = standard @ self.weight + self.bias
        return result


@dataclass(frozen=True, eq=False)
class Calibration:
    """What was fitted for a family of languages.

    Attributes:
        usual: by base phone of the model; -1 for one that was never met.
        words, gaps: the scores.
        share: how much the mean of all words counts.
        thresholds: by language; "" for the others. A line above its own is in doubt.
    """

    usual: Mapping[int, Usual]
    words: Weights
    gaps: Weights
    share: float
    thresholds: Mapping[str, float]

    def threshold(self, language: str) -> float:
        """Score of a line, above which it is in doubt."""
        return self.thresholds.get(language, self.thresholds[""])


@dataclass(frozen=True, eq=False)
class Judgement:
    """How doubtful a line is.

    Attributes:
        words: (W,) score of each word, 0 at the threshold, above if the word is in doubt.
        gaps: (W + 1,) the same of the gap before each word and after the last.
        line: the same of the whole line.
    """

    words: Doubles
    gaps: Doubles
    line: float

    @property
    def confidence(self) -> float:
        """0 to 1; below 0.5 the line is in doubt."""
        return float(1 / (1 + np.exp(np.clip(self.line, -50, 50))))


def judge(heard: Heard, calibration: Calibration, language: str) -> Judgement:
    """Judge a line.

    Args:
        heard: what was found.
        calibration: of the language's family.
        language: primary subtag.
    """
    words, gaps = measures(heard, calibration.usual)
    by_word, by_gap = calibration.words(words), calibration.gaps(gaps)
    threshold = calibration.threshold(language)
    line = pooled(by_word, by_gap, calibration.share) - threshold
    own = threshold + surplus(len(by_word) + len(by_gap))
    return Judgement(by_word - own, by_gap - own, line)


def pooled(words: Doubles, gaps: Doubles, share: float) -> float:
    """Score of a line from those of its places.

    Args:
        words, gaps: their scores.
        share: how much the mean of all words counts beside the worst places.
    """
    both = np.concatenate([words, gaps])
    highest = float(both.max())
    worst = highest + float(np.log(np.exp(both - highest).sum()))
    return worst - surplus(len(both)) + share * float(words.mean())


def surplus(places: int) -> float:
    """By how much the worst of many places is worse than that of a short line, by chance alone."""
    return float(np.log(places / _PLACES))


@cache
def calibration(family: str) -> Calibration:
    """The calibration of a family: "en", or "mapped" for languages whose phones are mapped."""
    text = files("animeme_stages.align").joinpath("confidence.json").read_text(encoding="utf-8")
    return calibration_from(json.loads(text)["families"][family])


def calibration_from(data: Mapping[str, Any]) -> Calibration:
    """A calibration from its JSON form."""
    usual = {
        int(phone): Usual((row[0], row[1]), (row[2], row[3]))
        for phone, row in data["usual"].items()
    }
    return Calibration(
        usual,
        _weights(data["words"]),
        _weights(data["gaps"]),
        float(data["share"]),
        dict(data["thresholds"]),
    )


def _weights(data: Mapping[str, Any]) -> Weights:
    table = np.array(data["measures"], np.float64)
    return Weights(table[:, 0], table[:, 1], table[:, 2], float(data["bias"]))


def measures(heard: Heard, usual: Mapping[int, Usual]) -> tuple[Doubles, Doubles]:
    """Measures of each word (W, 36) and of each gap (W + 1, 18)."""
    own = np.array([_own_measures(word, usual) for word in heard.words])
    fit = np.concatenate([_fits(word, usual) for word in heard.words])
    line = float(np.median(fit))
    found = heard.rivals
    # Columns of `own`: frames, phones, and then the measures themselves.
    frames, phones, rest = own[:, 0], own[:, 1], own[:, 2:]
    without = found.without
    words = np.column_stack(
        [
            _log(without),
            np.clip(without / 30, -3, 3),
            without / frames,
            without / phones / 10,
            _log(found.instead[:, [0, 1, 3, 5]]),
            _log(found.instead_of_two[:, 3]),
            found.instead[:, 3] / frames,
            rest[:, :6],
            rest[:, 2] - line,
            rest[:, 6:],
        ]
    )
    near = [
        [at for at in (word - 1, word + 1) if 0 <= at < len(words)] for word in range(len(words))
    ]
    neighbours = np.array(
        [_worst(words[at], (0, 12, 10), (18,)) if at else np.zeros(4) for at in near]
    )
    sides = _log(np.column_stack([found.between[:-1, 1], found.between[1:, 1]]))
    all_words = np.column_stack(
        [words, neighbours, np.full(len(words), line), sides, _linear(found.instead[:, 1:4])]
    )
    gaps = np.column_stack(
        [
            _log(found.between),
            np.log1p(heard.pauses),
            np.arange(len(words) + 1) == 0,
            np.arange(len(words) + 1) == len(words),
            [
                words[[at for at in (gap - 1, gap) if 0 <= at < len(words)]][:, _BESIDE].max(axis=0)
                for gap in range(len(words) + 1)
            ],
            np.full(len(words) + 1, line),
            _linear(found.between[:, 1:4]),
        ]
    )
    return all_words, gaps


# Measures of the words beside a gap that count for it.
_BESIDE = [10, 12, 19, 0, 6]


def _worst(rows: Doubles, highest: Sequence[int], lowest: Sequence[int]) -> Doubles:
    """The worst of several words' measures."""
    a, b, c = (rows[:, column].max() for column in highest)
    (d,) = (rows[:, column].min() for column in lowest)
    return np.array([a, b, d, c])


def _own_measures(word: Any, usual: Mapping[int, Usual]) -> list[float]:
    length = np.array([phone.length for phone in word.phones], np.float64)
    gain = -np.array([phone.gain for phone in word.phones])
    expected = [usual.get(phone.phone, usual[-1]) for phone in word.phones]
    longer = (np.log(length) - [u.log_length[0] for u in expected]) / [
        u.log_length[1] for u in expected
    ]
    fit = (gain / length - [u.gain[0] for u in expected]) / [u.gain[1] for u in expected]
    frames, count = length.sum(), len(length)
    return [
        frames,
        count,
        gain.sum() / frames,
        _log(gain.sum()),
        fit.mean(),
        fit.max(),
        fit.sum() / np.sqrt(count),
        (fit * length).sum() / frames,
        longer.mean(),
        longer.min(),
        longer.max(),
        longer.sum() / np.sqrt(count),
        *(np.mean(length <= shortest) for shortest in _SQUEEZED),
        np.log(frames),
        np.log(count),
        np.log(frames / count),
    ]


def _fits(word: Any, usual: Mapping[int, Usual]) -> Doubles:
    rows = [(usual.get(p.phone, usual[-1]).gain, -p.gain / p.length) for p in word.phones]
    return np.array([(value - mean) / deviation for (mean, deviation), value in rows])


def _linear(nats: Doubles) -> Doubles:
    """Nats on a linear scale with ends."""
    result: Doubles = np.clip(nats / 30, -3, 6)
    return result


def _log(nats: Any) -> Any:
    """Nats on a scale that is linear near 0 and logarithmic far from it."""
    return np.sign(nats) * np.log1p(np.abs(nats) / 10)
