"""Curve sets keep their invariants; dropping keys stays within the bound everywhere."""

from __future__ import annotations

import json
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from animeme import documents
from animeme.curves import CurveSet, drop_still, interpolate, reduce_keys

PROPERTY = settings(deadline=None, derandomize=True, max_examples=80)

STEPS_S = st.floats(1e-4, 2.0)
WEIGHTS = st.one_of(
    st.sampled_from((0.0, 1.0, 0.5, -0.0, 0.1)), st.floats(-2, 3, allow_nan=False, width=64)
)


@st.composite
def curve_sets(draw: st.DrawFn, *, max_keys: int = 25) -> CurveSet:
    """Irregular times, also one or two keys and no curve; noise, constants, ramps and spikes."""
    steps = draw(st.lists(STEPS_S, max_size=max_keys - 1))
    start_s = draw(st.sampled_from((0.0, -1.0, 0.25)))
    times_s = start_s + np.concatenate([[0.0], np.cumsum(steps)])
    columns = []
    for kind in draw(st.lists(st.sampled_from(("noise", "constant", "ramp", "spike")), max_size=4)):
        if kind == "noise":
            values = draw(st.lists(WEIGHTS, min_size=len(times_s), max_size=len(times_s)))
        elif kind == "constant":
            values = [draw(WEIGHTS)] * len(times_s)
        elif kind == "ramp":
            values = list(times_s * draw(WEIGHTS))
        else:
            values = [0.0] * len(times_s)
            values[draw(st.integers(0, len(times_s) - 1))] = 1.0
        columns.append(values)
    weights = np.array(columns).reshape(-1, len(times_s)).T
    return CurveSet(times_s, tuple(f"c{i}" for i in range(len(columns))), weights)


def dense(curves: CurveSet, count: int = 300) -> np.ndarray[Any, Any]:
    ends = np.linspace(curves.times_s[0] - 0.5, curves.times_s[-1] + 0.5, count)
    return np.sort(np.concatenate([ends, curves.times_s]))


# Invariants

BROKEN: dict[str, tuple[Any, tuple[str, ...], Any, str]] = {
    "no keys": ([], (), np.zeros((0, 0)), r"T ≥ 1.*\(0,\)"),
    "times in two dimensions": ([[0.0]], ("a",), [[0.0]], r"\(1, 1\)"),
    "times not a sequence": (0.0, ("a",), [[0.0]], r"\(\)"),
    "time repeated": ([0.0, 1.0, 1.0], (), np.zeros((3, 0)), "strictly increasing"),
    "time going back": ([0.0, 2.0, 1.0], (), np.zeros((3, 0)), "strictly increasing"),
    "time not a number": ([0.0, np.nan], (), np.zeros((2, 0)), "finite"),
    "time infinite": ([0.0, np.inf], (), np.zeros((2, 0)), "finite"),
    "name twice": ([0.0], ("a", "b", "a"), np.zeros((1, 3)), "repeated: a$"),
    "too few weights": ([0.0, 1.0], ("a",), [[0.0]], r"\(2, 1\), not \(1, 1\)"),
    "too many columns": ([0.0], ("a",), [[0.0, 1.0]], r"\(1, 1\), not \(1, 2\)"),
    "weights flat": ([0.0], ("a",), [0.0], r"\(1, 1\), not \(1,\)"),
    "weight not a number": ([0.0], ("a", "b"), [[0.0, np.nan]], "'b' are not finite"),
    "weight infinite": ([0.0, 1.0], ("a", "b"), [[0.0, 0.0], [-np.inf, 0.0]], "'a' are not"),
}


@pytest.mark.parametrize("case", BROKEN)
def test_a_broken_invariant_raises_and_names_the_offender(case: str) -> None:
    times_s, names, weights, message = BROKEN[case]
    with pytest.raises(ValueError, match=message):
        CurveSet(times_s, names, weights)


def test_arrays_are_copied_and_cannot_be_written() -> None:
    times_s, weights = np.array([0.0, 1.0]), np.array([[0.0], [1.0]])
    curves = CurveSet(times_s, ("a",), weights)
    times_s[0] = weights[0] = 9.0
    assert curves == CurveSet([0.0, 1.0], ("a",), [[0.0], [1.0]])
    for array in (curves.times_s, curves.weights):
        with pytest.raises(ValueError, match="read-only"):
            array[0] = 5.0


def test_sets_are_equal_by_value_and_cannot_be_hashed() -> None:
    curves = CurveSet([0.0], ("a",), [[0.5]])
    assert curves == CurveSet([0.0], ("a",), [[0.5]])
    assert curves != CurveSet([0.0], ("b",), [[0.5]])
    assert curves != CurveSet([0.0], ("a",), [[0.25]])
    assert curves != CurveSet([1.0], ("a",), [[0.5]])
    assert curves != "a"
    with pytest.raises(TypeError):
        hash(curves)


def test_a_curve_is_found_by_name() -> None:
    curves = CurveSet([0.0, 2.0], ("a", "b"), [[0.0, 1.0], [2.0, 3.0]])
    assert curves.curve("b").tolist() == [1.0, 3.0]
    assert curves.duration_s == 2.0
    with pytest.raises(KeyError, match="c"):
        curves.curve("c")


# Sampling


@given(curve_sets())
@PROPERTY
def test_sampling_agrees_with_numpy(curves: CurveSet) -> None:
    at = dense(curves)
    sampled = curves.sample(at)
    assert sampled.shape == (len(at), len(curves.names))
    for column, name in enumerate(curves.names):
        expected = np.interp(at, curves.times_s, curves.curve(name))
        np.testing.assert_allclose(sampled[:, column], expected, rtol=0, atol=1e-12)


@given(curve_sets())
@PROPERTY
def test_keys_are_sampled_exactly(curves: CurveSet) -> None:
    np.testing.assert_array_equal(curves.sample(curves.times_s), curves.weights)


def test_one_time_can_be_sampled() -> None:
    curves = CurveSet([0.0, 1.0], ("a",), [[0.0], [1.0]])
    assert curves.sample(0.25).tolist() == [[0.25]]
    assert curves.sample([]).shape == (0, 1)


# Documents


@given(curve_sets())
@PROPERTY
def test_a_document_gives_back_every_bit(curves: CurveSet) -> None:
    text = json.dumps(curves.to_document(), allow_nan=False)
    read = CurveSet.from_document(json.loads(text))
    assert read.names == curves.names
    assert read.times_s.tobytes() == curves.times_s.tobytes()
    assert read.weights.tobytes() == curves.weights.tobytes()
    documents.type_of("curves").model_validate(json.loads(text))


def test_a_document_with_uneven_columns_is_refused_by_name() -> None:
    document = {"times_s": [0.0, 1.0], "curves": {"a": [0.0, 1.0], "b": [0.0]}}
    with pytest.raises(ValueError, match="'b' has 1 weights for 2 times"):
        CurveSet.from_document(document)


# Key reduction

BOUNDS = st.sampled_from((0.0, 1e-9, 0.002, 0.05, 0.5, 10.0))


@given(curve_sets(), BOUNDS)
@PROPERTY
def test_dropped_keys_stay_within_the_bound_everywhere(curves: CurveSet, max_error: float) -> None:
    reduced = reduce_keys(curves, max_error)
    at_keys = np.abs(reduced.sample(curves.times_s) - curves.weights)
    assert at_keys.max(initial=0.0) <= max_error
    at = dense(curves)
    error = np.abs(reduced.sample(at) - curves.sample(at))
    assert error.max(initial=0.0) <= max_error + 1e-12


def as_written(curves: CurveSet) -> CurveSet:
    """As a file of float32 plays them."""
    times_s = curves.times_s.astype(np.float32)
    keep = np.append(True, np.diff(times_s) > 0)
    weights = curves.weights.astype(np.float32)
    return CurveSet(times_s[keep], curves.names, weights[keep])


def largest_error(first: CurveSet, second: CurveSet) -> float:
    """Two polygons differ most at a corner of one of them."""
    corners = np.union1d(first.times_s, second.times_s)
    error = np.abs(first.sample(corners) - second.sample(corners))
    return float(error.max(initial=0.0))


@given(curve_sets(), BOUNDS)
@PROPERTY
def test_the_bound_holds_for_what_a_file_plays(curves: CurveSet, max_error: float) -> None:
    written = as_written(reduce_keys(curves, max_error))
    # Where rounding alone costs more than the bound, no choice of keys could keep it.
    unavoidable = largest_error(as_written(curves), curves)
    assert largest_error(written, curves) <= max(max_error, unavoidable) + 1e-12


@pytest.mark.parametrize("seed", range(6))
def test_the_bound_holds_in_a_file_at_the_end_of_a_long_line(seed: int) -> None:
    times_s = 3000.0 + np.arange(300) / 60
    weights = np.cumsum(np.random.default_rng(seed).normal(0, 0.02, (300, 2)), axis=0)
    curves = CurveSet(times_s, ("a", "b"), weights)
    reduced = reduce_keys(curves, 0.01)
    assert 20 < len(reduced.times_s) < 280
    assert largest_error(as_written(reduced), curves) <= 0.01


@given(curve_sets(), BOUNDS)
@PROPERTY
def test_kept_keys_are_old_ones_with_the_first_and_the_last(
    curves: CurveSet, max_error: float
) -> None:
    reduced = reduce_keys(curves, max_error)
    assert reduced.names == curves.names
    assert reduced.times_s[[0, -1]].tolist() == curves.times_s[[0, -1]].tolist()
    rows = np.searchsorted(curves.times_s, reduced.times_s)
    np.testing.assert_array_equal(curves.times_s[rows], reduced.times_s)
    np.testing.assert_array_equal(curves.weights[rows], reduced.weights)


@given(curve_sets(), BOUNDS)
@PROPERTY
def test_reducing_is_deterministic_and_reducing_again_drops_nothing(
    curves: CurveSet, max_error: float
) -> None:
    reduced = reduce_keys(curves, max_error)
    assert reduce_keys(curves, max_error) == reduced
    again = reduce_keys(reduced, max_error)
    # Not strictly idempotent: a split made by a key that a later split made needless may go.
    assert set(again.times_s) <= set(reduced.times_s)


def of_one_span(curves: CurveSet, max_error: float, left: int, right: int) -> set[int]:
    """Keys that stay within a span, by the recursion of Douglas and Peucker as it is written."""
    ends = [left, right]
    line = interpolate(curves.times_s[ends], curves.weights[ends], curves.times_s[left:right])
    error = np.abs(line - curves.weights[left:right]).max(axis=1)
    worst = left + int(error.argmax())
    if right - left < 2 or error.max() <= max_error:
        return set(ends)
    parts = ((left, worst), (worst, right))
    return {key for part in parts for key in of_one_span(curves, max_error, *part)}


@given(st.integers(0, 10_000), st.sampled_from((0.0, 0.05, 0.5)))
@PROPERTY
def test_the_keys_are_those_of_the_recursion(seed: int, max_error: float) -> None:
    random = np.random.default_rng(seed)
    # Numbers that float32 holds, of which many are equal, so that several keys are the worst.
    weights = random.integers(-4, 5, (int(random.integers(2, 30)), 3)) / 4
    curves = CurveSet(np.arange(len(weights)) / 8, ("a", "b", "c"), weights)
    kept = sorted(of_one_span(curves, max_error, 0, len(weights) - 1))
    assert reduce_keys(curves, max_error).times_s.tolist() == curves.times_s[kept].tolist()


@given(curve_sets())
@PROPERTY
def test_a_bound_of_zero_keeps_the_curve(curves: CurveSet) -> None:
    reduced = reduce_keys(curves, 0.0)
    np.testing.assert_array_equal(reduced.sample(curves.times_s), curves.weights)


@pytest.mark.parametrize(
    ("weights", "max_error", "kept"),
    [
        ([[0.0]] * 5, 0.0, [0, 4]),
        ([[0.0], [0.25], [0.5], [0.75], [1.0]], 0.0, [0, 4]),
        ([[0.0], [0.0], [1.0], [0.0], [0.0]], 0.0, [0, 1, 2, 3, 4]),
        ([[0.0], [0.0], [1.0], [0.0], [0.0]], 0.999, [0, 2, 4]),
        ([[0.0], [0.0], [1.0], [0.0], [0.0]], 1.0, [0, 4]),
        ([[0.0, 0.0], [0.0, 1.0], [0.0, 0.0], [0.0, 0.0], [0.0, 0.0]], 0.1, [0, 1, 2, 4]),
    ],
)
def test_a_key_stays_where_any_curve_needs_it(
    weights: list[list[float]], max_error: float, kept: list[int]
) -> None:
    names = tuple("ab"[: len(weights[0])])
    curves = CurveSet(np.arange(5.0), names, weights)
    assert reduce_keys(curves, max_error).times_s.tolist() == kept


def test_without_curves_the_ends_stay() -> None:
    reduced = reduce_keys(CurveSet([0.0, 1.0, 2.0], (), np.zeros((3, 0))), 0.0)
    assert reduced.times_s.tolist() == [0.0, 2.0]


def test_many_keys_do_not_exhaust_the_stack() -> None:
    times_s = np.arange(5000.0)
    curves = CurveSet(times_s, ("a",), (times_s % 2)[:, None])
    assert reduce_keys(curves, 0.1) == curves


def test_interpolation_with_one_key_is_constant() -> None:
    at = np.array([-1.0, 0.0, 5.0])
    assert interpolate(np.array([0.0]), np.array([[0.5]]), at).tolist() == [[0.5]] * 3


# Curves at rest


def test_curves_at_rest_are_dropped() -> None:
    weights = [[0.0, 0.3, 0.0, 0.1], [0.0, 0.3, 0.5, 0.1]]
    curves = CurveSet([0.0, 1.0], ("zero", "still", "moves", "elsewhere"), weights)
    (kept,) = drop_still([curves], {"still": 0.3}, [])
    # 0.1 all the time is not where the character is at rest, so it says something.
    assert kept == CurveSet([0.0, 1.0], ("moves", "elsewhere"), [[0.0, 0.1], [0.5, 0.1]])


def test_rest_is_what_a_file_of_float32_says() -> None:
    curves = CurveSet([0.0, 1.0], ("a", "b"), [[0.1, 0.0], [0.1, 1.0]])
    (kept,) = drop_still([curves], {"a": float(np.float32(0.1))}, [])
    assert kept.names == ("b",)


def test_every_line_speaks_of_each_mesh_that_one_of_them_moves() -> None:
    first = CurveSet([0.0, 1.0], ("jaw", "smile"), [[0.0, 0.0], [1.0, 0.0]])
    second = CurveSet([0.0, 2.0], ("jaw", "blink"), [[0.0, 0.0], [0.0, 0.5]])
    meshes = (("jaw", "smile"), ("jaw", "tongue"), ("blink",), ("hat",))
    kept = drop_still([first, second], {"jaw": 0.0, "blink": 0.2}, meshes)
    # The first holds the eyelids at rest, else they would stay as the second left them.
    assert kept[0] == CurveSet([0.0, 1.0], ("jaw", "blink"), [[0.0, 0.2], [1.0, 0.2]])
    assert set(kept[1].names) == {"jaw", "blink"}
    assert kept[1].curve("jaw").tolist() == [0.0, 0.0]


def test_a_line_that_never_moves_keeps_one_curve_per_mesh() -> None:
    still = CurveSet([0.0, 1.0], ("a", "b"), np.zeros((2, 2)))
    assert drop_still([still], {}, [("a", "b")])[0].names == ("a",)
    assert drop_still([still], {}, [])[0].names == ()
