"""Timings become tracks and anchors, or a message that names the culprit."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from animeme.errors import InputError
from animeme.phones import SILENCE, PhoneTrack
from animeme_stages.align.interchange import Span, Timings, anchors, read_timings, track_from
from support.timing_files import FOLDER


def timings(*phones: Span, words: tuple[Span, ...] = ()) -> Timings:
    return Timings(words, phones, (), None, "ctm")


def symbols(track: PhoneTrack) -> str:
    return " ".join(phone.symbol for phone in track.phones)


def refused(call: Any, *arguments: Any, **named: Any) -> InputError:
    with pytest.raises(InputError) as caught:
        call(*arguments, **named)
    return caught.value


@pytest.mark.parametrize(
    "name", ["long.TextGrid", "phones.ctm", "ticks.lab", "with-words.lab", "alignment.json"]
)
def test_stress_case_and_positions_are_dropped(name: str) -> None:
    track = track_from(read_timings(FOLDER / name), language="en", duration_s=1.2)
    assert track.inventory == "arpabet"
    assert symbols(track) == "sil HH AH L OW W ER L D sil"
    assert track.phones[4].start_s == pytest.approx(0.3)
    assert track.duration_s == 1.2


def test_ipa_stays_as_it_is() -> None:
    track = track_from(read_timings(FOLDER / "mfa.TextGrid"), language="en", duration_s=1.2)
    assert track.inventory == "ipa"
    assert symbols(track) == "sil h ə l əw w ɝ ɫ d sil"
    assert [w.text for w in track.words] == ["hello", "world"]


def test_gaps_and_the_rest_of_the_recording_are_pauses() -> None:
    track = track_from(
        timings(Span("AA1", 0.2, 0.3), Span("B", 0.4, 0.5)), language="en", duration_s=1.0
    )
    assert [(p.symbol, p.start_s, p.end_s) for p in track.phones] == [
        (SILENCE, 0.0, 0.2),
        ("AA", 0.2, 0.3),
        (SILENCE, 0.3, 0.4),
        ("B", 0.4, 0.5),
        (SILENCE, 0.5, 1.0),
    ]


@pytest.mark.parametrize("label", ["", "sil", "SP", "spn", "<eps>", "pau", "h#"])
def test_silence_labels(label: str) -> None:
    track = track_from(
        timings(Span(label, 0.0, 0.2), Span("AA1", 0.2, 0.3)), language="en", duration_s=0.3
    )
    assert [p.symbol for p in track.phones] == [SILENCE, "AA"]


def test_kaldi_and_htk_contexts_are_dropped() -> None:
    track = track_from(
        timings(Span("sil-hh+ah", 0.0, 0.1), Span("hh-ah+l", 0.1, 0.2), Span("L_E", 0.2, 0.3)),
        language="en",
        duration_s=0.3,
    )
    assert symbols(track) == "HH AH L"


def test_small_letters_alone_are_ipa() -> None:
    track = track_from(
        timings(Span("t", 0.0, 0.1), Span("y", 0.1, 0.3)), language="fr", duration_s=0.3
    )
    assert track.inventory == "ipa"


def test_an_unknown_symbol_is_named_with_its_time() -> None:
    error = refused(
        track_from,
        timings(Span("AA1", 0.1, 0.2), Span("PT", 0.52, 0.6)),
        language="en",
        duration_s=1.0,
        place="bobby.TextGrid",
    )
    assert error.code == "timings-symbol-unknown"
    assert "'PT' at 0.520 s is not ARPAbet" in str(error)
    assert error.place == "bobby.TextGrid"


def test_the_demanded_inventory_is_kept_to() -> None:
    ipa = timings(Span("ə", 0.1, 0.2))
    assert "'ə'" in str(
        refused(track_from, ipa, language="en", inventory="arpabet", duration_s=1.0)
    )
    assert track_from(ipa, language="en", inventory="ipa", duration_s=1.0).inventory == "ipa"


def test_real_labels(shared: Path) -> None:
    folder = shared / "data" / "phone-labels"
    mary = track_from(read_timings(folder / "mary.TextGrid"), language="en", duration_s=1.869687)
    assert (mary.inventory, len(mary.phones), len(mary.words)) == ("ipa", 16, 4)
    error = refused(
        track_from,
        read_timings(folder / "bobby_phones.TextGrid"),
        language="en",
        duration_s=1.194625,
    )
    assert "'PT' at 0.521 s" in str(error)
    spans = anchors(read_timings(folder / "bobby_words.TextGrid"), duration_s=1.194625)
    assert [span.label for span in spans] == ["BOBBY", "RIPPED", "THE", "LEDGER"]


def test_timings_of_a_longer_recording_are_refused() -> None:
    found = read_timings(FOLDER / "long.TextGrid")
    error = refused(track_from, found, language="en", duration_s=0.8)
    assert error.code == "timings-too-long"
    assert "speech ends at 0.900 s, but the recording at 0.800 s" in str(error)
    assert refused(anchors, found, duration_s=0.8).code == "timings-too-long"
    # Silence may be trimmed, and a frame of padding is nobody's fault.
    assert track_from(found, language="en", duration_s=0.88).duration_s == 0.88
    assert anchors(found, duration_s=0.88)[-1].end_s == 0.88


def test_a_subtitle_may_stay_a_while_after_the_recording() -> None:
    cue = Timings((Span("hello world", 0.1, 1.9),), (), (), None, "srt")
    assert anchors(cue, duration_s=1.2)[0].end_s == 1.2
    assert refused(anchors, cue, duration_s=0.8).code == "timings-too-long"


def test_what_is_missing_is_said() -> None:
    words = read_timings(FOLDER / "words.ctm")
    assert refused(track_from, words, language="en", duration_s=1.2).code == (
        "timings-without-phones"
    )
    assert anchors(words, duration_s=1.2) == words.words
    cues = read_timings(FOLDER / "rhubarb.tsv")
    assert refused(anchors, cues, duration_s=1.2).code == "timings-without-words"
