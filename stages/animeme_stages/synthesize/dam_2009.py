"""The dominated animeme model of 2009.

Chen, Huang, Guan & Chen 2009 ("the 2009 paper"): one polynomial animeme per phone
(eq. 1–6), under the two-sided dominance of its eq. 7, learned by turns (section 5.3).
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, ClassVar, Literal

from animeme.curves import Floats
from animeme.dataset import Dataset, Listener
from animeme.phones import PhoneTrack
from animeme_stages.synthesize.animemes import Animemes, learn_animemes
from animeme_stages.synthesize.dominance import Dominance2009
from animeme_stages.synthesize.fitted import FittedModel, frames_of
from animeme_stages.synthesize.spoken import spoken


@dataclass(frozen=True)
class Dam2009Options:
    """Options of `Dam2009`."""

    degree: int = field(default=4, metadata={"low": 0, "high": 8})
    normalise: bool = False
    spread: Literal["seconds", "lengths"] = "lengths"
    sigma: float = field(default=1.0, metadata={"low": 0.01, "high": 3})
    method: Literal["projection", "em"] = "em"
    hold_s: float = field(default=0.8, metadata={"low": 0.1, "high": 10})
    ridge: float = field(default=0.1, metadata={"low": 0, "high": 1e6})
    contacts: bool = False


class Dam2009(FittedModel):
    """One polynomial animeme and two influence controls σ₁, σ₂ per phone and control."""

    name: ClassVar[str] = "dam-2009"
    Options = Dam2009Options
    options: Dam2009Options

    def __init__(self, options: Dam2009Options | None = None) -> None:
        """See `FittedModel`."""
        super().__init__(options)
        self.animemes_ = self._empty(0)

    def _empty(self, units: int) -> Animemes:
        return Animemes.empty(Dominance2009(), self.options, units, len(self.controls_))

    def _learn(self, dataset: Dataset, listener: Listener) -> None:
        phones = spoken([line.track for line in dataset.lines])
        times_s, values = frames_of(dataset, phones.offset_s)
        self.animemes_ = learn_animemes(
            self._empty(len(self.seen_)), phones, self.rows(phones.symbols), times_s, values,
            degree=self.options.degree, ridge=self.options.ridge, method=self.options.method,
            told=lambda part: listener("dominances", part),
        )  # fmt: skip

    def _move(self, track: PhoneTrack, times_s: Floats) -> Floats:
        phones = spoken([track])
        return self.animemes_.move(phones, self.rows(phones.symbols), times_s)

    def _to_json(self) -> dict[str, Any]:
        return self.animemes_.to_json()

    def _from_json(self, learned: Mapping[str, Any]) -> None:
        units, controls = len(self.seen_), len(self.controls_)
        self.animemes_ = self._empty(units).restored(learned, units, self.options.degree, controls)
