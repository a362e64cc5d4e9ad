"""What is written reads back; files appear whole or not at all."""

from __future__ import annotations

from itertools import pairwise
from pathlib import Path

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from animeme.errors import InputError
from animeme.phones import ARPABET_TO_IPA, SILENCE, Phone, PhoneTrack, Word, contiguous
from animeme_stages.align.interchange import FORMATS, Span, read_timings, track_from, write_timings
from animeme_stages.align.interchange.rhubarb import SHAPES, shapes_of
from animeme_stages.align.interchange.symbols import SILENCES
from animeme_stages.align.language import acoustic_phones
from support.timing_files import FOLDER, close

PROPERTY = settings(
    deadline=None,
    derandomize=True,
    max_examples=100,
    suppress_health_check=[HealthCheck.function_scoped_fixture],
)

_SYMBOLS = {
    "arpabet": sorted(ARPABET_TO_IPA),
    "ipa": ["a", "ə", "ɔ̃", "t͡ʃ", "ˈaː", "oʊ", "m", "ʁ", "ts", "p"],
}
_TEXTS = st.text(
    st.characters(exclude_categories=("C", "Z")) | st.sampled_from('"!<>;'), min_size=1, max_size=8
).filter(lambda text: text.lower() not in SILENCES and text == " ".join(text.split()))


@st.composite
def tracks(draw: st.DrawFn) -> PhoneTrack:
    inventory = draw(st.sampled_from(("arpabet", "ipa")))
    symbols = draw(st.lists(st.sampled_from(_SYMBOLS[inventory]), min_size=2, max_size=12))
    phones: list[Phone] = []
    words: list[Word] = []
    cursor_s = draw(st.sampled_from((0.0, 0.25)))
    for symbol in symbols:
        end_s = cursor_s + draw(st.floats(0.012, 0.6))
        phones.append(Phone(symbol, cursor_s, end_s))
        words.append(Word(draw(_TEXTS), cursor_s, end_s))
        cursor_s = end_s + draw(st.sampled_from((0.0, 0.0, 0.1)))
    duration_s = phones[-1].end_s + draw(st.sampled_from((0.0, 0.3)))
    kept = tuple(words) if draw(st.booleans()) else ()
    return PhoneTrack("en", inventory, contiguous(phones, duration_s), kept)


def _spans(track: PhoneTrack) -> tuple[tuple[Span, ...], tuple[Span, ...]]:
    return (
        tuple(Span(word.text, word.start_s, word.end_s) for word in track.words),
        tuple(Span(phone.symbol, phone.start_s, phone.end_s) for phone in track.phones),
    )


def put(track: PhoneTrack, path: Path, format: str) -> None:
    """As `write_timings`, without waiting for the disk."""
    write = FORMATS[format].write
    assert write
    path.write_text(write(track, path.stem), encoding="utf-8", newline="\n")


@pytest.mark.parametrize("format", ["textgrid", "alignment"])
def test_tracks_survive_the_round_trip_exactly(format: str, tmp_path: Path) -> None:
    path = tmp_path / ("a.TextGrid" if format == "textgrid" else "a.json")

    @PROPERTY
    @given(tracks())
    def check(track: PhoneTrack) -> None:
        put(track, path, format)
        found = read_timings(path)
        assert found.duration_s == track.duration_s
        again = track_from(
            found, language="en", inventory=track.inventory, duration_s=track.duration_s
        )
        assert _spans(again) == _spans(track)

    check()


def test_ctm_round_trip_to_the_microsecond(tmp_path: Path) -> None:
    path = tmp_path / "a line; with spaces.ctm"

    @PROPERTY
    @given(tracks())
    def check(track: PhoneTrack) -> None:
        words, phones = _spans(track)
        put(track, path, "phone-ctm")
        found = read_timings(path)
        assert close(found.phones or found.words, phones if found.phones else _spoken(phones), 2e-6)
        put(track, path, "ctm")
        found = read_timings(path)
        if words:
            assert close(found.words or found.phones, words, 2e-6)

    check()


def _spoken(spans: tuple[Span, ...]) -> tuple[Span, ...]:
    return tuple(span for span in spans if span.label != SILENCE)


def test_rhubarb_cues_cover_the_recording(tmp_path: Path) -> None:
    path = tmp_path / "a.tsv"

    @PROPERTY
    @given(tracks())
    def check(track: PhoneTrack) -> None:
        put(track, path, "rhubarb-tsv")
        found = read_timings(path)
        assert found.events[0].start_s == 0.0
        assert found.duration_s == pytest.approx(track.duration_s, abs=0.011)
        for before, after in pairwise(found.events):
            assert before.end_s == after.start_s
            assert before.label != after.label
        for phone in track.phones:
            if phone.duration_s > 0.03 and phone.symbol in ("M", "m", "P", "p", "B"):
                middle_s = (phone.start_s + phone.end_s) / 2
                assert _shape_at(found.events, middle_s) == "A"

    check()


def _shape_at(events: tuple[Span, ...], time_s: float) -> str:
    return next(event.label for event in events if event.start_s <= time_s < event.end_s)


def test_rhubarb_text(tmp_path: Path) -> None:
    track = track_from(read_timings(FOLDER / "long.TextGrid"), language="en", duration_s=1.2)
    write_timings(track, tmp_path / "a.tsv", "rhubarb-tsv")
    # sil, HH AH, L, OW in two halves, W, ER, L, D, sil, and the end
    assert (tmp_path / "a.tsv").read_text(encoding="utf-8") == (
        "0.00\tX\n0.10\tC\n0.22\tH\n0.30\tE\n0.38\tF\n0.55\tE\n0.70\tH\n0.80\tB\n0.90\tX\n1.20\tX\n"
    )


def test_every_phone_has_a_mouth_shape() -> None:
    for symbol in (*ARPABET_TO_IPA, *ARPABET_TO_IPA.values(), SILENCE):
        assert set(shapes_of(symbol)) <= SHAPES
    for symbol, ipa in ARPABET_TO_IPA.items():
        assert acoustic_phones(ipa) != (symbol,) or shapes_of(ipa) == shapes_of(symbol)


def test_a_textgrid_looks_like_praats_own(tmp_path: Path) -> None:
    track = PhoneTrack(
        "en", "arpabet", (Phone(SILENCE, 0.0, 0.1), Phone("AA", 0.1, 0.5)), (Word('a"h', 0.1, 0.5),)
    )
    write_timings(track, tmp_path / "a.TextGrid", "textgrid")
    text = (tmp_path / "a.TextGrid").read_text(encoding="utf-8")
    assert text.startswith(
        'File type = "ooTextFile"\nObject class = "TextGrid"\n\nxmin = 0\nxmax = 0.5\n'
        "tiers? <exists>\nsize = 2\nitem []:\n    item [1]:\n"
    )
    assert 'text = "a""h"' in text


def test_an_unwritable_format_lists_the_others(tmp_path: Path) -> None:
    track = PhoneTrack("en", "arpabet", (Phone("AA", 0.0, 0.5),))
    with pytest.raises(InputError, match="textgrid, rhubarb-tsv, ctm, phone-ctm, alignment"):
        write_timings(track, tmp_path / "a.srt", "srt")
    with pytest.raises(InputError, match="timings-format"):
        write_timings(track, tmp_path / "a.x", "x")
    assert list(tmp_path.iterdir()) == []


def test_nothing_is_left_of_a_failed_write(tmp_path: Path) -> None:
    track = PhoneTrack("en", "arpabet", (Phone("AA", 0.0, 0.5),))
    (tmp_path / "a").write_text("a file, not a folder", encoding="utf-8")
    with pytest.raises(InputError, match="output-unwritable"):
        write_timings(track, tmp_path / "a" / "b.TextGrid", "textgrid")
    assert [path.name for path in tmp_path.iterdir()] == ["a"]
