"""What trees may ask about a phone's context: its neighbours' classes, and durations."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from animeme.curves import Floats
from animeme_stages.synthesize.articulation import CLASSES, GROUPS, class_of, nearest
from animeme_stages.synthesize.spoken import Spoken

Booleans = NDArray[np.bool_]

# Phones on either side whose classes and lengths are asked about.
SPAN = 3
# Stretches of phones, by their places relative to the phone itself, whose lengths are asked about.
STRETCHES: tuple[tuple[int, ...], ...] = (
    *((offset,) for offset in range(-SPAN, SPAN + 1)),
    (-1, 0), (0, 1), (1, 2), (-2, -1), (-1, 0, 1), (1, 2, 3), (-3, -2, -1),
)  # fmt: skip
# Neighbouring stretches whose ratio of lengths is asked about (indices into `STRETCHES`).
RATIOS: tuple[tuple[int, int], ...] = ((3, 4), (3, 2), (4, 5), (2, 1))
# Thresholds are these percentiles of what was seen in training.
_PERCENTILES = (8, 16, 25, 33, 42, 50, 58, 67, 75, 84, 92)
# A phone of its own is asked about if it was seen this often; its class always is.
_SEEN_OFTEN = 20
# Added to lengths in a ratio: the aligner's step, below which lengths are noise.
_STEP_S = 0.01
_EDGE = "edge"


@dataclass(frozen=True)
class Question:
    """One thing to ask about a phone.

    Attributes:
        kind: "is" (a phone, a class or a group, or "edge": the track ends before), "longer" (a
            stretch takes more than `above` seconds) or "ratio" (logarithm above `above`).
        offset: place of the neighbour, or index of the stretch or ratio.
        name: of the phone, class or group; "" for lengths.
        above: threshold; 0 for "is".
    """

    kind: str
    offset: int
    name: str = ""
    above: float = 0.0

    def to_json(self) -> list[Any]:
        """As model documents have it."""
        return [self.kind, self.offset, self.name, self.above]

    @classmethod
    def from_json(cls, entry: Any, names: frozenset[str]) -> Question:
        """Read what `to_json` wrote; `names` are the phones that may be asked about.

        Raises:
            ValueError: it asks about something that does not exist.
        """
        kind, offset, name, above = entry
        places = {"is": SPAN * 2 + 1, "longer": len(STRETCHES), "ratio": len(RATIOS)}
        known = names | set(CLASSES) | set(GROUPS) | {_EDGE}
        if kind not in places or not isinstance(offset, int) or not isinstance(name, str):
            raise ValueError(f"a tree asks {entry!r}")
        lowest = -SPAN if kind == "is" else 0
        if not lowest <= offset < lowest + places[kind] or not np.isfinite(float(above)):
            raise ValueError(f"a tree asks {entry!r}")
        if kind == "is" and name not in known:
            raise ValueError(f"a tree asks about '{name}', which is no phone or class")
        return cls(kind, offset, name, float(above))


class Questionnaire:
    """A list of questions, ready to be put to whole tracks at once."""

    def __init__(self, questions: Sequence[Question], phones: Sequence[str]) -> None:
        """Prepare `questions`; `phones` are the symbols seen in training."""
        self.questions = tuple(questions)
        self.phones = tuple(sorted(phones))
        self._seen = frozenset(self.phones)
        self._rows: dict[tuple[str, bool], Booleans] = {}

    @cached_property
    def _names(self) -> tuple[str, ...]:
        return tuple(sorted({q.name for q in self.questions if q.kind == "is"}))

    @cached_property
    def _plan(self) -> tuple[Any, ...]:
        """Columns, offsets and names of "is"; columns, places and thresholds of lengths."""
        is_ = [i for i, q in enumerate(self.questions) if q.kind == "is"]
        of = [i for i, q in enumerate(self.questions) if q.kind != "is"]
        name_of = {name: i for i, name in enumerate(self._names)}
        offsets = np.array([self.questions[i].offset + SPAN for i in is_], dtype=np.int64)
        names = np.array([name_of[self.questions[i].name] for i in is_], dtype=np.int64)
        shift = {"longer": 0, "ratio": len(STRETCHES)}
        places = np.array(
            [self.questions[i].offset + shift[self.questions[i].kind] for i in of], dtype=np.int64
        )
        above = np.array([self.questions[i].above for i in of])
        return np.array(is_, np.int64), offsets, names, np.array(of, np.int64), places, above

    def answers(self, phones: Spoken) -> Booleans:
        """Shape (J, Q)."""
        is_, offsets, names, of, places, above = self._plan
        found = np.zeros((len(phones.symbols), len(self.questions)), dtype=np.bool_)
        if len(is_):
            found[:, is_] = self._membership(phones)[:, offsets, names]
        if len(of):
            found[:, of] = lengths(phones)[:, places] > above
        return found

    def _membership(self, phones: Spoken) -> Booleans:
        """Whether the neighbour at each offset bears each name, shape (J, 2 SPAN + 1, names)."""
        kinds = sorted(set(phones.symbols))
        code_of = {symbol: i for i, symbol in enumerate(kinds)}
        table = np.zeros((3, len(kinds) + 1, len(self._names)), dtype=np.bool_)
        for side in range(3):  # a neighbour before shows its end; one after, its beginning
            for symbol, row in code_of.items():
                table[side, row] = self._row(symbol, end=side == 0)
            table[side, -1] = [name == _EDGE for name in self._names]
        code = np.array([code_of[symbol] for symbol in phones.symbols])
        columns = []
        for offset in range(-SPAN, SPAN + 1):
            index = phones.neighbour(offset)
            columns.append(table[1 + np.sign(offset), np.where(index >= 0, code[index], -1)])
        return np.stack(columns, axis=1)

    def _row(self, symbol: str, *, end: bool) -> Booleans:
        """Which of the names a phone bears; worked out once."""
        if (symbol, end) not in self._rows:
            bears = _names_of(symbol, self._seen, end=end)
            self._rows[symbol, end] = np.array([name in bears for name in self._names], np.bool_)
        return self._rows[symbol, end]


def _names_of(symbol: str, seen: frozenset[str], *, end: bool) -> frozenset[str]:
    """The phone's own name (the nearest that was seen), its class and its groups."""
    found = class_of(symbol, end=end)
    groups = {name for name, members in GROUPS.items() if found in members}
    return frozenset({nearest(symbol, seen), found, *groups})


def lengths(phones: Spoken) -> Floats:
    """Lengths of `STRETCHES` in seconds and logarithms of `RATIOS`, shape (J, …)."""
    one: dict[int, Floats] = {}
    for offset in range(-SPAN, SPAN + 1):
        index = phones.neighbour(offset)
        one[offset] = np.where(index >= 0, phones.length_s[index], 0.0)
    columns = [np.sum([one[offset] for offset in stretch], axis=0) for stretch in STRETCHES]
    for a, b in RATIOS:
        columns.append(np.log((columns[a] + _STEP_S) / (columns[b] + _STEP_S)))
    return np.stack(columns, axis=1)


def possible_questions(phones: Spoken) -> tuple[Question, ...]:
    """Everything worth asking about the phones of a dataset, in a fixed order."""
    symbols = np.array(phones.symbols)
    kinds, counts = np.unique(symbols, return_counts=True)
    own = [str(k) for k, n in zip(kinds, counts, strict=True) if n >= _SEEN_OFTEN]
    classes = sorted({class_of(str(k), end=e) for k in kinds for e in (False, True)})
    found: list[Question] = []
    for offset in range(-SPAN, SPAN + 1):
        names = [*classes, *GROUPS, *((_EDGE,) if offset else ())]
        if abs(offset) < SPAN:
            names += [symbol for symbol in own if symbol not in names]
        found += [Question("is", offset, name) for name in names]
    values = lengths(phones)
    for place in range(values.shape[1]):
        kind, index = ("longer", place) if place < len(STRETCHES) else ("ratio", place)
        if kind == "ratio":
            index -= len(STRETCHES)
        # Rounded, so that documents stay short; and a threshold lies between what was seen.
        edges = np.unique(np.round(np.percentile(values[:, place], _PERCENTILES), 4))
        found += [Question(kind, index, "", float(edge)) for edge in edges]
    return tuple(found)
