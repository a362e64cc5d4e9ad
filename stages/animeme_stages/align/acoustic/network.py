"""A transcript as the states that a recording may pass through."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from animeme_stages.align.acoustic.model import (
    ALONE,
    FIRST,
    INSIDE,
    LAST,
    SILENCE_PHONE,
    STATES,
    AcousticModel,
)

Indices = NDArray[np.int64]
Sounds = tuple[str, ...]
"""One pronunciation of a word in the model's phones."""

PAUSE = -1
"""The word of a phone that belongs to none."""


@dataclass(frozen=True)
class Unit:
    """One phone of the network.

    Attributes:
        phone: base phone.
        sequence: its state sequence in the model.
        word: index of its word, or `PAUSE`.
        variant: which pronunciation of the word.
        place: index of the phone in that pronunciation.
    """

    phone: int
    sequence: int
    word: int
    variant: int
    place: int


@dataclass(frozen=True, eq=False)
class Network:
    """Words with all of their pronunciations, and an optional pause around each; S = 3 × units.

    A state follows the one before it in order, but for the first states of units that follow the
    end of another: these are the entries.

    Attributes:
        units: all phones.
        words: number of words.
        senones: (S,) of each state.
        entries: (E,) first states that follow the end of other units.
        sources: (E, K) last states that lead there, S where there are fewer than K.
        exits: (X,) last states that lead to entries.
        targets: (X, J) first states that they lead to, S where there are fewer than J.
        starts, ends: states where a path may begin and finish.
        pauses: (words + 1,) units of the pauses before, between and after the words.
        firsts, lasts: per word, the units that its pronunciations begin and end with.
    """

    units: tuple[Unit, ...]
    words: int
    senones: Indices
    entries: Indices
    sources: Indices
    exits: Indices
    targets: Indices
    starts: Indices
    ends: Indices
    pauses: Indices
    firsts: tuple[tuple[int, ...], ...]
    lasts: tuple[tuple[int, ...], ...]


def network(model: AcousticModel, words: Sequence[Sequence[Sounds]]) -> Network:
    """The network of a transcript.

    Args:
        model: gives the states.
        words: per word, its pronunciations.
    """
    silence = model.index[SILENCE_PHONE]
    pause = Unit(silence, int(model.plain[silence]), PAUSE, 0, 0)
    units = [pause]
    pauses = [0]
    firsts: list[tuple[int, ...]] = []
    lasts: list[tuple[int, ...]] = []
    links: list[tuple[int, int]] = []  # (unit, unit that may follow it)
    ends = [0]  # units after which the next word may begin
    for number, variants in enumerate(words):
        left = model.index[words[number - 1][0][-1]] if number else silence
        right = model.index[words[number + 1][0][0]] if number + 1 < len(words) else silence
        begun, finished = [], []
        for variant, phones in enumerate(variants):
            begun.append(len(units))
            units += _word_units(model, phones, left, right, number, variant)
            finished.append(len(units) - 1)
        links += [(end, first) for first in begun for end in ends]
        pauses.append(len(units))
        links += [(last, len(units)) for last in finished]
        ends = [*finished, len(units)]
        units.append(pause)
        firsts.append(tuple(begun))
        lasts.append(tuple(finished))
    states = STATES * len(units)
    entries, sources = _grouped([(b, a) for a, b in links], STATES - 1, states, to_first=True)
    exits, targets = _grouped(links, 0, states, to_first=False)
    return Network(
        tuple(units),
        len(words),
        model.sequences[[unit.sequence for unit in units]].reshape(-1),
        entries,
        sources,
        exits,
        targets,
        STATES * np.array([0, *(firsts[0] if firsts else ())]),
        STATES * np.array(ends) + STATES - 1,
        np.array(pauses),
        tuple(firsts),
        tuple(lasts),
    )


def _grouped(
    links: Sequence[tuple[int, int]], state: int, nowhere: int, *, to_first: bool
) -> tuple[Indices, Indices]:
    """States of the units that have links, and per each the `state`-th states of the other ends."""
    others: dict[int, list[int]] = {}
    for unit, other in links:
        others.setdefault(unit, []).append(STATES * other + state)
    at = 0 if to_first else STATES - 1
    own = np.array([STATES * unit + at for unit in sorted(others)], dtype=np.int64)
    table = np.full((len(others), max(map(len, others.values()), default=0)), nowhere)
    for row, unit in enumerate(sorted(others)):
        table[row, : len(others[unit])] = others[unit]
    return own, table


def _word_units(
    model: AcousticModel, phones: Sounds, left: int, right: int, word: int, variant: int
) -> list[Unit]:
    """A pronunciation's phones, each in the context of its neighbours."""
    base = [left, *(model.index[phone] for phone in phones), right]
    last = len(phones) - 1
    found = []
    for place, phone in enumerate(base[1:-1]):
        position = ALONE if not last else {0: FIRST, last: LAST}.get(place, INSIDE)
        sequence = model.sequence(phone, base[place], base[place + 2], position)
        found.append(Unit(phone, sequence, word, variant, place))
    return found
