"""Phone bigrams: curves for pairs of phones, stitched, smoothed and kept within limits.

Xu, Feng, Marsella & Shapiro, "A practical and configurable lip sync method for games" ("the 2013
paper"). A set is drawn by an animator (a ``bigrams`` document), or fitted to captured motion.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from itertools import pairwise
from pathlib import Path
from typing import Any, ClassVar, Self

from animeme.curves import CurveSet, Floats
from animeme.dataset import Dataset, Listener
from animeme.findings import Finding, Severity
from animeme.phones import PhoneTrack
from animeme_stages.synthesize.bigram_files import (
    DrawnSet,
    drawn_from_json,
    read_set,
    shipped_set,
)
from animeme_stages.synthesize.bigram_fit import fit_set
from animeme_stages.synthesize.bigram_passes import (
    Passes,
    Segments,
    run_passes,
    segments,
)
from animeme_stages.synthesize.bigram_set import BigramSet
from animeme_stages.synthesize.fitted import FittedModel
from animeme_stages.synthesize.options import read_options
from animeme_stages.synthesize.sampling import sample_times

DEFAULT_SET = "facefx"
# More missing pairs than this are counted, not named.
_NAMED_PAIRS = 6


@dataclass(frozen=True)
class BigramOptions:
    """Options of `Bigram`; a drawn set brings its own."""

    window_s: float = field(default=0.0, metadata={"low": 0, "high": 1})
    speed: float = field(default=15.0, metadata={"low": 0.01, "high": 1e6})
    contacts: bool = False


class Bigram(FittedModel):
    """Curves of pairs of phones; fitted to captured motion, or made by an animator.

    Attributes:
        set_: the polygons of each pair.
        drawn_: the animator's set, None if it is fitted.
    """

    name: ClassVar[str] = "bigram"
    reads: ClassVar[str] = "bigrams"
    Options = BigramOptions
    options: BigramOptions

    def __init__(self, options: BigramOptions | None = None) -> None:
        """See `FittedModel`."""
        super().__init__(options)
        self.set_ = BigramSet({}, ())
        self.drawn_: DrawnSet | None = None

    @classmethod
    def default(cls) -> Self:
        """The shipped set."""
        return cls.from_set(shipped_set(DEFAULT_SET))

    @classmethod
    def from_file(cls, path: Path) -> Self:
        """The model that plays a ``bigrams`` document.

        Raises:
            InputError: it, or one that it extends, is broken.
        """
        return cls.from_set(read_set(path))

    @classmethod
    def from_set(cls, drawn: DrawnSet) -> Self:
        """The model that plays a drawn set."""
        model = cls(BigramOptions(drawn.window_s, drawn.speed))
        model.drawn_, model.set_ = drawn, drawn.set_
        model.controls_, model.credits_ = drawn.controls, drawn.credits
        return model

    def synthesize(self, track: PhoneTrack, *, rate_hz: float) -> CurveSet:
        """Control curves over the whole of `track`; see `FittedModel.synthesize`."""
        if self.drawn_ is None:
            return super().synthesize(track, rate_hz=rate_hz)
        passes = self.passes(track, sample_times(track.duration_s, rate_hz))
        return CurveSet(passes.times_s, self.controls_, passes.limited @ self.drawn_.matrix)

    def remarks(self, track: PhoneTrack) -> Iterator[Finding]:
        """What a person should know about this model's motion for `track`."""
        if self.drawn_ is None:
            yield from super().remarks(track)
        else:
            yield from self._strange_phones(track)
        yield from self._missing_pairs(track)

    def _strange_phones(self, track: PhoneTrack) -> Iterator[Finding]:
        strangers = sorted(s for s in set(track.ipa()) if not self.set_.has(s))
        if strangers:
            pairs = ", ".join(f"/{s}/ like '{self.set_.class_of(s)}'" for s in strangers)
            yield Finding(
                Severity.INFO,
                "model-phone-unseen",
                f"no class of the bigrams names some phones, which move {pairs}",
                action="Name them in the set's phones, in a class that looks like them.",
            )

    def _missing_pairs(self, track: PhoneTrack) -> Iterator[Finding]:
        made = missing_pairs(self.set_, track)
        if made:
            named = ", ".join(f"{pair} ({how})" for pair, how in list(made.items())[:_NAMED_PAIRS])
            more = f" and {len(made) - _NAMED_PAIRS} more" if len(made) > _NAMED_PAIRS else ""
            yield Finding(
                Severity.INFO,
                "bigram-pair-missing",
                f"the bigrams lack pairs of this line: {named}{more}",
                action="Add them to the set; `animeme bigrams coverage` counts a dialogue's.",
            )

    def passes(self, track: PhoneTrack, times_s: Floats) -> Passes:
        """Weights of the poses after each pass, at `times_s`, shape (T,)."""
        return run_passes(
            self.set_,
            self.segments(track),
            times_s,
            window_s=self.options.window_s,
            speed=self.options.speed,
        )

    def segments(self, track: PhoneTrack) -> Segments:
        """The phones of `track` as its bigrams are laid over them."""
        if self.drawn_ is None:
            return segments(track)
        return segments(track, hold_s=self.drawn_.hold_s, pause_hold_s=self.drawn_.pause_hold_s)

    def to_document(self) -> dict[str, Any]:
        """The ``animeme.model/1`` document that rebuilds this model bit-exactly."""
        if self.drawn_ is None:
            return super().to_document()
        return {
            "schema": "animeme.model/1",
            "model": self.name,
            "config": self.config(),
            "drawn": self.drawn_.to_json(),
        }

    @classmethod
    def from_document(cls, document: Mapping[str, Any]) -> Self:
        """Rebuild a model from an ``animeme.model`` document.

        Raises:
            ValueError: the document does not fit this model.
        """
        if "drawn" not in document:
            return super().from_document(document)
        model = cls.from_set(drawn_from_json(document["drawn"]))
        model.options = read_options(cls.Options, document["config"])
        return model

    def _learn(self, dataset: Dataset, listener: Listener) -> None:
        self.set_ = fit_set(dataset, listener)

    def _move(self, track: PhoneTrack, times_s: Floats) -> Floats:
        return self.passes(track, times_s).limited

    def _to_json(self) -> dict[str, Any]:
        return {"bigrams": self.set_.to_json()}

    def _from_json(self, learned: Mapping[str, Any]) -> None:
        self.set_ = BigramSet.from_json(learned["bigrams"], self.controls_)


def missing_pairs(set_: BigramSet, track: PhoneTrack) -> dict[str, str]:
    """Pairs of `track` that the set lacks, in order, and what they are made of."""
    names = [set_.class_of(symbol) for symbol in segments(track).symbols]
    found = {}
    for first, second in pairwise(names):
        source = set_.source(first, second)
        if source != f"{first}|{second}" and not first == second == "_":
            found[f"{first}|{second}"] = f"like {source}" if source else "does not move"
    return found


__all__ = ["Bigram", "BigramOptions", "missing_pairs"]
