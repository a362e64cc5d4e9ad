"""The exact search against a plain one, and the acoustic model's own parts."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from animeme_stages.align.acoustic.features import active, features, levels_db
from animeme_stages.align.acoustic.hear import UnsayableError, hear
from animeme_stages.align.acoustic.model import SILENCE_PHONE, STATES, acoustic_model
from animeme_stages.align.acoustic.network import PAUSE, Network, network
from animeme_stages.align.acoustic.pieces import LONGEST, pieces
from animeme_stages.align.acoustic.rivals import PRICES, rivals
from animeme_stages.align.acoustic.search import Scores, search
from animeme_stages.align.cmudict import in_dictionary, pronunciations
from animeme_stages.align.language import language

MODEL = acoustic_model()
PHONES = sorted(set(MODEL.phones) - {"SIL", "+NSN+", "+SPN+"})
WORD = st.lists(
    st.lists(st.sampled_from(PHONES), min_size=1, max_size=3).map(tuple), min_size=1, max_size=3
)
# Nats that a phone more costs on the free path, as docs/alignment.md says.
NEW_PHONE = -6.0


def random_scores(net: Network, frames: int, seed: int) -> Scores:
    chance = np.random.default_rng(seed)
    plain = chance.normal(0, 5, (frames, STATES * len(MODEL.phones))).astype(np.float32)
    return Scores(chance.normal(0, 5, (frames, len(net.senones))).astype(np.float32), plain)


def best_score(net: Network, scores: np.ndarray, skipped: int | None = None) -> float:
    """The best path's score, state by state and arc by arc; without one word if `skipped`."""
    size = len(net.senones)
    stay = [float(MODEL.stay[net.units[s // STATES].phone, s % STATES]) for s in range(size)]
    leave = [float(MODEL.leave[net.units[s // STATES].phone, s % STATES]) for s in range(size)]
    arcs = {s: [s - 1] for s in range(size) if s % STATES}
    for unit, each in enumerate(net.units):
        if each.word != PAUSE and each.place:
            arcs[STATES * unit] = [STATES * unit - 1]
    final = set(ends_before(net, net.words, skipped))
    begin = {0}
    for word in range(net.words):
        if word == skipped:
            continue
        before = ends_before(net, word, skipped)
        for unit in net.firsts[word]:
            arcs[STATES * unit] = [STATES * u + STATES - 1 for u in before]
            if all(w == skipped for w in range(word)):
                begin.add(STATES * unit)
        arcs[STATES * int(net.pauses[word + 1])] = [
            STATES * u + STATES - 1 for u in net.lasts[word]
        ]
    value = {s: float(scores[0, s]) if s in begin else -np.inf for s in range(size)}
    for t in range(1, len(scores)):
        value = {
            s: float(scores[t, s])
            + max(value[s] + stay[s], *(value[p] + leave[p] for p in arcs.get(s, [])), -np.inf)
            for s in range(size)
        }
    return max(value[STATES * u + STATES - 1] for u in final)


def ends_before(net: Network, word: int, skipped: int | None) -> list[int]:
    """Units after which `word` may begin."""
    last = word - 1 if word - 1 != skipped else word - 2
    pause = int(net.pauses[last + 1])
    return [pause, *(net.lasts[last] if last >= 0 else ())]


@given(st.lists(WORD, min_size=1, max_size=4), st.integers(0, 40), st.integers(0, 10_000))
@settings(deadline=None, derandomize=True, max_examples=60)
def test_the_search_finds_what_trying_every_arc_finds(words, extra, seed) -> None:
    net = network(MODEL, words)
    shortest = STATES * sum(min(map(len, variants)) for variants in words)
    scores = random_scores(net, shortest + extra, seed)
    found = search(MODEL, net, scores)
    assert found.best == pytest.approx(best_score(net, scores.states), rel=1e-4, abs=1e-2)
    assert len(found.path) == len(scores.states)
    said = [net.units[s // STATES].word for s in found.path]
    assert [w for i, w in enumerate(said) if w >= 0 and (not i or said[i - 1] != w)] == list(
        range(net.words)
    )


@given(st.lists(WORD, min_size=2, max_size=4), st.integers(0, 10_000))
@settings(deadline=None, derandomize=True, max_examples=40)
def test_a_rival_without_a_word_is_the_best_path_without_it(words, seed) -> None:
    net = network(MODEL, words)
    frames = STATES * sum(max(map(len, variants)) for variants in words) + 20
    scores = random_scores(net, frames, seed)
    found = search(MODEL, net, scores)
    gains = rivals(net, scores, found).without
    for word in range(net.words):
        without = best_score(net, scores.states, skipped=word)
        # It pays nothing for leaving the word before, and may pause on both sides.
        assert gains[word] >= without - found.best - 0.1


def test_rivals_see_what_is_said_instead() -> None:
    net = network(MODEL, [[("B", "AA")], [("S", "IY")], [("M", "UW")]])
    frames = 90
    states = np.full((frames, len(net.senones)), -20.0, np.float32)
    plain = np.full((frames, STATES * len(MODEL.phones)), -40.0, np.float32)
    word = np.array([unit.word for unit in net.units]).repeat(STATES)
    for number, (start, end) in enumerate([(0, 30), (30, 60), (60, 90)]):
        states[start:end, word == number] = -1.0
    right = rivals(net, Scores(states, plain), search(MODEL, net, Scores(states, plain)))
    assert right.without.max() < 0
    assert right.instead.max() < 0
    assert right.between.max() < 0
    # The middle of the recording is some other phone: the word there is in doubt, no other.
    states[30:60, word == 1] = -20.0
    other = STATES * MODEL.index["EY"]
    plain[30:60, other : other + STATES] = -1.0
    wrong = rivals(net, Scores(states, plain), search(MODEL, net, Scores(states, plain)))
    column = PRICES.index(2.0)
    assert wrong.instead[1, column] > 300
    assert wrong.instead[[0, 2], column].max() < wrong.instead[1, column]


@given(st.integers(1, 400), st.integers(0, 9000), st.integers(0, 10_000))
@settings(deadline=None, derandomize=True, max_examples=15)
def test_pieces_cover_the_recording_and_every_word_once(count, extra, seed) -> None:
    words = [[("AA",)] if i % 3 else [("B", "IY")] for i in range(count)]
    frames = 6 * STATES * count + extra
    chance = np.random.default_rng(seed)

    def score(start: int, end: int, net: Network, _: int) -> Scores:
        states = chance.normal(0, 3, (end - start, len(net.senones))).astype(np.float32)
        return Scores(states, np.zeros((end - start, STATES * len(MODEL.phones)), np.float32))

    found = list(pieces(MODEL, words, frames, score))
    assert (found[0].start, found[0].first) == (0, 0)
    assert (found[-1].end, found[-1].last) == (frames, count)
    for one, other in pairwise(found):
        assert (one.end, one.last) == (other.start, other.first)
    assert all(piece.start < piece.end for piece in found)
    assert all(piece.end - piece.start <= LONGEST + 1000 for piece in found)


def test_words_that_are_said_early_in_a_long_recording_are_offered_early() -> None:
    names = ["B", "IY", "S", "AA", "M", "T"]
    words = [[(names[i % 6], names[(i // 6) % 6], names[i // 36])] for i in range(150)]
    said, frames = 30 * 150, 60_000  # 45 s of words, then 555 s of nothing

    def score(start: int, end: int, net: Network, first: int) -> Scores:
        at = np.arange(start, end)
        right = np.where(at < said, at // 30, PAUSE)
        number = [unit.word + first if unit.word != PAUSE else PAUSE for unit in net.units]
        states = np.where(right[:, None] == np.repeat(number, STATES), -1.0, -9.0)
        return Scores(
            states.astype(np.float32),
            np.full((end - start, STATES * len(MODEL.phones)), -9.0, np.float32),
        )

    for piece in pieces(MODEL, words, frames, score):
        assert piece.first == min(round(piece.start / 30), 150)
        assert piece.last == min(round(piece.end / 30), 150)


def test_a_word_may_last_to_the_end_of_a_long_recording() -> None:
    def score(start: int, end: int, net: Network, _: int) -> Scores:
        states = np.full((end - start, len(net.senones)), -1.0, np.float32)
        for pause in net.pauses:
            states[:, STATES * pause : STATES * (pause + 1)] = -99.0
        return Scores(states, np.zeros((end - start, STATES * len(MODEL.phones)), np.float32))

    found = list(pieces(MODEL, [[("AA",)]], LONGEST + 100, score))
    assert [(piece.start, piece.end, piece.last) for piece in found] == [(0, LONGEST + 100, 1)]


def test_features_do_not_depend_on_how_a_recording_is_worked_on(monkeypatch) -> None:
    noise = np.random.default_rng(0).normal(0, 900, 40_000).astype(np.int16)
    counted = active(levels_db(noise))
    whole = [levels_db(noise), *features(noise, counted)]
    monkeypatch.setattr("animeme_stages.align.acoustic.features._BLOCK", 7)
    for part, all_at_once in zip([levels_db(noise), *features(noise, counted)], whole, strict=True):
        np.testing.assert_allclose(part, all_at_once, atol=1e-4)


def test_far_too_many_words_are_refused_before_any_work(monkeypatch) -> None:
    def never(*_: object, **__: object) -> None:
        raise AssertionError("it searched")

    monkeypatch.setattr("animeme_stages.align.acoustic.hear.score", never)
    with pytest.raises(UnsayableError):
        hear(MODEL, np.ones(16_000, np.int16), [[("B", "AA", "T")]] * 3000)


@pytest.mark.parametrize("samples", [1, 409, 410, 411, 1600])
@pytest.mark.parametrize("level", [0, 32767])
def test_any_recording_has_finite_features(samples: int, level: int) -> None:
    padded = np.pad(np.full(samples, level, np.int16), (0, max(0, 410 - samples)))
    counted = active(levels_db(padded))
    assert counted.any()
    for stream in features(padded, counted):
        assert np.isfinite(stream).all()


def test_words_that_do_not_fit_in_are_refused() -> None:
    noise = np.random.default_rng(0).normal(0, 900, 8000).astype(np.int16)
    hear(MODEL, noise, [[("AA",)]])
    with pytest.raises(UnsayableError):
        hear(MODEL, noise, [[("B", "AA", "T")]] * 20)


def test_the_model_is_whole() -> None:
    assert len(MODEL.phones) == 42
    assert SILENCE_PHONE in MODEL.index
    assert (np.exp(MODEL.stay) + np.exp(MODEL.leave)).max() <= 1.0001
    for mixture in MODEL.mixtures:
        assert mixture.min() >= 0


def test_british_english_is_offered_beside_american() -> None:
    english = language("en")

    def said(word: str) -> set[str]:
        found = pronunciations(word, english)
        return {" ".join(sound for _, group in each for sound in group) for each in found}

    assert {"Z IY", "Z EH D"} <= said("z")
    assert {"F AO R", "F AO"} <= said("four")
    assert {"N OW", "N AH UH"} == said("no")
    assert "K AE R IY" not in said("carry") or "K AE IY" not in said("carry")
    assert "AH N" in said("in")
    assert {symbol for each in pronunciations("no", english) for symbol, _ in each} == {"N", "OW"}
    assert not in_dictionary("xyzzyx")
    with pytest.raises(KeyError):
        pronunciations("xyzzyx", english)
