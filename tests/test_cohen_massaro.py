"""The model against the paper's equations (Albrecht, Haber & Seidel 2002)."""

from __future__ import annotations

import copy
import tomllib
from importlib.resources import files
from typing import Any

import numpy as np
import pytest

from animeme.phones import SILENCE, Phone, PhoneTrack
from animeme_stages.synthesize.cohen_massaro import (
    REACH,
    SHORTEST_RAMP_S,
    CohenMassaro,
    key_times,
)
from animeme_stages.synthesize.segments import segments, split_symbol
from animeme_stages.synthesize.table import TargetTable, both_sides

MODEL = CohenMassaro.default()
TABLE = MODEL.table
SHIPPED = tomllib.loads(
    files("animeme_stages.synthesize").joinpath("arkit_targets.toml").read_text(encoding="utf-8")
)


def track(*phones: tuple[str, float]) -> PhoneTrack:
    ends = np.cumsum([length_s for _, length_s in phones]).round(6).tolist()
    starts = [0.0, *ends[:-1]]
    made = (Phone(s, a, b) for (s, _), a, b in zip(phones, starts, ends, strict=True))
    return PhoneTrack("de", "ipa", tuple(made))


def dominance_by_hand(spoken: PhoneTrack, control: str, at_s: float) -> float:
    """Eq. 1–3 written out with loops, for tracks without contacts and shorter than the reach."""
    column = MODEL.controls.index(control)
    group = int(TABLE.group_of[column])
    top = bottom = 0.0
    for symbol, phone in zip(spoken.ipa(), spoken.phones, strict=True):
        row = TABLE.rows[symbol]
        hold_s = max(0.0, phone.duration_s - TABLE.plateau_s) / 2
        centre_s = (phone.start_s + phone.end_s) / 2
        tau_s = max(abs(at_s - centre_s) - hold_s, 0.0)
        theta = (TABLE.theta_before if at_s < centre_s else TABLE.theta_after)[group]
        d = TABLE.alpha[row, group] * np.exp(-theta * tau_s ** TABLE.c[group])
        top += d * TABLE.targets[row, column]
        bottom += d
    return float(top / bottom)


@pytest.mark.parametrize("control", ["jawOpen", "mouthPucker", "mouthSmileRight", "tongueOut"])
def test_weighted_average_of_targets(control: str) -> None:
    spoken = track(
        (SILENCE, 0.3), ("t", 0.07), ("u", 0.15), ("s", 0.09), ("i", 0.2), (SILENCE, 0.2)
    )
    curves = MODEL.synthesize(spoken, rate_hz=100)
    expected = [dominance_by_hand(spoken, control, float(t)) for t in curves.times_s]
    np.testing.assert_allclose(curves.curve(control), expected, atol=1e-12)


def test_one_phone_holds_its_target() -> None:
    curves = MODEL.synthesize(track(("a", 0.5)), rate_hz=60)
    np.testing.assert_allclose(
        curves.curve("jawOpen"), SHIPPED["classes"]["open"]["targets"]["jawOpen"]
    )


def test_influence_ends_with_the_seventh_segment() -> None:
    """Eq. 4: a phone is felt seven segments away, fading over the seventh, and no further."""
    lips, plain = ("u", 0.05), [("k", 0.05)] * (REACH + 3)
    with_u = MODEL.synthesize(track(lips, *plain), rate_hz=400)
    without = MODEL.synthesize(track(("k", 0.05), *plain), rate_hz=400)
    difference = np.abs(with_u.curve("mouthPucker") - without.curve("mouthPucker"))
    seventh_s = 0.05 * REACH
    times_s = with_u.times_s
    inside = difference[(times_s > seventh_s) & (times_s < seventh_s + 0.04)]
    assert (inside > 0).all()
    assert (np.diff(inside) < 0).all()
    assert difference[times_s >= seventh_s + 0.05 - 1e-9].max() == 0.0
    assert np.abs(np.diff(difference)).max() < 0.05  # no jump at any border


def test_hermite_fade_meets_value_and_slope() -> None:
    """h(t) of eq. 4 continues D at the seventh segment's border with equal slope."""
    spoken = track(*[("k", 0.08)] * 20)
    parts = segments(
        spoken,
        TABLE.rows,
        TABLE.releases,
        TABLE.contact_rows,
        TABLE.start_peak_rows,
        plateau_s=TABLE.plateau_s,
        closure_share=TABLE.closure_share,
    )
    arrays = MODEL._arrays(parts)
    step_s = 1e-6
    for who, current in ((5, 5 + REACH), (15, 15 - REACH)):
        ahead = 1 if current > who else -1
        border_s = parts[current].start_s if ahead > 0 else parts[current].end_s
        index, here = np.array([who]), np.array([current])

        def inner(t: float, index: Any = index) -> Any:
            return MODEL._dominance(arrays, index, np.array([t]))[0]

        def outer(t: float, index: Any = index, here: Any = here) -> Any:
            return MODEL._faded(arrays, index, here, np.array([t]))[0]

        far_s = parts[current].end_s if ahead > 0 else parts[current].start_s
        np.testing.assert_allclose(outer(border_s), inner(border_s), rtol=1e-9)
        slope_in = (inner(border_s) - inner(border_s - ahead * step_s)) / step_s
        slope_out = (outer(border_s + ahead * step_s) - outer(border_s)) / step_s
        np.testing.assert_allclose(slope_out, slope_in, rtol=2e-3)
        np.testing.assert_allclose(outer(far_s), 0.0, atol=1e-12)


@pytest.mark.parametrize("stop", ["p", "b"])
def test_stop_is_closure_then_release(stop: str) -> None:
    """Section 3.2: the lips are shut over the closure, and the release peaks at its start."""
    spoken = track(("a", 0.12), (stop, 0.1), ("a", 0.12))
    curves = MODEL.synthesize(spoken, rate_hz=200)
    targets = SHIPPED["classes"]["bilabial-stop"]["targets"]
    closure = (curves.times_s >= 0.12) & (curves.times_s <= 0.12 + 0.06)
    assert closure.sum() >= 10
    np.testing.assert_allclose(curves.curve("jawOpen")[closure], targets["jawOpen"], atol=1e-7)
    np.testing.assert_allclose(
        curves.curve("mouthClose")[closure], targets["mouthClose"], atol=1e-7
    )
    np.testing.assert_allclose(curves.curve("mouthFunnel")[closure], 0.0, atol=1e-7)
    assert curves.curve("jawOpen")[curves.times_s >= 0.2].max() > 3 * targets["jawOpen"]


@pytest.mark.parametrize(("symbol", "name"), [("m", "bilabial-nasal"), ("f", "labiodental")])
def test_contact_lasts_the_whole_phone(symbol: str, name: str) -> None:
    curves = MODEL.synthesize(track(("o", 0.1), (symbol, 0.07), ("a", 0.1)), rate_hz=60)
    inside = (curves.times_s >= 0.1) & (curves.times_s <= 0.17)
    for control in ("jawOpen", "mouthRollLower", "mouthClose"):
        target = SHIPPED["classes"][name]["targets"].get(control, 0.0)
        np.testing.assert_allclose(curves.curve(control)[inside], target, atol=1e-7)


def test_keys_at_closures_and_at_phones_that_sampling_would_miss() -> None:
    """Sections 3.2 and 3.3, at the paper's own 20 frames per second."""
    spoken = track(("a", 0.11), ("b", 0.05), ("i", 0.03), ("t", 0.012), ("a", 0.2))
    times_s = MODEL.synthesize(spoken, rate_hz=20).times_s
    for needed_s in (0.0, 0.11, 0.14, spoken.duration_s):
        assert np.abs(times_s - needed_s).min() < 1e-9
    short = spoken.phones[3]
    assert ((times_s > short.start_s) & (times_s < short.end_s)).any()
    uniform = np.arange(9) / 20
    assert all(np.abs(times_s - t).min() < 1e-3 for t in uniform)


def test_keys_are_distinct_where_they_coincide() -> None:
    spoken = track(("a", 0.1), ("m", 0.1), ("m", 0.1), ("a", 0.1))
    parts = segments(
        spoken, TABLE.rows, TABLE.releases, TABLE.contact_rows, TABLE.start_peak_rows,
        plateau_s=TABLE.plateau_s, closure_share=TABLE.closure_share,
    )  # fmt: skip
    times_s = key_times(parts, 60)
    assert np.diff(times_s).min() > 1e-5


@pytest.mark.parametrize("pair", ["mb", "bm", "mf", "fp", "pp"])
def test_contacts_side_by_side_are_both_reached(pair: str) -> None:
    first, second = pair
    spoken = track(("a", 0.1), (first, 0.08), (second, 0.08), ("a", 0.1))
    curves = MODEL.synthesize(spoken, rate_hz=120)
    for phone in spoken.phones[1:3]:
        row = TABLE.rows[phone.symbol]
        at_s = phone.start_s + 0.4 * phone.duration_s
        jaw = float(curves.sample([at_s])[0, MODEL.controls.index("jawOpen")])
        target = TABLE.targets[row, MODEL.controls.index("jawOpen")]
        assert jaw == pytest.approx(target, abs=1e-6 if pair != "pp" else 0.05)


def test_contact_is_reached_without_a_jump() -> None:
    curves = MODEL.synthesize(track(("a", 0.3), ("m", 0.1), ("a", 0.3)), rate_hz=1000)
    speed = np.abs(np.diff(curves.weights, axis=0)).max(axis=0) * 1000
    steepest = 1.5 / SHORTEST_RAMP_S  # of a smoothstep over the shortest ramp
    assert speed.max() < steepest


def test_long_phones_are_held() -> None:
    """A long vowel keeps its shape, and a long pause keeps the mouth shut."""
    curves = MODEL.synthesize(track((SILENCE, 2.0), ("a", 3.0), (SILENCE, 2.0)), rate_hz=60)
    jaw = curves.curve("jawOpen")
    vowel = (curves.times_s > 2.3) & (curves.times_s < 4.7)
    assert np.ptp(jaw[vowel]) < 0.01
    assert jaw[(curves.times_s < 1.6) | (curves.times_s > 5.4)].max() < 0.01


def test_rounding_is_anticipated() -> None:
    """Coarticulation: /s/ before /u/ is rounder than /s/ before /i/ (Cohen & Massaro 1993)."""
    round_, spread = (
        MODEL.synthesize(track((SILENCE, 0.2), ("s", 0.12), (vowel, 0.15)), rate_hz=60)
        for vowel in ("u", "i")
    )
    at_s = [0.26]
    pucker, smile = (MODEL.controls.index(c) for c in ("mouthPucker", "mouthSmileLeft"))
    assert round_.sample(at_s)[0, pucker] > spread.sample(at_s)[0, pucker] + 0.1
    assert spread.sample(at_s)[0, smile] > round_.sample(at_s)[0, smile] + 0.03


@pytest.mark.parametrize(
    ("symbol", "pieces"),
    [
        ("aɪ", ("a", "ɪ")),
        ("tʃ", ("t", "ʃ")),
        ("ɔø", ("ɔ", "ø")),
        ("pf", ("p", "f")),
        ("əl", ("ə", "l")),
        ("m", ("m",)),
        ("ʘ", ()),
    ],
)
def test_symbols_are_read_piece_by_piece(symbol: str, pieces: tuple[str, ...]) -> None:
    assert split_symbol(symbol, TABLE.rows) == pieces


def test_both_sides() -> None:
    assert both_sides("mouthSmile") == ("mouthSmileLeft", "mouthSmileRight")
    assert both_sides("jawOpen") == ("jawOpen",)


@pytest.mark.parametrize(
    ("path", "value", "said"),
    [
        (("classes", "open", "targets", "jawOpen"), 1.5, "0 … 1"),
        (("classes", "open", "targets"), {"earWiggle": 0.5}, "earWiggle"),
        (("classes", "open", "alpha", "jaw"), 0.0, "alpha"),
        (("classes", "open", "alpha", "jaw"), float("nan"), "alpha"),
        (("groups", "jaw", "c"), 0.5, "at least 1"),
        (("config", "closure_share"), 1.0, "closure_share"),
        (("config", "contact_ramp_s"), -1.0, "contact_ramp_s"),
        (("classes", "silence", "phones"), [], "sil"),
        (("groups",), 3, "cohen-massaro"),
    ],
)
def test_broken_tables_are_refused(path: tuple[str, ...], value: object, said: str) -> None:
    document: Any = copy.deepcopy(SHIPPED)
    at = document
    for key in path[:-1]:
        at = at[key]
    at[path[-1]] = value
    with pytest.raises(ValueError, match=said):
        TargetTable.from_document(document)
