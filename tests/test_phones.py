"""Phone tracks keep their invariants; gaps become pauses."""

from __future__ import annotations

import json
from itertools import pairwise
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from animeme import documents, registry
from animeme.phones import (
    ARPABET,
    ARPABET_TO_IPA,
    SILENCE,
    Phone,
    PhoneTrack,
    Word,
    contiguous,
    plain_ipa,
)
from animeme_stages.align.language import acoustic_phones
from animeme_stages.synthesize.cohen_massaro import CohenMassaro
from animeme_stages.synthesize.segments import split_symbol

PROPERTY = settings(deadline=None, derandomize=True, max_examples=150)
NAN, INF = float("nan"), float("inf")


def track(*phones: Phone, words: tuple[Word, ...] = (), inventory: Any = "arpabet") -> PhoneTrack:
    return PhoneTrack("en", inventory, phones, words)


# Invariants

BROKEN: dict[str, tuple[list[Phone], str]] = {
    "no phones": ([], "at least one"),
    "late start": ([Phone("AA", 0.5, 1.0)], "starts at 0.5"),
    "early start": ([Phone("AA", -0.5, 1.0)], "starts at -0.5"),
    "start not a number": ([Phone("AA", NAN, 1.0)], "starts at nan"),
    "no length": ([Phone("AA", 0.0, 0.0)], "'AA' at 0.0 s has no length"),
    "negative length": ([Phone("AA", 0.0, 1.0), Phone("B", 1.0, 0.5)], "'B' at 1.0 s has no"),
    "end not a number": ([Phone("AA", 0.0, NAN)], "'AA'"),
    "end infinite": ([Phone("AA", 0.0, INF)], "'AA'"),
    "gap": ([Phone("AA", 0.0, 1.0), Phone("B", 1.1, 2.0)], "gap or overlap .* 1.0 s"),
    "overlap": ([Phone("AA", 0.0, 1.0), Phone("B", 0.9, 2.0)], "gap or overlap .* 1.0 s"),
    "stranger": ([Phone("AX", 0.0, 1.0)], "'AX' at 0.0 s is not in ARPAbet"),
    "stress": ([Phone("AA1", 0.0, 1.0)], "'AA1'"),
    "lower case": ([Phone("aa", 0.0, 1.0)], "'aa'"),
}


@pytest.mark.parametrize("case", BROKEN)
def test_a_broken_invariant_raises_and_names_the_offender(case: str) -> None:
    phones, message = BROKEN[case]
    with pytest.raises(ValueError, match=message):
        track(*phones)


BROKEN_WORDS: dict[str, tuple[Word, ...]] = {
    "overlap": (Word("a", 0.0, 0.6), Word("b", 0.5, 1.0)),
    "order": (Word("a", 0.5, 1.0), Word("b", 0.0, 0.5)),
    "end before start": (Word("a", 0.9, 0.1),),
    "not a number": (Word("a", NAN, 0.5),),
    "before the recording": (Word("a", -0.5, 0.5),),
    "behind the recording": (Word("a", 0.5, 7.0),),
}


@pytest.mark.parametrize("case", BROKEN_WORDS)
def test_words_are_in_order_and_within_the_recording(case: str) -> None:
    with pytest.raises(ValueError, match="'a'"):
        track(Phone("AA", 0.0, 1.0), words=BROKEN_WORDS[case])


def test_words_may_touch() -> None:
    words = (Word("a", 0.0, 0.5), Word("b", 0.5, 1.0))
    assert track(Phone("AA", 0.0, 1.0), words=words).words == words


# Filling


@st.composite
def phone_lists(draw: st.DrawFn) -> tuple[list[Phone], float]:
    """Phones in order without overlap, some without length, some behind the end."""
    phones = []
    cursor = draw(st.sampled_from((0.0, 0.0, 0.3, -0.2)))
    for _ in range(draw(st.integers(0, 8))):
        cursor += draw(st.sampled_from((0.0, 0.0, 0.01, 0.1, 1e-9, 0.7)))
        length = draw(st.sampled_from((0.0, 0.03, 0.1, 1.0, 1e-9)))
        symbol = draw(st.sampled_from((SILENCE, SILENCE, "AA", "B")))
        phones.append(Phone(symbol, cursor, cursor + length, -1.0))
        cursor += length
    return phones, draw(st.sampled_from((0.05, 0.5, 2.0, max(cursor, 0.01), max(cursor / 2, 0.01))))


@given(phone_lists())
@PROPERTY
def test_filled_phones_make_a_track_to_the_end(drawn: tuple[list[Phone], float]) -> None:
    phones, duration_s = drawn
    filled = contiguous(phones, duration_s)
    made = track(*filled)  # gapless from 0, every phone has a length
    assert made.duration_s == duration_s
    assert not any(a.symbol == b.symbol == SILENCE for a, b in pairwise(filled))


@given(phone_lists())
@PROPERTY
def test_spoken_phones_keep_their_times_order_and_scores(drawn: tuple[list[Phone], float]) -> None:
    phones, duration_s = drawn
    spoken = [p for p in contiguous(phones, duration_s) if p.symbol != SILENCE]
    cut = [
        Phone(p.symbol, max(p.start_s, 0.0), min(p.end_s, duration_s), p.score)
        for p in phones
        if p.symbol != SILENCE
    ]
    assert spoken == [p for p in cut if p.end_s > p.start_s]


@given(phone_lists())
@PROPERTY
def test_filling_again_changes_no_time(drawn: tuple[list[Phone], float]) -> None:
    phones, duration_s = drawn
    once = contiguous(phones, duration_s)
    twice = contiguous(once, duration_s)
    assert [(p.symbol, p.start_s, p.end_s) for p in twice] == [
        (p.symbol, p.start_s, p.end_s) for p in once
    ]


def test_gaps_and_pauses_become_one_pause() -> None:
    phones = [Phone("B", 0.2, 0.4), Phone(SILENCE, 0.5, 0.6), Phone("AA", 0.7, 0.8)]
    assert contiguous(phones, 1.0) == (
        Phone(SILENCE, 0.0, 0.2),
        Phone("B", 0.2, 0.4),
        Phone(SILENCE, 0.4, 0.7),
        Phone("AA", 0.7, 0.8),
        Phone(SILENCE, 0.8, 1.0),
    )


def test_no_phones_are_one_pause() -> None:
    assert contiguous([], 1.5) == (Phone(SILENCE, 0.0, 1.5),)


# Symbols


def test_arpabet_is_complete() -> None:
    assert len(ARPABET) == len(ARPABET_TO_IPA) == 39
    assert len(set(ARPABET_TO_IPA.values())) == 39
    assert [symbol for symbol, _, _ in ARPABET] == sorted(ARPABET_TO_IPA)
    assert all(example for _, _, example in ARPABET)


@pytest.mark.parametrize(("symbol", "ipa"), ARPABET_TO_IPA.items())
def test_every_arpabet_phone_is_its_own_acoustic_phone(symbol: str, ipa: str) -> None:
    assert plain_ipa(ipa) == ipa
    assert acoustic_phones(ipa) == (symbol,)


@pytest.mark.parametrize("symbol", [*ARPABET_TO_IPA, SILENCE])
def test_every_arpabet_phone_moves_the_shipped_model(symbol: str) -> None:
    model = registry.load_model("cohen-massaro")
    assert isinstance(model, CohenMassaro)
    phones = (Phone(SILENCE, 0.0, 0.2), Phone(symbol, 0.2, 0.5), Phone(SILENCE, 0.5, 0.8))
    curves = model.synthesize(track(*phones), rate_hz=60)
    assert curves.names == model.controls
    assert curves.duration_s == 0.8
    (ipa,) = track(Phone(symbol, 0.0, 1.0)).ipa()
    assert "".join(split_symbol(ipa, model.table.rows)) == ipa  # no piece is unknown


@pytest.mark.parametrize(
    ("symbol", "plain"),
    [
        ("ˈaː", "a"),
        ("t͡s", "ts"),
        ("ɔ̃", "ɔ"),
        ("\u00f5", "o"),
        ("o\u0303", "o"),
        ("n̩", "n"),
        ("pʰ", "p"),
        ("lʲ", "l"),
        ("\u00e7", "\u00e7"),
        ("c\u0327", "\u00e7"),
        ("ɹ", "ɹ"),
        ("eɪ", "eɪ"),
        ("", ""),
    ],
)
def test_plain_ipa_drops_what_the_lips_do_not_show(symbol: str, plain: str) -> None:
    assert plain_ipa(symbol) == plain


def test_a_track_gives_plain_ipa_of_either_inventory() -> None:
    times = [(i / 4, (i + 1) / 4) for i in range(3)]
    symbols = {"arpabet": ("sil", "TH", "ER"), "ipa": ("sil", "ˈaː", "t͡s")}
    expected = {"arpabet": ("sil", "θ", "ɝ"), "ipa": ("sil", "a", "ts")}
    for inventory, names in symbols.items():
        phones = (Phone(name, *time) for name, time in zip(names, times, strict=True))
        assert track(*phones, inventory=inventory).ipa() == expected[inventory]


# Documents


@given(phone_lists(), st.sampled_from(("en", "de-AT", "pt_BR")))
@PROPERTY
def test_a_document_gives_back_the_track(drawn: tuple[list[Phone], float], language: str) -> None:
    phones = contiguous(*drawn)
    words = tuple(
        Word(f"wörd{i}", p.start_s, p.end_s, (i, i + 1))
        for i, p in enumerate(phones)
        if p.symbol != SILENCE
    )
    made = PhoneTrack(language, "arpabet", phones, words)
    document = json.loads(json.dumps(made.to_document(), allow_nan=False))
    assert PhoneTrack.from_document(document) == made
    assert document["duration_s"] == made.duration_s
    documents.type_of("alignment").model_validate(document)


def test_a_document_with_a_gap_is_refused() -> None:
    document = track(Phone("AA", 0.0, 1.0), Phone("B", 1.0, 2.0)).to_document()
    document["phones"][1]["start_s"] = 1.5
    with pytest.raises(ValueError, match="gap"):
        PhoneTrack.from_document(document)
