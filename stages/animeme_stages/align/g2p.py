"""English words that are in no dictionary: their sounds by analogy with those that are.

A joint-sequence model (Bisani & Ney 2008, "Joint-sequence models for grapheme-to-phoneme
conversion"): each letter says no phone, one or two; words are sequences of such pairs, and an
n-gram model over pairs, interpolated with absolute discounting, says which are likely. It learns
from the CMU dictionary that comes with PocketSphinx, on first use, in two to four seconds: there
is no data file, and nothing is downloaded. What it gets right is in ``docs/alignment.md``.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from animeme.phones import ARPABET_TO_IPA

_Ints = NDArray[np.int64]
_Floats = NDArray[np.float64]
_Hashes = NDArray[np.uint64]

_LETTERS = "abcdefghijklmnopqrstuvwxyz'"
_PHONES = tuple(ARPABET_TO_IPA)
# What a letter may say: nothing, a phone, or two of them (x: K S).
_SINGLE = 1
_DOUBLE = _SINGLE + len(_PHONES)
_CHUNKS = _DOUBLE + len(_PHONES) ** 2

# Longer words are compounds and foreign names, which teach little.
_LONGEST = 16
# Rounds of alignment, on every 16th word; more change nothing.
_ROUNDS = 3
_SAMPLE = 16
_PARTS = 8
# A letter's sound that fewer words have is a slip of the alignment.
_RAREST = 4
_ORDER = 7
_DISCOUNT = 0.9
_BEAM = 24
# A second guess this much less likely than the first is offered too.
_SECOND = 0.5

_STEP = np.uint64(0x9E3779B97F4A7C15)


def align_letters(words: Sequence[tuple[str, tuple[str, ...]]]) -> list[_Ints]:
    """Which chunk of its phones each letter of a word says.

    Args:
        words: each with its phones.

    Returns:
        Chunk of each letter, shape (letters,), for each word; empty where there is no way.
    """
    sample = _Batch.of(words[::_SAMPLE])
    costs = _first_costs(sample)
    for _ in range(_ROUNDS):
        costs = _costs(sample, sample.chunks(costs))
    found: list[_Ints] = [np.zeros(0, np.int64)] * len(words)
    by_length = np.argsort([len(word) for word, _ in words], kind="stable")
    for part in np.array_split(by_length, _PARTS):  # less padding
        chunks = _Batch.of([words[index] for index in part]).chunks(costs)
        for index, row in zip(part, chunks, strict=True):
            found[index] = row[row >= 0]
    return found


@dataclass(frozen=True)
class _Batch:
    """Words as padded arrays.

    Attributes:
        letters: shape (N, longest), -1 beyond a word's end.
        phones: shape (N, most), -1 beyond its end.
    """

    letters: _Ints
    phones: _Ints

    @classmethod
    def of(cls, words: Sequence[tuple[str, tuple[str, ...]]]) -> _Batch:
        letter_of = {letter: index for index, letter in enumerate(_LETTERS)}
        phone_of = {phone: index for index, phone in enumerate(_PHONES)}
        letters = np.full((len(words), max(len(word) for word, _ in words)), -1)
        phones = np.full((len(words), max(2, *(len(said) for _, said in words))), -1)
        for row, (word, said) in enumerate(words):
            letters[row, : len(word)] = [letter_of[letter] for letter in word]
            phones[row, : len(said)] = [phone_of[phone] for phone in said]
        return cls(letters, phones)

    def chunks(self, costs: _Floats) -> _Ints:
        """The cheapest chunk of each letter, -1 beyond a word's end or where there is no way."""
        count, longest = self.letters.shape
        most = self.phones.shape[1]
        pairs = _DOUBLE + self.phones[:, :-1] * len(_PHONES) + self.phones[:, 1:]
        pairs[self.phones[:, 1:] < 0] = 0
        singles = _SINGLE + np.maximum(self.phones, 0)
        flat = costs.astype(np.float32).ravel()
        best = np.full((count, most + 1), np.inf, np.float32)
        best[:, 0] = 0
        steps = np.zeros((longest, count, most + 1), np.int8)
        for place in range(longest):
            row = self.letters[:, place, None] * _CHUNKS  # beyond a word's end unused
            onward = best + flat[row]
            one = best[:, :-1] + flat[row + singles]
            steps[place, :, 1:] = one < onward[:, 1:]
            np.minimum(onward[:, 1:], one, out=onward[:, 1:])
            two = best[:, :-2] + flat[row + pairs]
            steps[place, :, 2:][two < onward[:, 2:]] = 2
            np.minimum(onward[:, 2:], two, out=onward[:, 2:])
            best = np.where(row >= 0, onward, best)
        rows = np.arange(count)
        left = (self.phones >= 0).sum(1)
        possible = np.isfinite(best[rows, left])
        found = np.full((count, longest), -1)
        for place in range(longest - 1, -1, -1):
            active = possible & (self.letters[:, place] >= 0)
            taken = np.where(active, steps[place, rows, left], 0)
            chunk = np.where(taken == 1, singles[rows, np.maximum(left - 1, 0)], 0)
            chunk = np.where(taken == 2, pairs[rows, np.clip(left - 2, 0, most - 2)], chunk)
            found[:, place] = np.where(active, chunk, -1)
            left = left - taken
        return found


def _first_costs(batch: _Batch) -> _Floats:
    """Costs before anything is aligned: how often letter and phone stand at like places."""
    counts = np.zeros((len(_LETTERS), len(_PHONES)))
    lengths = (batch.letters >= 0).sum(1), (batch.phones >= 0).sum(1)
    for place in range(batch.letters.shape[1]):
        rows = np.flatnonzero(batch.letters[:, place] >= 0)
        near = np.round(place * (lengths[1][rows] - 1) / np.maximum(lengths[0][rows] - 1, 1))
        for shift in (-1, 0, 1):
            at = np.clip(near + shift, 0, lengths[1][rows] - 1).astype(int)
            np.add.at(counts, (batch.letters[rows, place], batch.phones[rows, at]), 1)
    likely = np.log((counts + 1) / (counts + 1).sum(1, keepdims=True))
    # Two phones by one letter are the exception.
    double = (likely[:, :, None] + likely[:, None, :] - 3.0).reshape(len(_LETTERS), -1)
    silent = np.full((len(_LETTERS), 1), -4.0)
    return -np.concatenate([silent, likely, double], axis=1)


def _costs(batch: _Batch, chunks: _Ints) -> _Floats:
    counts = np.zeros((len(_LETTERS), _CHUNKS))
    used = chunks >= 0
    np.add.at(counts, (batch.letters[used], chunks[used]), 1)
    costs: _Floats = -np.log((counts + 0.01) / (counts + 0.01).sum(1, keepdims=True))
    return costs


@dataclass(frozen=True)
class _Order:
    """N-grams of one length, by hash.

    Attributes:
        keys, counts: of each n-gram, sorted by key.
        contexts: hash of each n-gram without its last pair, sorted.
        totals, kinds: how many n-grams, and how many different ones, begin with each.
    """

    keys: _Hashes
    counts: _Floats
    contexts: _Hashes
    totals: _Floats
    kinds: _Floats


@dataclass(frozen=True)
class Guesser:
    """A trained model.

    Attributes:
        orders: n-grams of 1, 2 … pairs.
        options: letter → (chunk, pair) of each sound that it has.
        values: hash of each pair; pair 0 is a word's edge.
    """

    orders: tuple[_Order, ...]
    options: Mapping[str, tuple[_Ints, _Ints]]
    values: _Hashes

    @classmethod
    def train(cls, words: Sequence[tuple[str, tuple[str, ...]]]) -> Guesser:
        """Learn from words with their phones in ARPAbet."""
        usable = [
            (word, said)
            for word, said in words
            if len(word) <= _LONGEST and set(word) <= set(_LETTERS) and len(said) <= 2 * len(word)
        ]
        found = align_letters(usable)
        lengths = np.array([len(chunks) for chunks in found])
        letters = np.concatenate(
            [
                [_LETTERS.index(letter) for letter in word]
                for (word, _), chunks in zip(usable, found, strict=True)
                if len(chunks)
            ]
        )
        codes = letters * _CHUNKS + np.concatenate(found)
        kinds, pairs, counts = np.unique(codes, return_inverse=True, return_counts=True)
        rare = counts[pairs] < _RAREST
        # A word with a slip teaches nothing.
        owner = np.repeat(np.arange(len(lengths)), lengths)
        kept = ~np.isin(owner, owner[rare])
        sequence, places = _edged(pairs[kept] + 1, owner[kept])
        values = _hashes(len(kinds) + 1)
        options = {}
        for index, letter in enumerate(_LETTERS):
            own = np.flatnonzero((kinds // _CHUNKS == index) & (counts >= _RAREST))
            options[letter] = (kinds[own] % _CHUNKS, own + 1)
        return cls(_orders(sequence, places, values), options, values)

    def guess(self, word: str) -> tuple[tuple[str, ...], ...]:
        """Phones of a word of the letters a to z and the apostrophe, the likeliest first.

        Returns:
            One pronunciation, or a second that is nearly as likely; () if no letter has a sound.
        """
        scores = np.zeros(1)
        contexts = np.zeros((1, len(self.orders)), np.uint64)
        contexts[:, 1:2] = self.values[0]
        depths = np.ones(1, np.int64)
        said: list[tuple[int, ...]] = [()]
        for letter in word:
            chunks, pairs = self.options[letter]
            likely, onward = self._extend(contexts, depths, pairs)
            total = scores[:, None] + likely
            chosen = np.argsort(-total, axis=None, kind="stable")[:_BEAM]
            before, option = np.unravel_index(chosen, total.shape)
            scores = total[before, option]
            contexts = onward[before, option]
            depths = np.minimum(depths[before] + 1, len(self.orders) - 1)
            said = [(*said[b], int(chunks[o])) for b, o in zip(before, option, strict=True)]
        likely, _ = self._extend(contexts, depths, np.zeros(1, np.int64))
        scores = scores + likely[:, 0]
        ranked: dict[tuple[str, ...], float] = {}
        for index in np.argsort(-scores, kind="stable"):
            phones = tuple(_spell(said[index]))
            if phones:
                ranked.setdefault(phones, float(scores[index]))
        best = max(ranked.values(), default=0.0)
        return tuple(p for p, s in ranked.items() if s >= best + np.log(_SECOND))[:2]

    def _extend(self, contexts: _Hashes, depths: _Ints, pairs: _Ints) -> tuple[_Floats, _Hashes]:
        """Log probability of each pair after each history, and the histories that follow.

        Args:
            contexts: hash of the last 0, 1 … pairs of each history, shape (H, orders).
            depths: how many pairs each history has.
            pairs: shape (P,).

        Returns:
            Shapes (H, P) and (H, P, orders).
        """
        chance = np.full((len(contexts), len(pairs)), 1.0 / len(self.values))
        onward = np.zeros((*chance.shape, len(self.orders)), np.uint64)
        for size, order in enumerate(self.orders):
            keys = contexts[:, size, None] * _STEP + self.values[pairs]
            count = _look_up(order.keys, order.counts, keys)
            total = _look_up(order.contexts, order.totals, contexts[:, size])[:, None]
            kinds = _look_up(order.contexts, order.kinds, contexts[:, size])[:, None]
            known = (total > 0) & (depths >= size)[:, None]
            backed = np.maximum(count - _DISCOUNT, 0) + _DISCOUNT * kinds * chance
            chance = np.where(known, backed / np.maximum(total, 1), chance)
            if size + 1 < len(self.orders):
                onward[:, :, size + 1] = keys
        return np.log(chance), onward


def _edged(pairs: _Ints, owner: _Ints) -> tuple[_Ints, _Ints]:
    """All words in one row with an edge before each and after the last, and places in a word."""
    first = np.flatnonzero(np.diff(owner, prepend=-1))
    sequence = np.append(np.insert(pairs, first, 0), 0)
    edges = np.flatnonzero(sequence == 0)
    index = np.arange(len(sequence))
    # An edge ends the word before it: its place is behind that word's last pair.
    starts = np.concatenate([[0], edges[np.searchsorted(edges, index[1:]) - 1]])
    return sequence, index - starts


_Grams = tuple[_Ints, _Hashes, _Hashes]
"""Where n-grams of one length end, their hashes, and those of what precedes their last pair."""


def _orders(sequence: _Ints, places: _Ints, values: _Hashes) -> tuple[_Order, ...]:
    """Counts of all n-grams within words; of shorter ones, how many different pairs precede them.

    (Kneser & Ney 1995, "Improved backing-off for m-gram language modeling").
    """
    made: list[_Order] = []
    hashes = values[sequence]
    context = np.zeros_like(hashes)
    held: _Grams | None = None
    for size in range(_ORDER):
        at = np.flatnonzero(places >= max(size, 1))
        grams = (at, hashes[at], context[at])
        if held is not None:
            made.append(_order(*_continued(held, grams, places, size - 1)))
        held = grams
        context = np.concatenate([[np.uint64(0)], hashes[:-1]])
        hashes = context * _STEP + values[sequence]
    assert held is not None
    made.append(_order(held[1], held[2]))
    return tuple(made)


def _continued(grams: _Grams, longer: _Grams, places: _Ints, size: int) -> tuple[_Hashes, _Hashes]:
    """N-grams once for each different pair before them; those that open a word as they are."""
    at, keys, before = grams
    _, first = np.unique(longer[1], return_index=True)
    opening = at[places[at] == size] if size else at[:0]
    chosen = np.searchsorted(at, np.concatenate([longer[0][first], opening]))
    return keys[chosen], before[chosen]


def _order(keys: _Hashes, before: _Hashes) -> _Order:
    unique, first, counts = np.unique(keys, return_index=True, return_counts=True)
    contexts, kind_of = np.unique(before[first], return_inverse=True)
    totals = np.bincount(kind_of, counts).astype(np.float64)
    kinds = np.bincount(kind_of).astype(np.float64)
    return _Order(unique, counts.astype(np.float64), contexts, totals, kinds)


def _hashes(count: int) -> _Hashes:
    """A number for each pair that makes sums of them unique (SplitMix64, Steele et al. 2014)."""
    mixed = np.arange(1, count + 1, dtype=np.uint64) * _STEP
    mixed = (mixed ^ (mixed >> np.uint64(30))) * np.uint64(0xBF58476D1CE4E5B9)
    mixed = (mixed ^ (mixed >> np.uint64(27))) * np.uint64(0x94D049BB133111EB)
    return mixed ^ (mixed >> np.uint64(31))


def _look_up(keys: _Hashes, values: _Floats, wanted: _Hashes) -> _Floats:
    """The value of each key that is wanted, 0 where there is none."""
    place = np.minimum(np.searchsorted(keys, wanted), len(keys) - 1)
    found: _Floats = np.where(keys[place] == wanted, values[place], 0.0)
    return found


def _spell(chunks: Iterable[int]) -> Iterable[str]:
    for chunk in chunks:
        if chunk >= _DOUBLE:
            yield from (_PHONES[part] for part in divmod(chunk - _DOUBLE, len(_PHONES)))
        elif chunk >= _SINGLE:
            yield _PHONES[chunk - _SINGLE]
