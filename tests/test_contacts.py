"""Closures that hold in the output, for every model."""

from __future__ import annotations

import numpy as np
import pytest

from animeme import registry
from animeme.phones import SILENCE, Phone, PhoneTrack
from animeme.scoring import Closure, captured_recall, judge
from animeme_stages.synthesize.contacts import (
    CLOSURE_SHARE,
    SQUEEZED_RAMP_S,
    Bound,
    Contacts,
    contact_spans,
    learn_contacts,
)
from support.motion import CONTROLS, captured

MODELS = sorted(registry.plugins(registry.MODELS))


def track(*phones: tuple[str, float]) -> PhoneTrack:
    ends = np.cumsum([length_s for _, length_s in phones]).round(6).tolist()
    starts = [0.0, *ends[:-1]]
    made = (Phone(s, a, b) for (s, _), a, b in zip(phones, starts, ends, strict=True))
    return PhoneTrack("de", "ipa", tuple(made))


def test_when_lips_meet() -> None:
    """2002 paper, section 3.2: all of /m f v/, and of /p b/ the closure."""
    spoken = track((SILENCE, 0.2), ("p", 0.1), ("a", 0.1), ("m", 0.05), ("f", 0.08), ("t", 0.1))
    spans = [(s.kind, s.start_s, s.end_s) for s in contact_spans(spoken)]
    assert [kind for kind, _, _ in spans] == ["bilabial", "bilabial", "labiodental"]
    np.testing.assert_allclose(spans[0][1:], (0.2, 0.2 + 0.1 * CLOSURE_SHARE))
    np.testing.assert_allclose(spans[1][1:], (0.4, 0.45))
    np.testing.assert_allclose(spans[2][1:], (0.45, 0.53))


@pytest.mark.parametrize("symbol", ["w", "ɸ", "a", "t", "ʔ", "ʘ"])
def test_other_phones_have_no_contact(symbol: str) -> None:
    assert contact_spans(track((symbol, 0.1))) == ()


def test_an_affricate_closes_in_its_first_half() -> None:
    spans = contact_spans(track(("a", 0.1), ("pf", 0.2)))
    assert [s.kind for s in spans] == ["bilabial", "labiodental"]
    assert spans[0].end_s < 0.2 <= spans[1].start_s + 1e-9


def test_bounds_are_learned_from_the_speaker() -> None:
    bounds = {(b.kind, b.control): b for b in learn_contacts(captured(lines=40)).bounds}
    closure = bounds["bilabial", "lip_gap"]
    assert closure.upper
    assert closure.limit < 0.02
    assert ("bilabial", "lip_width") not in bounds


def test_bounds_hold_without_a_jump() -> None:
    spoken = track(("a", 0.2), ("m", 0.1), ("a", 0.2), ("b", 0.06), ("a", 0.02), ("f", 0.1))
    times_s = np.arange(0, spoken.duration_s, 0.001)
    weights = np.stack([0.3 + 0.1 * np.sin(20 * times_s), np.full(len(times_s), 0.1)], axis=1)
    contacts = Contacts(
        (Bound("bilabial", "gap", 0.01, True), Bound("labiodental", "teeth", 0.5, False))
    )
    held = contacts.hold(spoken, times_s, weights, ("gap", "teeth"))
    for span in contact_spans(spoken):
        inside = (times_s >= span.start_s) & (times_s <= span.end_s)
        if span.kind == "bilabial":
            assert held[inside, 0].max() <= 0.01 + 1e-12
        else:
            assert held[inside, 1].min() >= 0.5 - 1e-12
    assert np.abs(np.diff(held, axis=0)).max() < 0.4 * 1.5 * 0.001 / SQUEEZED_RAMP_S + 0.003
    far = times_s < 0.2 - 0.08
    np.testing.assert_array_equal(held[far], weights[far])


def test_what_is_within_the_bound_stays() -> None:
    spoken = track(("a", 0.2), ("m", 0.1), ("a", 0.2))
    times_s = np.arange(0, 0.5, 0.01)
    weights = np.full((len(times_s), 1), -0.02)
    contacts = Contacts((Bound("bilabial", "gap", 0.01, True),))
    np.testing.assert_array_equal(contacts.hold(spoken, times_s, weights, ("gap",)), weights)


@pytest.mark.parametrize("name", MODELS)
def test_any_model_closes(name: str) -> None:
    """On lines it never saw, with the stage on; and its error hardly rises."""
    data, other = captured(lines=40), captured(lines=12, first=500)
    closure = Closure("lip_gap", 0.02)
    kind = registry.model_type(name)
    free, _ = judge(kind.configured({"contacts": "no"}).fit(data), other, closure)
    held, curves = judge(kind.configured({"contacts": "yes"}).fit(data), other, closure)
    assert held.closure_recall == 1.0
    assert (captured_recall(other, closure) or 0) > 0.9
    values = np.concatenate([line.values for line in other.lines])
    for control, spread in zip(CONTROLS, values.std(axis=0), strict=True):
        before, after = free.rmse[control], held.rmse[control]
        assert before is not None
        assert after is not None
        assert after <= before + 0.15 * spread
    column = CONTROLS.index("lip_gap")
    for curve, line in zip(curves, other.lines, strict=True):
        for span in contact_spans(line.track):
            if span.kind == "bilabial":
                at_s = np.linspace(span.start_s, span.end_s, 20)
                assert curve.sample(at_s)[:, column].max() <= 0.02


@pytest.mark.parametrize(
    "entry",
    [
        {"kind": "bilabial"},
        {"kind": "dental", "control": "gap", "limit": 0.0, "upper": True},
        {"kind": "bilabial", "control": "nose", "limit": 0.0, "upper": True},
        {"kind": "bilabial", "control": "gap", "limit": float("nan"), "upper": True},
        {"kind": "bilabial", "control": "gap", "limit": 0.0, "upper": 1},
        "bilabial",
    ],
)
def test_contacts_of_broken_documents_are_refused(entry: object) -> None:
    with pytest.raises(ValueError, match="contact"):
        Contacts.from_json([entry], ("gap",))
