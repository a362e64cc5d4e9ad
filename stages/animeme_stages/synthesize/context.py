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
from animeme_stages.synthesize.spoken import Ints, Spoken

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
# How far other things are, in seconds: the ends of the track; the nearest vowel, closed lips and
# pause on either side; and how long a spoken phone of the track is on average.
DISTANCES = (
    "start", "end", "vowel-before", "vowel-after", "bilabial-before", "bilabial-after",
    "pause-before", "pause-after", "pace",
)  # fmt: skip
# What is farther away, or not there, counts as this far.
_FAR_S = 2.0
# Thresholds are these percentiles of what was seen in training.
_PERCENTILES = (8, 16, 25, 33, 42, 50, 58, 67, 75, 84, 92)
# A phone of its own is asked about if it was seen this often; its class always is.
_SEEN_OFTEN = 20
# Added to lengths in a ratio: the aligner's step, below which lengths are noise.
_STEP_S = 0.01
_EDGE = "edge"
_NAMED = ("is", "vowel")


@dataclass(frozen=True)
class Question:
    """One thing to ask about a phone.

    Attributes:
        kind: "is" (a phone, a class or a group, or "edge": the track ends before), "vowel" (the
            same, of the nearest vowel on that side), "longer" (a stretch takes more than `above`
            seconds), "ratio" (logarithm above `above`) or "farther" (than `above` seconds).
        offset: place of the neighbour, −1 or 1 of a vowel, or index of the stretch, ratio or
            distance.
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
        places = {
            "is": range(-SPAN, SPAN + 1),
            "vowel": (-1, 1),
            "longer": range(len(STRETCHES)),
            "ratio": range(len(RATIOS)),
            "farther": range(len(DISTANCES)),
        }
        known = names | set(CLASSES) | set(GROUPS) | {_EDGE}
        if kind not in places or not isinstance(offset, int) or not isinstance(name, str):
            raise ValueError(f"a tree asks {entry!r}")
        if offset not in places[kind] or not np.isfinite(float(above)):
            raise ValueError(f"a tree asks {entry!r}")
        if kind in _NAMED and name not in known:
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
        return tuple(sorted({q.name for q in self.questions if q.kind in _NAMED}))

    @cached_property
    def _plan(self) -> tuple[Any, ...]:
        """Columns, places and names of neighbours; columns, places and thresholds of lengths."""
        is_ = [i for i, q in enumerate(self.questions) if q.kind in _NAMED]
        of = [i for i, q in enumerate(self.questions) if q.kind not in _NAMED]
        name_of = {name: i for i, name in enumerate(self._names)}
        offsets = np.array([_place(self.questions[i]) for i in is_], dtype=np.int64)
        names = np.array([name_of[self.questions[i].name] for i in is_], dtype=np.int64)
        shift = {"longer": 0, "ratio": len(STRETCHES), "farther": len(STRETCHES) + len(RATIOS)}
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
            found[:, of] = _measures(phones)[:, places] > above
        return found

    def _membership(self, phones: Spoken) -> Booleans:
        """Whether each neighbour bears each name, shape (J, 2 SPAN + 3, names).

        The last two are the nearest vowels.
        """
        kinds = sorted(set(phones.symbols))
        code_of = {symbol: i for i, symbol in enumerate(kinds)}
        table = np.zeros((3, len(kinds) + 1, len(self._names)), dtype=np.bool_)
        for side in range(3):  # a neighbour before shows its end; one after, its beginning
            for symbol, row in code_of.items():
                table[side, row] = self._row(symbol, end=side == 0)
            table[side, -1] = [name == _EDGE for name in self._names]
        code = np.array([code_of[symbol] for symbol in phones.symbols])
        columns = []
        vowels = _nearest_on_either_side(phones, _is_vowel(phones))
        offsets = (*range(-SPAN, SPAN + 1), -1, 1)
        neighbours = [phones.neighbour(offset) for offset in range(-SPAN, SPAN + 1)]
        for offset, index in zip(offsets, [*neighbours, *vowels], strict=True):
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


def _place(question: Question) -> int:
    """Which of the columns of `Questionnaire._membership` a question is about."""
    if question.kind == "is":
        return question.offset + SPAN
    return 2 * SPAN + 1 + (question.offset > 0)


def _is_vowel(phones: Spoken) -> Booleans:
    return np.array([class_of(symbol).startswith("vowel") for symbol in phones.symbols], np.bool_)


def _nearest_on_either_side(phones: Spoken, wanted: Booleans) -> tuple[Ints, Ints]:
    """The last of the `wanted` phones before each phone and the first after, −1 for none; (J,)."""
    count = len(wanted)
    index = np.arange(count)
    before = np.full(count, -1)
    before[1:] = np.maximum.accumulate(np.where(wanted, index, -1))[:-1]
    after = np.full(count, count)
    after[:-1] = np.minimum.accumulate(np.where(wanted, index, count)[::-1])[::-1][1:]
    after[after == count] = -1
    same = [(found >= 0) & (phones.line[found] == phones.line) for found in (before, after)]
    return np.where(same[0], before, -1), np.where(same[1], after, -1)


def distances(phones: Spoken) -> Floats:
    """`DISTANCES` of each phone in seconds, shape (J, …)."""
    first = np.searchsorted(phones.line, phones.line, side="left")
    last = np.searchsorted(phones.line, phones.line, side="right") - 1
    columns = [phones.start_s - phones.start_s[first], phones.end_s[last] - phones.end_s]
    classes = np.array([class_of(symbol) for symbol in phones.symbols])
    pause = classes == "silence"
    for wanted in (_is_vowel(phones), classes == "bilabial", pause):
        before, after = _nearest_on_either_side(phones, wanted)
        since_s = phones.start_s - phones.end_s[before]
        until_s = phones.start_s[after] - phones.end_s
        columns.append(np.where(before >= 0, since_s, _FAR_S))
        columns.append(np.where(after >= 0, until_s, _FAR_S))
    spoken_s = np.bincount(phones.line, np.where(pause, 0.0, phones.length_s))
    count = np.bincount(phones.line, ~pause)
    columns.append((spoken_s / np.maximum(count, 1))[phones.line])
    return np.minimum(np.stack(columns, axis=1), _FAR_S)


def _measures(phones: Spoken) -> Floats:
    return np.concatenate([lengths(phones), distances(phones)], axis=1)


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
    vowels = [name for name in classes if name.startswith("vowel")]
    vowels += [symbol for symbol in own if class_of(symbol).startswith("vowel")]
    found += [Question("vowel", side, name) for side in (-1, 1) for name in vowels]
    values = _measures(phones)
    places = [
        *(("longer", index) for index in range(len(STRETCHES))),
        *(("ratio", index) for index in range(len(RATIOS))),
        *(("farther", index) for index in range(len(DISTANCES))),
    ]
    for place, (kind, index) in enumerate(places):
        # Rounded, so that documents stay short; and a threshold lies between what was seen.
        edges = np.unique(np.round(np.percentile(values[:, place], _PERCENTILES), 4))
        found += [Question(kind, index, "", float(edge)) for edge in edges]
    return tuple(found)
