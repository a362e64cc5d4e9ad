"""How well models follow captured motion they were not fitted to."""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from animeme.contracts import Model
from animeme.curves import CurveSet, Floats
from animeme.dataset import CapturedLine, Dataset

# A bilabial's closure may be this much early or late of its phone.
SLACK_S = 0.04
BILABIALS = ("p", "b", "m")
RATE_HZ = 60.0
# Closures are looked for this often within a curve.
_STEP_S = 0.004


@dataclass(frozen=True)
class Closure:
    """When a mouth counts as closed.

    Attributes:
        control: measures the opening.
        at_most: largest value of a closed mouth.
    """

    control: str = "lip_gap"
    at_most: float = 0.02


@dataclass(frozen=True)
class Score:
    """How well one model did.

    Attributes:
        rmse: root of the mean squared error of each control, over all captured frames; None where
            the model lacks the control or it was not captured.
        closure_recall: part of the /p b m/ whose smallest opening from 40 ms before to 40 ms after
            them is at most that of `Closure`; None where there are none, or no such control.
        train_s: time that fitting took, None for a model that was given.
        synthesis_us_per_phone: microseconds per phone, for all controls together.
    """

    rmse: dict[str, float | None]
    closure_recall: float | None
    train_s: float | None
    synthesis_us_per_phone: float

    def to_json(self) -> dict[str, Any]:
        """As `animeme evaluate --json` prints it."""
        return {
            "rmse": self.rmse,
            "closure_recall": self.closure_recall,
            "train_s": self.train_s,
            "synthesis_us_per_phone": self.synthesis_us_per_phone,
        }


def judge(
    model: Model, dataset: Dataset, closure: Closure | None = None, train_s: float | None = None
) -> tuple[Score, list[CurveSet]]:
    """Compare a model's curves with captured ones.

    Args:
        model: fitted.
        dataset: lines that it was not fitted to.
        closure: what counts as closed; `Closure()` if None.
        train_s: passed on.

    Returns:
        The score, and the curves of each line.
    """
    closure = closure or Closure()
    started = time.perf_counter()
    curves = [model.synthesize(line.track, rate_hz=RATE_HZ) for line in dataset.lines]
    took_s = time.perf_counter() - started
    phones = sum(len(line.track.phones) for line in dataset.lines)
    errors = np.concatenate(
        [_error(c, line, dataset.controls) for c, line in zip(curves, dataset.lines, strict=True)]
    )
    score = Score(
        {name: _rms(errors[:, i]) for i, name in enumerate(dataset.controls)},
        _recall(curves, dataset, closure),
        train_s,
        1e6 * took_s / max(phones, 1),
    )
    return score, curves


def captured_recall(dataset: Dataset, closure: Closure | None = None) -> float | None:
    """The speaker's own closure recall."""
    closure = closure or Closure()
    if closure.control not in dataset.controls:
        return None
    column = dataset.controls.index(closure.control)
    curves, lines = [], []
    for line in dataset.lines:
        known = np.isfinite(line.values[:, column])
        if known.sum() >= 2:
            values = line.values[known, column][:, None]
            curves.append(CurveSet(line.times_s[known], (closure.control,), values))
            lines.append(line)
    return _recall(curves, dataset.subset(lines), closure)


def _error(curves: CurveSet, line: CapturedLine, controls: Sequence[str]) -> Floats:
    """Model minus capture at every captured frame, NaN where one is missing; (F, N)."""
    sampled = curves.sample(line.times_s)
    found = np.full(line.values.shape, np.nan)
    for column, name in enumerate(controls):
        if name in curves.names:
            found[:, column] = sampled[:, curves.names.index(name)] - line.values[:, column]
    return found


def _rms(errors: Floats) -> float | None:
    known = errors[np.isfinite(errors)]
    return float(np.sqrt(np.mean(known**2))) if len(known) else None


def _recall(curves: Sequence[CurveSet], dataset: Dataset, closure: Closure) -> float | None:
    closed = count = 0
    for curve, line in zip(curves, dataset.lines, strict=True):
        if closure.control not in curve.names:
            return None
        values = curve.curve(closure.control)
        for symbol, phone in zip(line.track.ipa(), line.track.phones, strict=True):
            if symbol in BILABIALS:
                first_s, last_s = phone.start_s - SLACK_S, phone.end_s + SLACK_S
                at_s = np.append(np.arange(first_s, last_s, _STEP_S), last_s)
                count += 1
                closed += bool(np.interp(at_s, curve.times_s, values).min() <= closure.at_most)
    return closed / count if count else None
