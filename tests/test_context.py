"""What models know of a phone's surroundings: questions of trees, and linear trends."""

from __future__ import annotations

import copy
import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from animeme.phones import Phone, PhoneTrack
from animeme_stages.synthesize.context import Question, Questionnaire, distances
from animeme_stages.synthesize.dam import Dam
from animeme_stages.synthesize.spoken import Spoken, legendre, pairs_of, spoken
from animeme_stages.synthesize.trees import Forest
from animeme_stages.synthesize.trends import PLACES, Trends, learn_trends
from support.motion import captured, captured_line

FIXTURE = Path(__file__).parent / "fixtures" / "model-dam-trends.1.json"


def said(*parts: tuple[str, float]) -> PhoneTrack:
    ends = np.cumsum([length for _, length in parts]).round(6).tolist()
    made = zip(parts, [0.0, *ends[:-1]], ends, strict=True)
    return PhoneTrack("en", "ipa", tuple(Phone(symbol, a, b) for (symbol, _), a, b in made))


# Seconds: the pause ends at 0.3, /m/ at 0.4, /u/ at 0.5, /s/ at 0.7, /ɑ/ at 1, the pause at 1.4.
FIRST = said(("sil", 0.3), ("m", 0.1), ("u", 0.1), ("s", 0.2), ("ɑ", 0.3), ("sil", 0.4))
SECOND = said(("t", 0.2), ("i", 0.2))


def test_distances_are_those_of_the_own_track() -> None:
    found = distances(spoken([FIRST, SECOND]))
    #            start end  vowel−  +    lips−  +    pause− +    pace
    np.testing.assert_allclose(
        found[:6],
        [
            [0.0, 1.1, 2.0, 0.1, 2.0, 0.0, 2.0, 0.7, 0.175],
            [0.3, 1.0, 2.0, 0.0, 2.0, 2.0, 0.0, 0.6, 0.175],
            [0.4, 0.9, 2.0, 0.2, 0.0, 2.0, 0.1, 0.5, 0.175],
            [0.5, 0.7, 0.0, 0.0, 0.1, 2.0, 0.2, 0.3, 0.175],
            [0.7, 0.4, 0.2, 2.0, 0.3, 2.0, 0.4, 0.0, 0.175],
            [1.0, 0.0, 0.0, 2.0, 0.6, 2.0, 0.7, 2.0, 0.175],
        ],
        atol=1e-9,
    )
    np.testing.assert_allclose(found[6:, :4], [[0, 0.2, 2, 0], [0.2, 0, 2, 2]], atol=1e-9)


def test_questions_about_vowels_look_past_consonants() -> None:
    asked = [
        Question("vowel", 1, "ɑ"),
        Question("vowel", -1, "u"),
        Question("vowel", -1, "edge"),
        Question("farther", 1, "", 0.8),
    ]
    answers = Questionnaire(asked, ("m", "s", "sil", "u", "ɑ")).answers(spoken([FIRST]))
    yes = [[2, 3], [3, 4], [0, 1, 2], [0, 1, 2]]
    for column, expected in zip(answers.T, yes, strict=True):
        assert np.flatnonzero(column).tolist() == expected


@pytest.mark.parametrize(
    "entry",
    [
        ["vowel", 0, "u", 0],
        ["vowel", 1, "nobody", 0],
        ["farther", 9, "", 0.1],
        ["nearer", 0, "", 1],
    ],
)
def test_questions_that_make_no_sense_are_refused(entry: list[Any]) -> None:
    with pytest.raises(ValueError, match="a tree asks"):
        Question.from_json(entry, frozenset({"u"}))


def test_trends_find_what_depends_on_length_and_neighbours() -> None:
    """A control that is a phone's log length plus 1 before /m/ is followed on other lines."""
    rng = np.random.default_rng(4)
    tracks = [
        said(*((str(s), float(rng.uniform(0.05, 0.3))) for s in rng.choice(["m", "ɑ", "s"], 30)))
        for _ in range(12)
    ]
    seen, new = spoken(tracks[:10]), spoken(tracks[10:])

    def moved(phones: Spoken) -> tuple[Any, Any]:
        """Each phone's unit, and the level that it holds."""
        unit = np.array([["m", "s", "ɑ"].index(symbol) for symbol in phones.symbols])
        after = phones.neighbour(1)
        return unit, np.log(phones.length_s) + (after >= 0) * (unit[after] == 0)

    unit, level = moved(seen)
    times_s = seen.start_s + 0.5 * seen.length_s
    pairs = pairs_of(seen, times_s, reach=np.zeros(len(unit)), hold_s=1.0, seconds=True)
    basis, weight = legendre(pairs.local, 0, 0.3), np.ones(len(pairs.phone))
    trends = learn_trends(pairs, weight, basis, seen, unit, 3, level[:, None], 1e-3)
    assert trends.row.shape == (3, PLACES)
    unit, level = moved(new)
    found = trends.coefficients(new, unit)[:, 0, 0]
    assert np.ptp(level) > 2
    assert np.abs(found - level).max() < 0.1


def test_lengths_never_seen_count_as_the_nearest_seen() -> None:
    model = Dam.configured({"rounds": 2, "depth": 2, "leaf": 5}).fit(captured(lines=10))
    long, longer = (
        spoken([said(("sil", 0.3), ("ɑ", length_s), ("sil", 0.3))]) for length_s in (5.0, 500.0)
    )
    first, second = (model.trends_.coefficients(p, model.rows(p.symbols)) for p in (long, longer))
    np.testing.assert_array_equal(first, second)


def test_leaves_and_effects_are_whole_steps() -> None:
    """What is in memory is what is in the document, bit by bit."""
    model = Dam.configured({"rounds": 3, "depth": 2, "leaf": 5}).fit(captured(lines=10))
    learned = json.loads(json.dumps(model.to_document()))["learned"]
    shape = model.forest_.leaves.shape[2:]
    forest = Forest.from_json(
        learned, depth=2, shape=shape, questions=len(model.questions_.questions)
    )
    np.testing.assert_array_equal(forest.leaves, model.forest_.leaves)
    trends = Trends.from_json(learned["trends"], len(model.seen_), shape)
    np.testing.assert_array_equal(trends.effects, model.trends_.effects)
    assert np.abs(trends.effects).max() > 0


def test_the_frozen_document_with_trends_still_moves_as_it_did() -> None:
    entry = json.loads(FIXTURE.read_text(encoding="utf-8"))
    loaded = Dam.from_document(entry["document"])
    curves = loaded.synthesize(captured_line(7).track, rate_hz=25)
    np.testing.assert_allclose(curves.weights, np.array(entry["weights"]), atol=1e-9)
    assert loaded.to_document() == entry["document"]


@pytest.mark.parametrize(
    ("path", "value"),
    [
        (("leaves", "step"), [0.0, 1.0, 1.0]),
        (("leaves", "step"), [1.0]),
        (("leaves", "counts"), [[1]]),
        (("trends", "row"), [[0]]),
        (("trends", "row", 0, 0), 10**6),
        (("trends", "step"), [-1.0, 1.0, 1.0]),
        (("trends", "counts", 0, 0, 0), "__import__('os')"),
        (("trends", "limits"), []),
        (("trends",), {}),
        (("trends",), [1]),
    ],
)
def test_broken_tables_are_refused(path: tuple[Any, ...], value: Any) -> None:
    document = copy.deepcopy(json.loads(FIXTURE.read_text(encoding="utf-8"))["document"])
    part = document["learned"]
    for key in path[:-1]:
        part = part[key]
    part[path[-1]] = value
    with pytest.raises(ValueError, match=r"."):
        Dam.from_document(document)
