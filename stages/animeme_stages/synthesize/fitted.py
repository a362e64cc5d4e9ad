"""What models that are fitted to captured motion have in common."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections import Counter
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from functools import lru_cache
from typing import Any, ClassVar, Self

import numpy as np

from animeme.curves import CurveSet, Floats
from animeme.dataset import Dataset, Listener, no_listener
from animeme.errors import InputError
from animeme.findings import Finding, Severity
from animeme.phones import SILENCE, PhoneTrack
from animeme_stages.synthesize.articulation import nearest
from animeme_stages.synthesize.contacts import Contacts, learn_contacts
from animeme_stages.synthesize.holds import Holds, learn_holds
from animeme_stages.synthesize.options import read_options
from animeme_stages.synthesize.sampling import sample_times
from animeme_stages.synthesize.spoken import Ints

SCHEMA = "animeme.model/1"
# A phone seen less often than this is fitted, and mentioned.
SELDOM = 5


class FittedModel(ABC):
    """A model that works once it is fitted.

    Subclasses set `name` and `Options`, a dataclass with at least `contacts`, and define `_learn`,
    `_move`, `_to_json` and `_from_json`.

    Attributes:
        options: as given; `config()` is the same as plain data.
        controls_: names of the N controls that are learned, () before fitting.
        copies_: control → the one of `controls_` that it always equalled in training: the other
            side of a symmetric mouth, for one.
        credits_: whose recordings it was fitted to, and under which licence; "" where unsaid.
        seen_: phone → how often it occurs in the training lines.
        contacts_: see `contacts.Contacts`.
        holds_: where phones settle that are held for longer than any that was seen.
        findings_: what the training data lacks.
    """

    name: ClassVar[str]
    Options: ClassVar[type[Any]]

    def __init__(self, options: Any = None) -> None:
        self.options = options if options is not None else self.Options()
        self.controls_: tuple[str, ...] = ()
        self.copies_: dict[str, str] = {}
        self.credits_ = ""
        self.seen_: dict[str, int] = {}
        self.contacts_ = Contacts()
        self.holds_ = Holds({}, {})
        self.findings_: tuple[Finding, ...] = ()

    @classmethod
    def configured(cls, options: Mapping[str, Any]) -> Self:
        """An unfitted model with these options, as text or as values.

        Raises:
            InputError: an option is unknown, or a value makes no sense.
        """
        try:
            return cls(read_options(cls.Options, options))
        except ValueError as error:
            raise InputError(
                "model-option",
                str(error),
                place=cls.name,
                action="docs/models.md lists the options.",
            ) from error

    @classmethod
    def default(cls) -> Self:
        """There is none without training.

        Raises:
            InputError: always.
        """
        raise InputError(
            "model-untrained",
            "works only when it is fitted to captured motion",
            place=cls.name,
            action=f"Run `animeme train DATASET --model {cls.name} --output FILE` and name FILE.",
        )

    @property
    def controls(self) -> tuple[str, ...]:
        """Names of the curves that `synthesize` returns."""
        return (*self.controls_, *self.copies_)

    def config(self) -> dict[str, Any]:
        """The options as plain data."""
        return {name: getattr(self.options, name) for name in self.Options.__dataclass_fields__}

    def fit(self, dataset: Dataset, *, listener: Listener = no_listener) -> Self:
        """A new model with the same options, fitted to `dataset`.

        Args:
            dataset: at least one line with a captured value of every control.
            listener: told of progress.

        Raises:
            InputError: there is nothing to learn from.
        """
        require_motion(dataset)
        fitted = type(self)(self.options)
        dataset, fitted.copies_ = _without_copies(dataset)
        fitted.controls_ = dataset.controls
        counts = Counter(symbol for line in dataset.lines for symbol in line.track.ipa())
        fitted.seen_ = dict(sorted(counts.items()))
        fitted.contacts_ = learn_contacts(dataset) if self.options.contacts else Contacts()
        fitted.holds_ = learn_holds(dataset)
        fitted.findings_ = tuple(_lacks(fitted.seen_))
        fitted._learn(dataset, listener)
        return fitted

    def synthesize(self, track: PhoneTrack, *, rate_hz: float) -> CurveSet:
        """Control curves over the whole of `track`.

        Args:
            track: aligned phones; those that were not seen in training move like the nearest.
            rate_hz: sampling rate; keys for contacts come on top.

        Returns:
            One curve per control, from 0 to the end of the track.
        """
        times_s = sample_times(track.duration_s, rate_hz, self.contacts_.keys(track))
        weights = self._move(track, times_s)
        stand_ins = [self.stand_in(symbol) for symbol in track.ipa()]
        weights = self.holds_.settle(track, stand_ins, times_s, weights)
        weights = self.contacts_.hold(track, times_s, weights, self.controls_)
        copied = [self.controls_.index(name) for name in self.copies_.values()]
        weights = np.concatenate([weights, weights[:, copied]], axis=1)
        return CurveSet(times_s, self.controls, weights)

    def remarks(self, track: PhoneTrack) -> Iterator[Finding]:
        """What a person should know about this model's motion for `track`."""
        strangers = sorted(set(track.ipa()) - set(self.seen_))
        if strangers:
            pairs = ", ".join(f"/{s}/ like /{self.stand_in(s)}/" for s in strangers)
            yield Finding(
                Severity.INFO,
                "model-phone-unseen",
                f"the model never saw some phones and moves {pairs}",
                action="Add lines that have them to its training data.",
            )

    def stand_in(self, symbol: str) -> str:
        """The phone of the training data that moves for `symbol`: itself, or the nearest."""
        return _stand_in(symbol, frozenset(self.seen_))

    def rows(self, symbols: Sequence[str]) -> Ints:
        """Which of the phones of the training data moves for each symbol, (J,)."""
        number = {symbol: row for row, symbol in enumerate(self.seen_)}
        return np.array([number[self.stand_in(symbol)] for symbol in symbols], np.int64)

    def to_document(self) -> dict[str, Any]:
        """The ``animeme.model/1`` document that rebuilds this model bit-exactly."""
        return {
            "schema": SCHEMA,
            "model": self.name,
            "config": self.config(),
            "controls": list(self.controls_),
            "seen": dict(self.seen_),
            "contacts": self.contacts_.to_json(),
            "holds": self.holds_.to_json(),
            "learned": self._to_json(),
            **({"copies": dict(self.copies_)} if self.copies_ else {}),
            **({"credits": self.credits_} if self.credits_ else {}),
        }

    @classmethod
    def from_document(cls, document: Mapping[str, Any]) -> Self:
        """Rebuild a model from an ``animeme.model`` document.

        Raises:
            ValueError: the document does not fit this model.
        """
        try:
            model = cls(read_options(cls.Options, document["config"]))
            model.controls_ = tuple(_names(document["controls"]))
            model.seen_ = {str(symbol): int(n) for symbol, n in document["seen"].items()}
            model.contacts_ = Contacts.from_json(document["contacts"], model.controls_)
            model.holds_ = Holds.from_json(
                document["holds"], frozenset(model.seen_), len(model.controls_)
            )
            model.copies_ = {str(k): str(v) for k, v in document.get("copies", {}).items()}
            model.credits_ = str(document.get("credits", ""))
            originals = set(model.controls_)
            if not set(model.copies_.values()) <= originals or originals & set(model.copies_):
                raise ValueError("copies must be of controls, under names of their own")
            if not model.controls_ or not model.seen_:
                raise ValueError("it has no controls or no phones")
            model._from_json(document["learned"])
        except (KeyError, TypeError, AttributeError, IndexError, OverflowError) as error:
            raise ValueError(f"not a {cls.name} model: {error!r}") from error
        return model

    @abstractmethod
    def _learn(self, dataset: Dataset, listener: Listener) -> None:
        """Fit to `dataset`, whose controls are `controls_`; tell `listener` how far it has come."""

    @abstractmethod
    def _move(self, track: PhoneTrack, times_s: Floats) -> Floats:
        """The controls at `times_s` (T,), shape (T, N), before contacts and holds."""

    @abstractmethod
    def _to_json(self) -> dict[str, Any]:
        """What was learned, as plain data."""

    @abstractmethod
    def _from_json(self, learned: Mapping[str, Any]) -> None:
        """Take what `_to_json` gave; raises ValueError where it does not fit."""


@lru_cache(maxsize=4096)
def _stand_in(symbol: str, seen: frozenset[str]) -> str:
    return nearest(symbol, seen)


def _names(entries: Any) -> list[str]:
    if not isinstance(entries, Sequence) or isinstance(entries, str):
        raise ValueError("controls must be a list of names")
    if len(set(entries)) != len(entries) or not all(isinstance(e, str) for e in entries):
        raise ValueError("controls must be distinct names")
    return list(entries)


def require_motion(dataset: Dataset) -> None:
    """Raise InputError unless every control of `dataset` was captured somewhere."""
    problem = ""
    if not dataset.lines:
        problem = "there is no line to learn from"
    elif dataset.frames < 2:
        problem = "there is only one captured frame"
    else:
        for column, control in enumerate(dataset.controls):
            if all(np.isnan(line.values[:, column]).all() for line in dataset.lines):
                problem = f"'{control}' was captured in no line"
    if problem:
        raise InputError(
            "dataset-empty",
            problem,
            place="dataset",
            action="Add lines with captured motion, or leave that control out.",
        )


def _without_copies(dataset: Dataset) -> tuple[Dataset, dict[str, str]]:
    """The dataset without controls that equal an earlier one in every frame; which they are."""
    values = np.concatenate([line.values for line in dataset.lines])
    first: dict[bytes, str] = {}
    copies = {}
    for column, name in enumerate(dataset.controls):
        original = first.setdefault(values[:, column].tobytes(), name)
        if original != name:
            copies[name] = original
    if not copies:
        return dataset, copies
    kept = [i for i, name in enumerate(dataset.controls) if name not in copies]
    lines = tuple(replace(line, values=line.values[:, kept]) for line in dataset.lines)
    return Dataset(tuple(dataset.controls[i] for i in kept), lines, dataset.findings), copies


def _lacks(seen: Mapping[str, int]) -> Iterable[Finding]:
    seldom = [f"/{symbol}/ {n}" for symbol, n in seen.items() if n < SELDOM and symbol != SILENCE]
    if seldom:
        yield Finding(
            Severity.INFO,
            "dataset-phone-seldom",
            f"some phones occur less than {SELDOM} times: {', '.join(seldom)}",
            action="Their motion is a guess; add lines that have them.",
        )


def frames_of(dataset: Dataset, offset_s: Floats) -> tuple[Floats, Floats]:
    """All frames on one time axis: times, shape (F,), and values, shape (F, N)."""
    times_s = [line.times_s + o for line, o in zip(dataset.lines, offset_s, strict=True)]
    return np.concatenate(times_s), np.concatenate([line.values for line in dataset.lines])


def spreads(values: Floats) -> Floats:
    """Standard deviation of each control, 1 where it does not move, shape (N,)."""
    spread = np.nanstd(values, axis=0)
    return np.where(spread > 1e-12, spread, 1.0)
