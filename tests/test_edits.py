"""Edits by hand do what they say, where they say it, and say when they no longer can."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from animeme.curves import CurveSet
from animeme.documents.edits import EditsDocument
from animeme.edits import PlacedEdit, Stage, apply_edits, placed, read_edits, text_changed
from animeme.errors import InputError
from animeme.findings import Finding
from animeme.phones import Phone, PhoneTrack, Word
from animeme.shaping import led

PHONES = (
    ("sil", 0.0, 0.5), ("B", 0.5, 0.6), ("OW", 0.6, 0.9), ("T", 0.9, 1.0),
    ("B", 1.0, 1.1), ("AA", 1.1, 1.4), ("B", 1.4, 1.5),
    ("B", 1.5, 1.6), ("OW", 1.6, 1.9), ("T", 1.9, 2.0), ("sil", 2.0, 3.0),
)  # fmt: skip
TRACK = PhoneTrack(
    "en",
    "arpabet",
    tuple(Phone(*phone) for phone in PHONES),
    (Word("boat", 0.5, 1.0), Word("bob", 1.0, 1.5), Word("boat", 1.5, 2.0)),
)
CONTROLS = Stage("control", {"jawOpen": "jawOpen", "browInnerUp": "browInnerUp"}, {})


def motion(end_s: float = 3.0) -> CurveSet:
    times_s = np.append(np.arange(0.0, end_s, 1 / 60), end_s)
    weights = np.stack([0.3 + 0.2 * np.sin(7 * times_s), np.zeros(len(times_s))], axis=1)
    return CurveSet(times_s, ("jawOpen", "tongueOut"), weights)


def edits(*entries: dict[str, Any]) -> tuple[PlacedEdit, ...]:
    document = EditsDocument.model_validate({"schema": "animeme.edits/1", "edit": list(entries)})
    return placed(document, Path("boat.edits.toml"))


def applied(
    *entries: dict[str, Any],
    track: PhoneTrack = TRACK,
    lead_s: float = 0.0,
    curves: CurveSet | None = None,
) -> tuple[CurveSet, tuple[Finding, ...]]:
    given = curves or motion(track.duration_s)
    return apply_edits(given, edits(*entries), CONTROLS, track, lead_s)


def change(after: CurveSet, name: str = "jawOpen", before: CurveSet | None = None) -> Any:
    """What was added at any time, as a function."""
    old = before or motion(after.duration_s)

    def added(at_s: Any) -> Any:
        new_values = after.sample(at_s)[:, after.names.index(name)]
        return new_values - old.sample(at_s)[:, old.names.index(name)]

    return added


JAW = {"do": "offset", "control": "jawOpen", "by": 0.2}


def test_an_offset_comes_holds_and_goes() -> None:
    after, findings = applied({**JAW, "from": 1.0, "to": 2.0, "ease_in_s": 0.2, "ease_out_s": 0.4})
    assert findings == ()
    added = change(after)
    np.testing.assert_allclose(added([0, 0.5, 0.99, 1.0, 2.0, 2.5, 3]), 0, atol=1e-9)
    np.testing.assert_allclose(added([1.1, 1.8]), 0.1, atol=1e-3)  # half of it, half-way
    np.testing.assert_allclose(added([1.2, 1.4, 1.6]), 0.2, atol=1e-9)
    coming = np.diff(added(np.linspace(1.0, 1.2, 50)))
    assert (coming >= -1e-9).all()
    assert coming.max() < 0.2 * 1.6 / 49  # an S is at most half as steep again as a ramp
    np.testing.assert_array_equal(after.curve("tongueOut"), 0)


def test_an_offset_without_ends_holds_all_along() -> None:
    after, _ = applied(JAW)
    np.testing.assert_allclose(change(after)([0, 1, 3]), 0.2, atol=1e-12)
    assert after.times_s.tolist() == motion().times_s.tolist()


def test_an_offset_at_once_takes_a_millisecond() -> None:
    after, _ = applied({**JAW, "from": 1.0, "to": 2.0, "ease_in_s": 0, "ease_out_s": 0})
    np.testing.assert_allclose(change(after)([1.0011, 1.9989]), 0.2, atol=1e-9)
    np.testing.assert_allclose(change(after)([0.99989, 2.00011]), 0.0, atol=1e-9)


def test_eases_shrink_where_there_is_no_room() -> None:
    after, findings = applied({**JAW, "from": 1.0, "to": 1.1, "ease_in_s": 0.3, "ease_out_s": 0.1})
    assert findings == ()
    np.testing.assert_allclose(change(after)([1.0, 1.075, 1.1]), [0, 0.2, 0], atol=2e-3)


def test_mute_leads_to_rest() -> None:
    stage = Stage("shape", {"jawOpen": "jawOpen"}, {"jawOpen": 0.1})
    mute = edits({"do": "mute", "shape": "jawOpen", "from": 1.0, "to": 2.0})
    after, _ = apply_edits(motion(), mute, stage, TRACK, 0.0)
    np.testing.assert_allclose(after.sample([1.1, 1.5, 1.9])[:, 0], 0.1, atol=1e-9)
    np.testing.assert_allclose(change(after)([0.9, 1.0, 2.0, 2.1]), 0, atol=1e-9)


def test_mute_of_the_whole_line() -> None:
    after, _ = applied({"do": "mute", "control": "jawOpen"})
    np.testing.assert_array_equal(after.curve("jawOpen"), 0)


REPLACE = {"do": "replace", "control": "jawOpen", "keys": [[0.1, 0.9], [0.2, 0.1]]}


def test_a_replaced_range_has_its_keys_and_no_jump() -> None:
    after, findings = applied({**REPLACE, "from": 1.0, "to": 1.5, "blend_s": 0.05})
    assert findings == ()
    np.testing.assert_allclose(after.sample([1.1, 1.15, 1.2, 1.4])[:, 0], [0.9, 0.5, 0.1, 0.1])
    np.testing.assert_allclose(change(after)([0.99, 1.0, 1.5, 1.6]), 0, atol=1e-9)
    fine_s = np.linspace(0.9, 1.6, 7001)
    # The steepest is the way from the old curve to the first key: within 0.05 s, no jump.
    assert np.abs(np.diff(after.sample(fine_s)[:, 0])).max() < 0.7 * 1.6 / 0.05 * 1e-4


def test_a_replaced_range_without_end_ends_with_its_keys() -> None:
    after, _ = applied({**REPLACE, "from": 1.0})
    np.testing.assert_allclose(change(after)([1.0, 1.2, 1.3]), 0, atol=1e-9)


def test_a_control_that_the_model_lacks_and_the_rig_has_is_added() -> None:
    after, findings = applied({"do": "offset", "control": "browInnerUp", "by": 0.4})
    assert findings == ()
    assert after.names == ("jawOpen", "tongueOut", "browInnerUp")
    np.testing.assert_array_equal(after.curve("browInnerUp"), 0.4)


def test_edits_apply_in_their_order() -> None:
    after, _ = applied({"do": "mute", "control": "jawOpen"}, JAW)
    np.testing.assert_allclose(after.curve("jawOpen"), 0.2)
    after, _ = applied(JAW, {"do": "mute", "control": "jawOpen"})
    np.testing.assert_allclose(after.curve("jawOpen"), 0.0)


MOMENTS = [
    ({"word": 3}, 1.5),
    ({"word": 3, "text": "boat"}, 1.5),
    ({"word": 1, "text": "Boat", "edge": "end", "plus_s": 0.1}, 1.1),
    ({"text": "bob"}, 1.0),
    ({"text": "bob", "phone": 2}, 1.1),
    ({"text": "bob", "symbol": "AA", "edge": "end"}, 1.4),
    ({"text": "bob", "symbol": "ɑ"}, 1.1),
    ({"phone": 6, "symbol": "B"}, 1.4),
    ({"word": 3, "phone": 1, "symbol": "B", "plus_s": -0.25}, 1.25),
]


@pytest.mark.parametrize(("moment", "at_s"), MOMENTS)
def test_words_and_phones_say_when(moment: dict[str, Any], at_s: float) -> None:
    by_word, findings = applied({**JAW, "from": moment})
    by_time, _ = applied({**JAW, "from": at_s})
    assert findings == ()
    np.testing.assert_allclose(by_word.sample(motion().times_s), by_time.sample(motion().times_s))


def test_an_edit_follows_its_word() -> None:
    later = replace(
        TRACK,
        phones=(Phone("sil", 0.0, 1.0), Phone("B", 1.0, 1.5), Phone("AA", 1.5, 2.5)),
        words=(Word("bob", 1.0, 2.5),),
    )
    edge = {"text": "bob"}
    after, findings = applied({**JAW, "from": edge, "to": {**edge, "edge": "end"}}, track=later)
    assert findings == ()
    np.testing.assert_allclose(change(after)([1.0, 1.2, 2.3, 2.5]), [0, 0.2, 0.2, 0], atol=1e-9)


@given(st.floats(0.0, 5.0))
@settings(deadline=None, derandomize=True, max_examples=20)
def test_a_preroll_moves_words_and_times_alike(lead_s: float) -> None:
    edit = {**JAW, "from": {"text": "bob"}, "to": 2.0}
    late, _ = applied(edit, track=led(TRACK, lead_s), lead_s=lead_s)
    plain = motion(3.0 + lead_s)
    at_s = np.array([0.9, 1.2, 1.8, 2.1])
    added = change(late, before=plain)(at_s + lead_s)
    np.testing.assert_allclose(added, [0, 0.2, 0.2, 0], atol=1e-9)


STALE = [
    ({**JAW, "from": {"word": 4}}, "edit-word-gone", "the line has 3"),
    ({**JAW, "from": {"word": 2, "text": "ship"}}, "edit-word-gone", "'ship' is gone"),
    ({**JAW, "from": {"text": "bob", "phone": 4}}, "edit-word-gone", "it has 3"),
    ({**JAW, "from": {"word": 2, "phone": 1, "symbol": "P"}}, "edit-word-gone", "is B, not P"),
    ({**JAW, "from": {"text": "bob", "symbol": "P"}}, "edit-word-gone", "not in the word 'bob'"),
    ({**JAW, "from": {"text": "boat"}}, "edit-word-unclear", "said 2 times"),
    ({**JAW, "from": {"text": "bob", "symbol": "B"}}, "edit-word-unclear", "2 times"),
    ({**JAW, "from": 3.5}, "edit-outside-line", "3.50 s, the line lasts from 0 to 3.00 s"),
    ({**JAW, "from": {"word": 3}, "to": 1.0}, "edit-range-empty", "ends at 1.00 s"),
    ({**JAW, "control": "jawOpne"}, "edit-curve-unknown", "no control 'jawOpne'"),
    ({"do": "mute", "control": "tongueOut"}, "edit-no-effect", "'tongueOut' is already so"),
    ({**JAW, "by": 0.0}, "edit-no-effect", "changes nothing"),
]


@pytest.mark.parametrize(("edit", "code", "word"), STALE)
def test_an_edit_that_means_nothing_says_so_and_is_left_out(
    edit: dict[str, Any], code: str, word: str
) -> None:
    after, findings = applied(edit, {**JAW, "by": 0.1})
    (finding,) = findings
    assert (finding.code, finding.severity.label) == (code, "warning")
    assert word in finding.message
    assert finding.place == "boat.edits.toml: edit 1"
    assert finding.action
    # The other edits hold as ever.
    np.testing.assert_allclose(change(after)([0.0, 1.5, 3.0]), 0.1, atol=1e-9)


LIMITED = [
    ({**JAW, "from": 2.0, "to": 5.0}, "edit-outside-line", "warning", "on to 5.00 s"),
    ({**JAW, "from": {"word": 1, "text": "bob"}}, "edit-word-moved", "info", "is now word 2"),
    ({**REPLACE, "from": 1.0, "to": 1.15}, "edit-keys-cut", "warning", "for 0.20 s"),
]


@pytest.mark.parametrize(("edit", "code", "severity", "word"), LIMITED)
def test_an_edit_that_means_less_is_applied_and_says_so(
    edit: dict[str, Any], code: str, severity: str, word: str
) -> None:
    after, (finding,) = applied(edit)
    assert (finding.code, finding.severity.label) == (code, severity)
    assert word in finding.message
    assert np.abs(change(after)(np.linspace(0, 3, 301))).max() > 0.1
    assert after.duration_s == 3.0


def test_the_text_that_edits_were_made_for_may_be_wrapped_anew() -> None:
    document = EditsDocument.model_validate(
        {"schema": "animeme.edits/1", "made_for_text": "a boat\nfor Bob"}
    )
    path = Path("boat.edits.toml")
    assert list(text_changed(document, path, "a boat for  Bob\n")) == []
    (finding,) = text_changed(document, path, "a ship for Bob")
    assert (finding.code, finding.severity.label) == ("edits-text-changed", "warning")
    assert "a ship for Bob" in finding.message


BROKEN = {
    "no TOML": ("edit = [", "document-unreadable", ""),
    "no schema": ("[[edit]]\n", "document-kind", "animeme.edits/1"),
    "unknown verb": ('do = "shake"\ncontrol = "a"', "document-invalid", "'offset', 'mute'"),
    "misspelt": ('do = "mute"\ncontrol = "a"\nform = 1.0', "document-invalid", "'from'"),
    "no curve": ('do = "mute"', "document-invalid", "a control or a shape"),
    "two curves": ('do = "mute"\ncontrol = "a"\nshape = "b"', "document-invalid", "one of the two"),
    "backwards": ('do = "mute"\ncontrol = "a"\nfrom = 2\nto = 1', "document-invalid", "before it"),
    "negative": ('do = "mute"\ncontrol = "a"\nfrom = -2', "document-invalid", "greater than"),
    "no moment": ('do = "mute"\ncontrol = "a"\nfrom = {edge = "end"}', "document-invalid", "word"),
    "keys back": (
        'do = "replace"\ncontrol = "a"\nkeys = [[1, 0], [0, 1]]', "document-invalid", "comes after",
    ),
    "one key": ('do = "replace"\ncontrol = "a"\nkeys = [[0, 1]]', "document-invalid", "say `to`"),
    "a jump": (
        'do = "replace"\ncontrol = "a"\nkeys = [[0, 1], [1, 1]]\nblend_s = 0',
        "document-invalid", "greater than 0",
    ),
}  # fmt: skip


@pytest.mark.parametrize("case", BROKEN)
def test_broken_edits_are_refused(case: str, tmp_path: Path) -> None:
    body, code, word = BROKEN[case]
    head = "" if code != "document-invalid" else 'schema = "animeme.edits/1"\n[[edit]]\n'
    path = tmp_path / "boat.edits.toml"
    path.write_text(head + body, encoding="utf-8")
    with pytest.raises(InputError) as caught:
        read_edits(path)
    assert caught.value.code == code
    assert word in str(caught.value)
