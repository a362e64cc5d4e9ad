"""How sure it is that a recording says its transcript, and where it does not.

Each word and each gap between words is judged by a linear score over a few measures: by how much
rivals beat it (see `animeme_stages.align.acoustic.rivals`), how its phones' fit and length compare
with what is usual for them. A line is as doubtful as its most doubtful places (log-sum-exp of their
scores). Weights, usual values and thresholds are fitted on lines whose transcript was damaged
(``tests/bench/train_confidence.py``) and kept in ``confidence.json``; docs/alignment.md has the
figures.
"""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cache
from importlib.resources import files
from typing import Any

import numpy as np
from numpy.typing import NDArray

from animeme_stages.align.acoustic.hear import Heard, HeardWord
from animeme_stages.align.acoustic.rivals import PRICES

Doubles = NDArray[np.float64]
Table = dict[str, Doubles]
"""Measures by name, one value per place each."""

NEVER_MET = -1
"""Stands for a phone of which nothing is known."""

# A phone that was met less often than this many times is led towards what is known of all.
SHRINKAGE = 20.0

# Standard scores further out than this are cut: a single broken measure must not decide.
FURTHEST = 6.0
# Places of a short line: six words, and the gaps around them.
_PLACES = 13
# Frames: a phone this short was squeezed in.
_SQUEEZED = (3, 4)


@dataclass(frozen=True)
class Usual:
    """Mean and standard deviation of a phone's log length in frames, and of its loss.

    Its loss are the nats per frame by which the best path over any phones beats it.
    """

    log_length: tuple[float, float]
    loss: tuple[float, float]


@dataclass(frozen=True, eq=False)
class Weights:
    """A linear score of standardised measures.

    Attributes:
        rows: name of each measure → its mean, its standard deviation and its weight.
        bias: the score where every measure is at its mean.
    """

    rows: Mapping[str, tuple[float, float, float]]
    bias: float

    def __call__(self, measures: Table) -> Doubles:
        """Scores of N places, (N,)."""
        total = np.full(len(next(iter(measures.values()))), self.bias)
        for name, (mean, deviation, weight) in self.rows.items():
            standard = np.clip((measures[name] - mean) / deviation, -FURTHEST, FURTHEST)
            total += weight * standard
        return total


@dataclass(frozen=True, eq=False)
class Calibration:
    """What was fitted for a family of languages.

    Attributes:
        usual: by base phone of the model; `NEVER_MET` for the others.
        words, gaps: the scores.
        share: how much the mean of all words counts.
        thresholds: by language; "" for the others. A line above its own is in doubt. Of a voice,
            "" alone: how far that is above the median of the voice's own right lines.
    """

    usual: Mapping[int, Usual]
    words: Weights
    gaps: Weights
    share: float
    thresholds: Mapping[str, float]

    def threshold(self, language: str) -> float:
        """Score of a line, above which it is in doubt."""
        return self.thresholds.get(language, self.thresholds[""])

    def score(self, heard: Heard) -> float:
        """How doubtful a line is, on no scale but its own."""
        words, gaps = measures(heard, self.usual)
        return pooled(self.words(words), self.gaps(gaps), self.share)

    def of_voice(self, right: Sequence[Heard]) -> Calibration:
        """The calibration of one voice, made of that of voices in general.

        Args:
            right: lines of that voice that say their transcripts, none of them learned from.
        """
        own = replace(self, usual=usual_values(right, self.usual))
        median = float(np.median([own.score(heard) for heard in right]))
        return self.fitted(own.usual, round(median + self.thresholds[""], 4))

    def fitted(self, usual: Mapping[int, Usual], threshold: float) -> Calibration:
        """The same weights, with what one voice has of its own."""
        return replace(self, usual=usual, thresholds={"": threshold})


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


def usual_values(
    lines: Sequence[Heard], known: Mapping[int, Usual] | None = None
) -> dict[int, Usual]:
    """What is usual for each phone.

    Args:
        lines: they say their transcripts.
        known: what is usual in general; None for the mean over all phones of `lines`.
    """
    met: dict[int, list[tuple[float, float]]] = {}
    for heard in lines:
        for word in heard.words:
            for phone in word.phones:
                row = (float(np.log(phone.length)), -phone.gain / phone.length)
                met.setdefault(phone.phone, []).append(row)
    everyone = np.array([row for rows in met.values() for row in rows])
    all_alike = _usual(everyone.mean(axis=0), everyone.var(axis=0))
    usual = {**(known or {}), NEVER_MET: all_alike}
    for base, rows in sorted(met.items()):
        prior = usual.get(base, all_alike)
        mean, deviation = np.array([prior.log_length, prior.loss]).T
        own = np.array(rows)
        count = len(own) + SHRINKAGE
        middle = (own.sum(axis=0) + SHRINKAGE * mean) / count
        variance = (((own - middle) ** 2).sum(axis=0) + SHRINKAGE * deviation**2) / count
        usual[base] = _usual(middle, variance)
    return usual


def _usual(mean: Doubles, variance: Doubles) -> Usual:
    deviation = np.sqrt(variance)
    return Usual(
        (round(float(mean[0]), 4), round(float(deviation[0]), 4)),
        (round(float(mean[1]), 4), round(float(deviation[1]), 4)),
    )


@cache
def calibration(family: str) -> Calibration:
    """The calibration of a family: "en", or "mapped" for languages whose phones are mapped.

    "en-voice" and "mapped-voice" are for recordings whose voice was learned.
    """
    return calibration_from(json.loads(calibration_text(family)))


@cache
def calibration_text(family: str) -> str:
    """The calibration of a family as JSON text, always the same."""
    text = files("animeme_stages.align").joinpath("confidence.json").read_text(encoding="utf-8")
    return json.dumps(json.loads(text)["families"][family], sort_keys=True)


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
    rows = {name: (row[0], row[1], row[2]) for name, row in data["measures"].items()}
    return Weights(rows, float(data["bias"]))


def measures(heard: Heard, usual: Mapping[int, Usual]) -> tuple[Table, Table]:
    """Measures of each word and of each gap, by name: W and W + 1 values each.

    Nats are better the lower; lengths and fits are standard scores of the phones' own usual ones,
    a fit the worse the higher.
    """
    found = heard.rivals
    own = _columns([_own_measures(word, usual) for word in heard.words])
    fits = np.concatenate([_fit(word, usual) for word in heard.words])
    line = np.full(len(heard.words), np.median(fits))
    frames, phones = np.exp(own["log_frames"]), np.exp(own["log_phones"])
    words: Table = {
        "without": _log(found.without),
        "without_linear": _linear(found.without),
        "without_per_frame": found.without / frames,
        "without_per_phone": found.without / phones / 10,
        **{f"instead_{PRICES[at]}": _log(found.instead[:, at]) for at in (0, 1, 3, 5)},
        **{f"instead_{PRICES[at]}_linear": _linear(found.instead[:, at]) for at in (1, 2, 3)},
        "instead_per_frame": found.instead[:, 3] / frames,
        "instead_of_two": _log(found.instead_of_two[:, 3]),
        **own,
        "fit_less_line": own["fit_mean"] - line,
    }
    near = [[at for at in (word - 1, word + 1) if 0 <= at < len(line)] for word in range(len(line))]
    words |= {
        "near_without": _worst(words["without"], near),
        "near_fit": _worst(words["fit_mean"], near),
        "near_loss": _worst(words["loss_per_frame"], near),
        "near_shortness": _worst(-words["length_least"], near),
        "line_fit": line,
        "gap_before": _log(found.between[:-1, 1]),
        "gap_after": _log(found.between[1:, 1]),
    }
    gap_count = len(line) + 1
    place = np.arange(gap_count)
    beside = [[at for at in (gap - 1, gap) if 0 <= at < len(line)] for gap in range(gap_count)]
    gaps: Table = {
        **{f"between_{price}": _log(found.between[:, at]) for at, price in enumerate(PRICES)},
        **{f"between_{PRICES[at]}_linear": _linear(found.between[:, at]) for at in (1, 2, 3)},
        "pause": np.log1p(heard.pauses),
        "at_start": (place == 0).astype(np.float64),
        "at_end": (place == len(line)).astype(np.float64),
        **{f"beside_{name}": _worst(words[name], beside) for name in _BESIDE},
        "line_fit": np.append(line, line[-1]),
    }
    return words, gaps


# Measures of the words beside a gap that count for it.
_BESIDE = ("loss_per_frame", "fit_mean", "length_most", "without", "instead_2.0")


def _own_measures(word: HeardWord, usual: Mapping[int, Usual]) -> dict[str, float]:
    """Measures of one word by itself."""
    length = np.array([phone.length for phone in word.phones], np.float64)
    loss = -sum(phone.gain for phone in word.phones)
    expected = [usual.get(phone.phone, usual[NEVER_MET]).log_length for phone in word.phones]
    mean, deviation = np.array(expected).T
    longer = (np.log(length) - mean) / deviation
    fit = _fit(word, usual)
    frames, phones = length.sum(), len(length)
    return {
        "loss_per_frame": loss / frames,
        "loss": float(_log(loss)),
        "fit_mean": fit.mean(),
        "fit_worst": fit.max(),
        "fit_sum": fit.sum() / np.sqrt(phones),
        "fit_by_frame": (fit * length).sum() / frames,
        "length_mean": longer.mean(),
        "length_least": longer.min(),
        "length_most": longer.max(),
        "length_sum": longer.sum() / np.sqrt(phones),
        **{f"squeezed_{shortest}": np.mean(length <= shortest) for shortest in _SQUEEZED},
        "log_frames": np.log(frames),
        "log_phones": np.log(phones),
        "log_pace": np.log(frames / phones),
    }


def _fit(word: HeardWord, usual: Mapping[int, Usual]) -> Doubles:
    """How much worse than usual each phone fits, in standard deviations."""
    expected = [usual.get(phone.phone, usual[NEVER_MET]).loss for phone in word.phones]
    mean, deviation = np.array(expected).T
    loss = np.array([-phone.gain / phone.length for phone in word.phones])
    result: Doubles = (loss - mean) / deviation
    return result


def _columns(rows: Sequence[Mapping[str, float]]) -> Table:
    return {name: np.array([row[name] for row in rows], np.float64) for name in rows[0]}


def _worst(values: Doubles, at: Sequence[Sequence[int]]) -> Doubles:
    """The highest of the values at each of several sets of places, 0 for an empty one."""
    return np.array([max((float(values[i]) for i in each), default=0.0) for each in at])


def _linear(nats: Doubles) -> Doubles:
    """Nats on a linear scale with ends."""
    result: Doubles = np.clip(nats / 30, -3, 6)
    return result


def _log(nats: Any) -> Any:
    """Nats on a scale that is linear near 0 and logarithmic far from it."""
    return np.sign(nats) * np.log1p(np.abs(nats) / 10)
