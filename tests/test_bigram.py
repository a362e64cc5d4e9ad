"""Bigrams against cases worked by hand (2013 paper, section 2.2)."""

from __future__ import annotations

import numpy as np
import pytest

from animeme.phones import ARPABET_TO_IPA, SILENCE, Phone, PhoneTrack
from animeme_stages.synthesize.bigram import Bigram, missing_pairs
from animeme_stages.synthesize.bigram_passes import (
    limit_speed,
    resolve,
    run_passes,
    segments,
    smooth,
    stitch,
)
from animeme_stages.synthesize.bigram_set import COMMON, LOCAL, PAUSE, BigramSet, spline
from support.motion import captured

PAPER = {frozenset({"open", pose}): 0.5 for pose in ("FV", "PBM", "ShCh")}
PRIORITY = ("open", "W", "wide", "ShCh", "FV", "PBM")


def made(polygons: dict[str, dict[str, list[tuple[float, float]]]]) -> BigramSet:
    return BigramSet(polygons, tuple(sorted({c for curves in polygons.values() for c in curves})))


def weights(set_: BigramSet, track: PhoneTrack, times_s: list[float]) -> np.ndarray:
    return stitch(set_, segments(track), np.array(times_s)).weights[:, 0]


def origins(set_: BigramSet, track: PhoneTrack, times_s: list[float]) -> list[str]:
    names = [set_.class_of(symbol) for symbol in segments(track).symbols]
    pairs = stitch(set_, segments(track), np.array(times_s)).pair[:, 0].tolist()
    return [set_.source(names[pair], names[pair + 1]) for pair in pairs]


def test_common_phones() -> None:
    """Table 1: forty phones to twenty-one."""
    assert len(COMMON) == 21
    classify = BigramSet({}, ()).class_of
    found = {symbol: classify(ipa) for symbol, ipa in ARPABET_TO_IPA.items()}
    assert found["P"] == found["B"] == found["M"] == "bmp"
    assert found["CH"] == found["Y"] == "sh"
    assert found["NG"] == "d"
    assert found["IY"] == "ih"
    assert classify(SILENCE) == PAUSE
    assert classify("ʏ") in COMMON
    assert classify("ɱ") == "f"


def test_a_straight_polygon_is_a_straight_curve() -> None:
    points = [(t, 0.2 + 0.6 * t) for t in (0.0, 0.2, 0.5, 0.7, 1.0)]
    times, weights = zip(*points, strict=True)
    np.testing.assert_allclose(spline(times, weights), 0.2 + 0.6 * LOCAL, atol=1e-3)


def test_a_curve_stays_within_its_polygon() -> None:
    curve = spline([0, 0.3, 0.6, 1.0], [0.0, 1.0, 1.0, 0.0])
    assert curve[0] == curve[-1] == 0.0
    assert 0.6 < curve.max() < 1.0


def test_stitching_takes_the_larger() -> None:
    """c(t) = max(c_i(t), c_{i+1}(t)) where two bigrams overlap, and says whose it is."""
    polygons = {
        "_|aa": {"open": [(0.0, 0.1), (1.0, 0.1)]},
        "aa|d": {"open": [(0.0, 0.4), (1.0, 0.4)]},
        "d|_": {"open": [(0.0, 0.2), (1.0, 0.2)]},
    }
    track = PhoneTrack("en", "arpabet", (Phone("AA", 0, 0.2), Phone("D", 0.2, 0.4)))
    times_s = [0.0, 0.1, 0.25, 0.39]
    higher = made(polygons)
    np.testing.assert_allclose(weights(higher, track, times_s), [0.4, 0.4, 0.4, 0.4])
    assert origins(higher, track, times_s)[1] == "aa|d"
    lower = made({**polygons, "aa|d": {"open": [(0.0, 0.0), (1.0, 0.0)]}})
    np.testing.assert_allclose(weights(lower, track, times_s), [0.1, 0.1, 0.2, 0.2])
    assert origins(lower, track, times_s) == ["_|aa", "_|aa", "d|_", "d|_"]


def test_a_pair_is_warped_over_both_phones() -> None:
    set_ = made({"aa|d": {"open": [(0.0, 0.0), (1.0, 1.0)]}, "_|aa": {}, "d|_": {}})
    track = PhoneTrack("en", "arpabet", (Phone("AA", 0, 0.3), Phone("D", 0.3, 0.4)))
    times_s = [0.0, 0.1, 0.3, 0.39]
    np.testing.assert_allclose(weights(set_, track, times_s), np.array(times_s) / 0.4, atol=2e-3)


def test_a_held_phone_rests_in_its_middle() -> None:
    """With 0.2 s to move in, a phone of 1 s moves 0.1 s at either end: /d/ starts 0.2 into it."""
    set_ = made({"aa|d": {"open": [(0.0, 0.0), (1.0, 1.0)]}, "_|aa": {}, "d|_": {}})
    track = PhoneTrack("en", "arpabet", (Phone("AA", 0, 1.0), Phone("D", 1.0, 1.2)))
    parts = segments(track, hold_s=0.2)
    found = stitch(set_, parts, np.array([0.05, 0.1, 0.5, 0.9, 1.0, 1.1])).weights[:, 0]
    np.testing.assert_allclose(found, np.array([0.05, 0.1, 0.1, 0.1, 0.2, 0.3]) / 0.4, atol=2e-3)


def test_smoothing_joins_near_maxima_only() -> None:
    times_s = np.arange(9) * 0.1
    curve = np.array([0, 1, 0.2, 0.8, 0, 0, 0, 1, 0], dtype=float)
    joined = smooth(times_s, curve, 0.25)
    np.testing.assert_allclose(joined, [0, 1, 0.9, 0.8, 0, 0, 0, 1, 0])
    np.testing.assert_array_equal(smooth(times_s, curve, 0.0), curve)


def test_smoothing_joins_every_two_maxima_of_a_window() -> None:
    """Joined to both neighbours, the low one in the middle is a valley that goes too."""
    times_s = np.arange(7) * 0.1
    curve = np.array([0, 1, 0, 0.2, 0, 0.8, 0], dtype=float)
    np.testing.assert_allclose(smooth(times_s, curve, 0.4), [0, 1, 0.95, 0.9, 0.85, 0.8, 0])
    # Each is within 0.2 s of its neighbour, and the outer two are not of each other.
    np.testing.assert_allclose(smooth(times_s, curve, 0.2), [0, 1, 0.6, 0.2, 0.5, 0.8, 0])


def test_conflicting_poses_give_way_by_priority() -> None:
    """C(open, PBM) = 0.5, open has less priority: it falls to what is left."""
    poses = ("open", "PBM", "wide")
    curves = np.array([[0.8, 0.3, 0.4], [0.1, 0.3, 0.4], [0.9, 0.9, 0.9]])
    found = resolve(curves, poses, PAPER, PRIORITY)
    np.testing.assert_allclose(found[0], [0.2, 0.3, 0.4])
    np.testing.assert_allclose(found[1], curves[1])
    np.testing.assert_allclose(found[2], [0.0, 0.9, 0.9])
    np.testing.assert_array_equal(resolve(curves, poses, {}, ()), curves)


def test_other_poses_add_up_to_two() -> None:
    """C(a, b) = 2 for all other pairs; wide goes before W, PBM before wide."""
    found = resolve(np.array([[1.3, 1.2, 0.9]]), ("W", "wide", "PBM"), PAPER, PRIORITY)
    np.testing.assert_allclose(found, [[0.9, 1.1, 0.9]])


def test_speed_is_limited_both_ways() -> None:
    times_s = np.arange(6) * 0.1
    curve = np.array([0, 0, 1, 1, 0, 0], dtype=float)[:, None]
    found = limit_speed(times_s, curve, 4.0)[:, 0]
    np.testing.assert_allclose(found, [0, 0, 0.4, 0.4, 0, 0], atol=1e-12)
    assert np.abs(np.diff(found)).max() <= 4.0 * 0.1 + 1e-12


def test_passes_come_in_the_papers_order() -> None:
    """Smoothing lifts the valley in which the lips meet, the conflict takes it away again."""
    set_ = BigramSet(
        {
            "_|aa": {"open": [(0.0, 0.0), (0.5, 0.0), (0.75, 0.8), (1.0, 0.0)]},
            "aa|bmp": {"PBM": [(0.0, 0.0), (0.5, 0.0), (0.75, 2.0), (1.0, 0.0)]},
            "bmp|aa": {},
            "aa|_": {"open": [(0.0, 0.0), (0.25, 0.8), (0.5, 0.0), (1.0, 0.0)]},
        },
        ("open", "PBM"),
        limits=PAPER,
        priority=PRIORITY,
    )
    phones = [Phone(s, i * 0.1, (i + 1) * 0.1) for i, s in enumerate(("AA", "B", "AA"))]
    track = PhoneTrack("en", "arpabet", tuple(phones))
    times_s = np.linspace(0, 0.3, 61)
    passes = run_passes(set_, segments(track), times_s, window_s=0.3, speed=15.0)
    middle = 30
    assert passes.stitched.weights[middle, 0] == 0.0
    assert passes.smoothed[middle, 0] > 0.2
    assert passes.resolved[middle, 0] < passes.smoothed[middle, 0]
    assert (passes.resolved.sum(axis=1) <= np.maximum(0.5, passes.resolved[:, 1]) + 1e-9).all()
    assert np.abs(np.diff(passes.limited, axis=0)).max() <= 15.0 * 0.005 + 1e-9
    assert passes.at(middle, 0)[:2] == ["smooth", "conflict"]


def test_pairs_that_are_not_there_are_made_up() -> None:
    polygons = {
        "aa|*": {"open": [(0.0, 1.0), (1.0, 1.0)]},
        "*|d": {"open": [(0.0, 0.0), (1.0, 0.0)]},
    }
    table = made(polygons).table("aa", "d")[:, 0]
    assert table[0] == 1.0
    assert table[-1] == 0.0
    assert (np.diff(table) <= 1e-12).all()
    assert made(polygons).source("aa", "d") == "aa|*+*|d"


def test_a_missing_pair_moves_like_the_nearest() -> None:
    flat = [(0.0, 1.0), (1.0, 1.0)]
    set_ = made({pair: {"open": flat} for pair in ("aa|d", "bmp|d", "w|d", "h|aa", "aa|h")})
    assert set_.source("ow", "d") == "w|d"
    assert set_.source("aa", "kg") == "aa|d"
    # No pair has a pause: the mouth comes from rest, as if from /h/.
    assert set_.source(PAUSE, "aa") == "h|aa"
    from_rest = set_.table(PAUSE, "aa")[:, 0]
    np.testing.assert_allclose(from_rest, np.minimum(2 * LOCAL, 1.0))
    np.testing.assert_allclose(set_.table("aa", PAUSE)[:, 0], np.minimum(2 - 2 * LOCAL, 1.0))
    assert set_.source(PAUSE, PAUSE) == ""
    assert not set_.table(PAUSE, PAUSE).any()
    track = PhoneTrack("en", "arpabet", (Phone("OW", 0, 0.2), Phone("D", 0.2, 0.4)))
    missing = missing_pairs(set_, track)
    assert list(missing) == ["_|ow", "ow|d", "d|_"]
    assert missing["ow|d"] == "like w|d"


@pytest.mark.parametrize(
    "learned",
    [
        {"aa": {"open": [[0, 0], [1, 1]]}},
        {"aa|d": {"nose": [[0, 0], [1, 1]]}},
        {"aa|d": {"open": [[0, 0]]}},
        {"aa|d": {"open": [[1, 0], [0, 1]]}},
        {"aa|d": {"open": [[0, 0], [1, float("inf")]]}},
        {"aa|d": {"open": [[0, 0, 1], [1, 1, 1]]}},
        {"aa|d": {"open": [[0, 0], [1.1, 1]]}},
    ],
)
def test_broken_sets_are_refused(learned: dict[str, object]) -> None:
    with pytest.raises(ValueError, match=r"makes no sense|not a pair|go back|inhomogeneous"):
        BigramSet.from_json(learned, ("open",))


def test_fitted_bigrams_follow_motion_they_never_saw() -> None:
    fitted = Bigram.configured({}).fit(captured(lines=60))
    for line in captured(lines=8, first=300).lines:
        curves = fitted.synthesize(line.track, rate_hz=60)
        error = curves.sample(line.times_s) - line.values
        assert (error.std(axis=0) < line.values.std(axis=0)).all()
