"""Frames lie where they should, and bear the right labels."""

from __future__ import annotations

from fractions import Fraction

import numpy as np
import pytest

from animeme.timing import RATES, FrameRate

HAND_COMPUTED = [
    ("24", 0, "00:00:00:00"),
    ("24", 47, "00:00:01:23"),
    ("23.976", 1440, "00:01:00:00"),  # counts to 24; 60.06 s have gone by
    ("25", 90_000, "01:00:00:00"),
    ("30", 1800, "00:01:00:00"),
    ("29.97", 1800, "00:01:00:00"),
    ("29.97df", 1799, "00:00:59;29"),
    ("29.97df", 1800, "00:01:00;02"),
    ("29.97df", 1801, "00:01:00;03"),
    ("29.97df", 3597, "00:01:59;29"),  # a minute but the first and each tenth has 1798 frames
    ("29.97df", 3598, "00:02:00;02"),
    ("29.97df", 17_981, "00:09:59;29"),
    ("29.97df", 17_982, "00:10:00;00"),  # no number is left out in each tenth minute
    ("29.97df", 19_781, "00:10:59;29"),
    ("29.97df", 19_782, "00:11:00;02"),
    ("29.97df", 107_892, "01:00:00;00"),
    ("59.94df", 3599, "00:00:59;59"),
    ("59.94df", 3600, "00:01:00;04"),
    ("59.94df", 35_964, "00:10:00;00"),
    ("48", 49, "00:00:01:01"),
    ("60", 59, "00:00:00:59"),
    ("24", 24 * 86_400 + 5, "00:00:00:05"),  # a day has passed
]


@pytest.mark.parametrize(("rate", "frame", "label"), HAND_COMPUTED)
def test_labels_are_those_computed_by_hand(rate: str, frame: int, label: str) -> None:
    assert FrameRate.parse(rate).label(frame) == label


@pytest.mark.parametrize(
    ("name", "minutes"), [("29.97df", 11), ("59.94df", 2), ("29.97", 1), ("23.976", 1), ("60", 1)]
)
def test_labels_count_up_and_name_their_frames(name: str, minutes: int) -> None:
    rate = RATES[name]
    labels = [rate.label(frame) for frame in range(int((minutes + 0.1) * 60 * rate.per_s))]
    assert labels == sorted(set(labels))
    assert [rate.frame_of(label) for label in labels] == list(range(len(labels)))


def test_drop_frame_keeps_up_with_the_clock() -> None:
    rate = RATES["29.97df"]
    for hours in (1, 5, 23):
        frame = round(hours * 3600 * float(rate.per_s))
        assert rate.label(frame)[:5] in (f"{hours:02d}:00", f"{hours - 1:02d}:59")
    # Non-drop labels fall behind by 3.6 s an hour.
    assert RATES["29.97"].label(round(3600 * 30000 / 1001)) == "00:59:56:12"


def test_a_part_of_a_frame_is_read() -> None:
    assert RATES["60"].frame_of("14:03:52:28.207") == 60 * (14 * 3600 + 3 * 60 + 52) + 28 + (
        Fraction(207, 1000)
    )


@pytest.mark.parametrize(
    ("rate", "label", "problem"),
    [
        ("24", "00:00:00:24", "counts a frame 24, there are 24"),
        ("29.97df", "00:01:00;00", "leaves out"),
        ("29.97df", "00:11:00;01", "leaves out"),
        ("24", "1:2:3", "not HH:MM:SS:FF"),
        ("24", "00:00:00:1e9", "not HH:MM:SS:FF"),
    ],
)
def test_labels_that_are_none_are_refused(rate: str, label: str, problem: str) -> None:
    with pytest.raises(ValueError, match=problem):
        RATES[rate].frame_of(label)


@pytest.mark.parametrize(
    ("written", "name"),
    [(24, "24"), (24.0, "24"), (23.976, "23.976"), (29.97, "29.97"), ("29.97DF ", "29.97df")],
)
def test_rates_are_read_as_people_write_them(written: str | float, name: str) -> None:
    assert FrameRate.parse(written) is RATES[name]


@pytest.mark.parametrize("written", [0, 23, -24, "drop", "29,97", float("nan")])
def test_other_rates_are_refused(written: str | float) -> None:
    with pytest.raises(ValueError, match=r"no frame rate; known: 23\.976, 24"):
        FrameRate.parse(written)


def test_frames_are_exact_after_an_hour() -> None:
    times_s = RATES["23.976"].times_s(3600.0)
    assert times_s[1] == 1001 / 24000
    for frame in (1, 999, 24000, 86313):
        assert times_s[frame] == float(Fraction(frame * 1001, 24000))
        assert RATES["23.976"].time_s(frame) == times_s[frame]


@pytest.mark.parametrize("name", RATES)
@pytest.mark.parametrize("end_s", [0.0, 1e-9, 1.0, 2.7055, 60.06])
def test_the_last_frame_covers_the_end(name: str, end_s: float) -> None:
    rate = RATES[name]
    times_s = rate.times_s(end_s)
    assert times_s[0] == 0.0
    assert len(times_s) >= 2
    assert times_s[-1] >= end_s - 1e-7
    if len(times_s) > 2:
        assert times_s[-2] < end_s
    np.testing.assert_array_equal(times_s, [rate.time_s(frame) for frame in range(len(times_s))])
