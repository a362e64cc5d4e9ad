"""Bigrams against cases worked by hand (2013 paper, section 2.2)."""

from __future__ import annotations

import numpy as np
import pytest

from animeme.phones import ARPABET_TO_IPA, SILENCE, Phone, PhoneTrack
from animeme_stages.synthesize.bigram import Bigram, limit_speed, resolve, smooth
from animeme_stages.synthesize.bigram_set import (
    COMMON,
    LOCAL,
    PAUSE,
    BigramSet,
    common_phone,
    spline,
)
from support.motion import captured


def model(polygons: dict[str, dict[str, list[tuple[float, float]]]]) -> Bigram:
    made = Bigram.configured({"speed": 1e6})
    made.controls_ = tuple(sorted({c for curves in polygons.values() for c in curves}))
    made.seen_ = {SILENCE: 1}
    made.set_ = BigramSet(polygons, made.controls_)
    return made


def test_common_phones() -> None:
    """Table 1: forty phones to twenty-one."""
    assert len(COMMON) == 21
    found = {symbol: common_phone(ipa) for symbol, ipa in ARPABET_TO_IPA.items()}
    assert found["P"] == found["B"] == found["M"] == "bmp"
    assert found["CH"] == found["Y"] == "sh"
    assert found["NG"] == "d"
    assert found["IY"] == "ih"
    assert common_phone(SILENCE) == PAUSE
    assert common_phone("ʏ") in COMMON
    assert common_phone("ɱ") == "f"


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
    bigram = model(polygons)
    track = PhoneTrack("en", "arpabet", (Phone("AA", 0, 0.2), Phone("D", 0.2, 0.4)))
    times_s = np.array([0.0, 0.1, 0.25, 0.39])
    values, _ = bigram._stitched(track, times_s)
    np.testing.assert_allclose(values[:, 0], [0.4, 0.4, 0.4, 0.4])
    assert bigram.trace(track, times_s)[1] == ["aa|d"]
    polygons["aa|d"] = {"open": [(0.0, 0.0), (1.0, 0.0)]}
    lower = model(polygons)
    values, _ = lower._stitched(track, times_s)
    np.testing.assert_allclose(values[:, 0], [0.1, 0.1, 0.2, 0.2])
    assert [row[0] for row in lower.trace(track, times_s)] == ["_|aa", "_|aa", "d|_", "d|_"]


def test_a_pair_is_warped_over_both_phones() -> None:
    bigram = model({"aa|d": {"open": [(0.0, 0.0), (1.0, 1.0)]}})
    track = PhoneTrack("en", "arpabet", (Phone("AA", 0, 0.3), Phone("D", 0.3, 0.4)))
    times_s = np.array([0.0, 0.1, 0.3, 0.39])
    values, _ = bigram._stitched(track, times_s)
    np.testing.assert_allclose(values[:, 0], times_s / 0.4, atol=2e-3)


def test_smoothing_joins_near_maxima_only() -> None:
    times_s = np.arange(9) * 0.1
    curve = np.array([0, 1, 0.2, 0.8, 0, 0, 0, 1, 0], dtype=float)
    joined = smooth(times_s, curve, 0.25)
    np.testing.assert_allclose(joined, [0, 1, 0.9, 0.8, 0, 0, 0, 1, 0])
    np.testing.assert_array_equal(smooth(times_s, curve, 0.0), curve)


def test_conflicting_poses_give_way_by_priority() -> None:
    """C(open, PBM) = 0.5, open has less priority: it falls to what is left."""
    controls = ("open", "PBM", "wide")
    curves = np.array([[0.8, 0.3, 0.4], [0.1, 0.3, 0.4], [0.9, 0.9, 0.9]])
    found = resolve(curves, controls)
    np.testing.assert_allclose(found[0], [0.2, 0.3, 0.4])
    np.testing.assert_allclose(found[1], curves[1])
    np.testing.assert_allclose(found[2], [0.0, 0.9, 0.9])


def test_speed_is_limited_both_ways() -> None:
    times_s = np.arange(6) * 0.1
    curve = np.array([0, 0, 1, 1, 0, 0], dtype=float)[:, None]
    found = limit_speed(times_s, curve, 4.0)[:, 0]
    np.testing.assert_allclose(found, [0, 0, 0.4, 0.4, 0, 0], atol=1e-12)
    assert np.abs(np.diff(found)).max() <= 4.0 * 0.1 + 1e-12


def test_pairs_that_are_not_there_are_made_up() -> None:
    polygons = {
        "aa|*": {"open": [(0.0, 1.0), (1.0, 1.0)]},
        "*|d": {"open": [(0.0, 0.0), (1.0, 0.0)]},
    }
    table = model(polygons).set_.table("aa", "d")[:, 0]
    assert table[0] == 1.0
    assert table[-1] == 0.0
    assert (np.diff(table) <= 1e-12).all()
    assert model(polygons).set_.source("aa", "d") == "aa|*+*|d"


@pytest.mark.parametrize(
    "learned",
    [
        {"aa": {"open": [[0, 0], [1, 1]]}},
        {"aa|d": {"nose": [[0, 0], [1, 1]]}},
        {"aa|d": {"open": [[0, 0]]}},
        {"aa|d": {"open": [[1, 0], [0, 1]]}},
        {"aa|d": {"open": [[0, 0], [1, float("inf")]]}},
        {"aa|d": {"open": [[0, 0, 1], [1, 1, 1]]}},
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
