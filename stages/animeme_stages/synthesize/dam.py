"""The dominated animeme model of 2012.

Chen, Huang, Guan & Chen, "Animating Lip-Sync Characters with Dominated Animeme Models" ("the 2012
paper"): C(t) = Σ_j D_j(t_j) A_j(t_j), with several *modes* per phone. Beyond the paper: variable
projection, dominances in seconds, and modes that trees choose by context (see `trees`).
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import cache
from importlib import resources
from typing import Any, ClassVar, Literal, Self

import numpy as np

from animeme.curves import Floats
from animeme.dataset import Dataset, Listener
from animeme.phones import PhoneTrack
from animeme_stages.synthesize.animemes import BEYOND, Animemes, learn_animemes
from animeme_stages.synthesize.context import Question, Questionnaire, possible_questions
from animeme_stages.synthesize.dominance import Dominance2012
from animeme_stages.synthesize.fitted import FittedModel, frames_of, spreads
from animeme_stages.synthesize.fitting import weights_of
from animeme_stages.synthesize.modes import Modes, find_modes
from animeme_stages.synthesize.numbers import rounded
from animeme_stages.synthesize.spoken import Ints, Spoken, legendre, spoken
from animeme_stages.synthesize.trees import Forest, Growth, grow
from animeme_stages.synthesize.trends import Trends, learn_trends

# Leaves are multiples of this part of their control's spread: documents stay below 1 MB, and the
# sum of hundreds of them is off by less than a hundredth of the spread.
LEAF_STEP = 5e-4
# The part of trends in the mean of both, and the penalty on their squares, in frames.
TREND_SHARE = 0.4
TREND_RIDGE = 30.0


@dataclass(frozen=True)
class DamOptions:
    """Options of `Dam`; docs/models.md has what each was measured to do."""

    modes: Literal["context", "affinity", "none"] = "context"
    degree: int = field(default=4, metadata={"low": 0, "high": 8})
    normalise: bool = True
    spread: Literal["seconds", "lengths"] = "seconds"
    sigma: float = field(default=0.06, metadata={"low": 0.01, "high": 3})
    method: Literal["projection", "em"] = "projection"
    hold_s: float = field(default=0.8, metadata={"low": 0.1, "high": 10})
    ridge: float = field(default=0.1, metadata={"low": 0, "high": 1e6})
    rounds: int = field(default=400, metadata={"low": 0, "high": 2000})
    depth: int = field(default=4, metadata={"low": 1, "high": 8})
    rate: float = field(default=0.08, metadata={"low": 0.001, "high": 1})
    leaf: int = field(default=15, metadata={"low": 1, "high": 10000})
    leaf_ridge: float = field(default=3.0, metadata={"low": 0, "high": 1e6})
    preference: float = field(default=1.0, metadata={"low": 0.1, "high": 1000})
    context_weight: float = field(default=1000.0, metadata={"low": 0, "high": 1e9})
    smooth_weight: float = field(default=1.0, metadata={"low": 0, "high": 1e9})
    contacts: bool = True


class Dam(FittedModel):
    """Dominated animeme model with modes by context, by affinity propagation, or one per phone.

    With ``modes="context"`` all controls share fixed dominances, and trees find the animemes; else
    every control learns its own σ per mode.

    Attributes:
        animemes_: one unit per phone, or per mode.
        modes_: of "affinity".
        questions_: of "context": what the trees ask.
        forest_: of "context".
        trends_: of "context".
    """

    name: ClassVar[str] = "dam"
    Options = DamOptions
    options: DamOptions

    def __init__(self, options: DamOptions | None = None) -> None:
        """See `FittedModel`."""
        super().__init__(options)
        self.animemes_ = self._empty(0)
        self.modes_ = Modes((), (), np.zeros((0, 1)), ())
        self.questions_ = Questionnaire((), ())
        self.forest_ = Forest(np.zeros((0, 1), np.int64), np.zeros((0, 2, 1, 0)))
        self.trends_ = Trends.none()

    @classmethod
    @cache
    def default(cls) -> Self:
        """The model as shipped: ARKit controls, one English speaker (see its `credits_`)."""
        path = resources.files("animeme_stages.synthesize") / "dam_grid.json"
        return cls.from_document(json.loads(path.read_text(encoding="utf-8")))

    def _empty(self, units: int) -> Animemes:
        return Animemes.empty(Dominance2012(), self.options, units, len(self.controls_))

    def _learn(self, dataset: Dataset, listener: Listener) -> None:
        options = self.options
        phones = spoken([line.track for line in dataset.lines])
        times_s, values = frames_of(dataset, phones.offset_s)
        if options.modes == "affinity":
            listener("modes", 0.0)
            self.modes_, unit = find_modes(phones, times_s, values, options.preference)
        else:
            unit = self.rows(phones.symbols)
        units = len(self.modes_.units) or len(self.seen_)
        fixed = options.modes == "context"
        self.animemes_ = learn_animemes(
            self._empty(units), phones, unit, times_s, values, degree=options.degree,
            ridge=options.ridge, method=None if fixed else options.method,
            told=lambda part: listener("dominances", part),
        )  # fmt: skip
        if fixed:
            self._grow(phones, unit, times_s, values, listener)
        if options.modes == "affinity":
            self.modes_ = self.modes_.with_shapes(self.animemes_.coefficients, spreads(values))

    def _grow(
        self, phones: Spoken, unit: Ints, times_s: Floats, values: Floats, listener: Listener
    ) -> None:
        """Let trees and trends find what the phones' own animemes leave, each on its own."""
        options, animemes = self.options, self.animemes_
        pairs = animemes.pairs(phones, unit, times_s)
        d, _ = animemes.dominance.value(pairs, animemes.sigma[0][unit[pairs.phone]])
        weight, _ = weights_of(d, pairs, normalise=animemes.normalise)
        questions = Questionnaire(possible_questions(phones), tuple(self.seen_))
        spread = spreads(values)
        left = np.nan_to_num((values - animemes.move(phones, unit, times_s)) / spread, nan=0.0)
        basis = legendre(pairs.local, options.degree, BEYOND)
        trends = learn_trends(
            pairs, weight, basis, phones, unit, len(self.seen_), left, TREND_RIDGE
        )
        growth = Growth(
            options.rounds, options.depth, options.rate, options.leaf, options.leaf_ridge
        )
        forest = grow(
            pairs, weight, basis, questions.answers(phones), left, growth,
            lambda part: listener("trees", part),
        )  # fmt: skip
        used, number = np.unique(forest.asked, return_inverse=True)
        asked = number.reshape(forest.asked.shape) - (1 if len(used) and used[0] < 0 else 0)
        kept = [questions.questions[i] for i in used if i >= 0]
        self.questions_ = Questionnaire(kept, tuple(self.seen_))
        step = rounded(spread * LEAF_STEP, 3)
        leaves = (1.0 - TREND_SHARE) * forest.leaves * spread
        self.forest_ = Forest(asked, leaves).in_steps(step)
        effects = np.rint(TREND_SHARE * trends.effects * spread / step) * step
        self.trends_ = replace(trends, effects=effects, step=step)

    def _move(self, track: PhoneTrack, times_s: Floats) -> Floats:
        phones = spoken([track])
        added = None
        if self.options.modes == "affinity":
            stand_ins = [self.stand_in(symbol) for symbol in phones.symbols]
            unit = self.modes_.choose(
                stand_ins, phones.length_s, self.options.context_weight, self.options.smooth_weight
            )
        else:
            unit = self.rows(phones.symbols)
        if self.options.modes == "context":
            added = self.forest_.coefficients(self.questions_.answers(phones))
            if len(self.trends_.effects):
                added += self.trends_.coefficients(phones, unit)
        return self.animemes_.move(phones, unit, times_s, added)

    def _to_json(self) -> dict[str, Any]:
        found = self.animemes_.to_json()
        if self.options.modes == "affinity":
            found["modes"] = self.modes_.to_json()
        if self.options.modes == "context":
            found["questions"] = [question.to_json() for question in self.questions_.questions]
            found |= self.forest_.to_json()
            if len(self.trends_.effects):
                found["trends"] = self.trends_.to_json()
        return found

    def _from_json(self, learned: Mapping[str, Any]) -> None:
        options, controls = self.options, len(self.controls_)
        units = len(self.seen_)
        if options.modes == "affinity":
            self.modes_ = Modes.from_json(learned["modes"], frozenset(self.seen_))
            units = len(self.modes_.units)
        empty = self._empty(units)
        self.animemes_ = empty.restored(learned, units, options.degree, controls)
        if options.modes == "affinity":
            self.modes_ = self.modes_.with_shapes(self.animemes_.coefficients, self.modes_.spread)
        if options.modes == "context":
            seen = frozenset(self.seen_)
            questions = [Question.from_json(entry, seen) for entry in learned["questions"]]
            self.questions_ = Questionnaire(questions, tuple(self.seen_))
            self.forest_ = Forest.from_json(
                learned, depth=options.depth, shape=(options.degree + 1, controls),
                questions=len(questions),
            )  # fmt: skip
            if "trends" in learned:  # later than the first documents of version 1
                self.trends_ = Trends.from_json(
                    learned["trends"], units, (options.degree + 1, controls)
                )
