"""Inline tags: never spoken, kept as timed events from the transcript to the files."""

from __future__ import annotations

import json
import random
import shutil
from itertools import pairwise
from pathlib import Path

import pygltflib
import pytest
import soundfile
from pxr import Usd

import animeme
from animeme import documents
from animeme.phones import Event, Phone, PhoneTrack, Word
from animeme_stages.align.interchange import FORMATS, read_timings, track_from, write_timings
from animeme_stages.align.language import language
from animeme_stages.align.tags import tag_spans, timed_tags, unpaired_brackets
from animeme_stages.align.text import tokens
from conftest import SAMPLE


def spoken(text: str) -> list[str]:
    return [token.text for token in tokens(text, language("en"))]


def words(text: str) -> tuple[Word, ...]:
    """The words of `text`, each half a second long with as much pause before it."""
    return tuple(
        Word(token.text, index + 0.5, index + 1.0, (token.start, token.end))
        for index, token in enumerate(tokens(text, language("en")))
    )


def events(text: str) -> list[tuple[str, float]]:
    return [(event.tag, event.time_s) for event in timed_tags(text, words(text))]


# What each text has of tags and of words.
CASES: dict[str, tuple[list[tuple[str, float]], str]] = {
    "[laughs] oh no": ([("laughs", 0.5)], "oh no"),
    "oh [laughs] no": ([("laughs", 1.5)], "oh no"),
    "oh no [laughs]": ([("laughs", 2.0)], "oh no"),
    'oh <break time="1s"/>no': ([('break time="1s"', 1.5)], "oh no"),
    "[emotion:happy]oh no[/emotion] yes": (
        [("emotion:happy", 0.5), ("/emotion", 2.0)],
        "oh no yes",
    ),
    "oh <b>no</b> yes": ([("b", 1.5), ("/b", 2.0)], "oh no yes"),
    "[HeadNod type=quadruplet v1=0.5]oh[/HeadNod] no": (
        [("HeadNod type=quadruplet v1=0.5", 0.5), ("/HeadNod", 1.0)],
        "oh no",
    ),
    "<1.5> oh <23> no": ([("1.5", 0.5), ("23", 1.5)], "oh no"),  # FaceFX's chunks
    '<?xml version="1.0"?><speak>oh</speak>': (
        [('?xml version="1.0"?', 0.5), ("speak", 0.5), ("/speak", 1.0)],
        "oh",
    ),
    '<mark name="a > b"/>oh': ([('mark name="a > b"', 0.5)], "oh"),
    "<mark name='it>s'/>oh": ([("mark name='it>s'", 0.5)], "oh"),
    '<mark name="[">oh [x]': ([('mark name="["', 0.5), ("x", 1.0)], "oh"),
    "<break\n  time='1s'\n/>oh": ([("break time='1s'", 0.5)], "oh"),
    "[a][b] oh": ([("a", 0.5), ("b", 0.5)], "oh"),
    "oh [x][/x] no": ([("x", 1.5), ("/x", 1.5)], "oh no"),  # never back in time
    "[/x] oh": ([("/x", 0.5)], "oh"),
    "[laughs]": ([("laughs", 0.0)], ""),
    # Nested and crossed brackets: the outermost are the tag.
    "[sad [very] deep] oh": ([("sad [very] deep", 0.5)], "oh"),
    "[see <b>this</b>] oh": ([("see <b>this</b>", 0.5)], "oh"),
    "[a <b] oh> no": ([("a <b", 0.5)], "oh no"),
    "<b [c> oh] no": ([("b [c", 0.5)], "oh no"),
    # What is no tag loses no word.
    "[laughs oh no": ([], "laughs oh no"),
    "oh] no": ([], "oh no"),
    "[laughs oh [sighs] no": ([("sighs", 1.0 + 1.5)], "laughs oh no"),
    "oh [sighs] no] yes [x": ([("sighs", 1.5)], "oh no yes x"),
    "five < six": ([], "five six"),
    "five <six": ([], "five six"),
    "five < six and seven > six": ([], "five six and seven six"),
    "five <6 and 7> six": ([], "five six and seven six"),
    "five <= six >= two": ([], "five equals six equals two"),
    "oh <-- no -->": ([], "oh no"),
    "I <3 you > me": ([], "i three you me"),
    "oh <b no <i> yes": ([("i", 2.0 + 0.5 + 0.0 + 1.0)], "oh b no yes"),
    "oh [] <> [ ] no": ([], "oh no"),
    # Any script
    "[😀 laughs] oh 😀 <🙂>no": ([("😀 laughs", 0.5), ("🙂", 1.5)], "oh no"),
    "[يضحك] oh [צוחק]": ([("يضحك", 0.5), ("צוחק", 1.0)], "oh"),
    "\u202b[يضحك]\u202c oh": ([("يضحك", 0.5)], "oh"),
    "[\0lau\x07ghs\u2028\ud800] oh": ([("lau ghs", 0.5)], "oh"),
}


@pytest.mark.parametrize("text", CASES, ids=ascii)
def test_tags_are_timed_and_everything_else_is_spoken(text: str) -> None:
    found, said = CASES[text]
    assert events(text) == found
    assert " ".join(spoken(text)) == said


@pytest.mark.parametrize("text", CASES, ids=ascii)
def test_events_say_where_they_stand(text: str) -> None:
    for event in timed_tags(text, words(text)):
        start, end = event.source
        assert (text[start], text[end - 1]) in {("[", "]"), ("<", ">")}
    made = PhoneTrack(
        "en", "ipa", (Phone("a", 0.0, 9.0),), words(text), timed_tags(text, words(text))
    )
    assert PhoneTrack.from_document(json.loads(json.dumps(made.to_document()))) == made


def test_a_number_of_several_words_is_one_place() -> None:
    text = "I have [pause] 42 [end] cats"
    assert spoken(text) == ["i", "have", "forty", "two", "cats"]
    assert events(text) == [("pause", 2.5), ("end", 4.5)]


@pytest.mark.parametrize("seed", range(20))
def test_any_mixture_of_brackets_is_linear_and_ordered(seed: int) -> None:
    chance = random.Random(seed)
    text = "".join(chance.choices("<>[]/ =\"'ab1\n-!?", k=chance.choice((5, 50, 5000))))
    spans = tag_spans(text)
    assert all(a[1] <= b[0] for a, b in pairwise(spans))
    found = timed_tags(text, words(text))
    assert [e.source for e in found] == sorted(e.source for e in found)
    assert [e.time_s for e in found] == sorted(e.time_s for e in found)
    inside = {at for span in spans for at in range(*span)}
    heard = {at for t in tokens(text, language("en")) for at in range(t.start, t.end)}
    assert heard.isdisjoint(inside)
    assert all(at in heard or at in inside for at, c in enumerate(text) if c in "ab1")


@pytest.mark.parametrize(
    "unit",
    ["<", "[", "]", "[]", "<a", '<a b="', "<a b='\"", "<=", "= ", "[<", "<a>[b]", "<1", "<!--"],
)
def test_hundred_thousand_brackets_end_soon(unit: str) -> None:
    text = unit * (100_000 // len(unit))
    tag_spans(text)  # that these return is the test
    assert all(finding.message for finding in unpaired_brackets(text))


@pytest.mark.parametrize(
    ("text", "place"),
    [("[laughs oh no", 1), ("oh] no", 3), ("a [b [c] d", 3), ("[a]", 0), ("5 < 6", 0)],
)
def test_a_bracket_without_partner_is_reported_where_it_stands(text: str, place: int) -> None:
    found = list(unpaired_brackets(text))
    assert [finding.code for finding in found] == (["transcript-bracket"] if place else [])
    if place:
        assert f"character {place} " in found[0].message


# Tracks and documents


def track(*found: Event) -> PhoneTrack:
    phones = (Phone("sil", 0.0, 0.5), Phone("OW", 0.5, 1.0))
    return PhoneTrack("en", "arpabet", phones, (Word("oh", 0.5, 1.0, (0, 2)),), found)


@pytest.mark.parametrize(
    "found",
    [
        (Event("", 0.0),),
        (Event("a", -0.1),),
        (Event("a", 1.1),),
        (Event("a", float("nan")),),
        (Event("a", 0.6), Event("b", 0.5)),
    ],
)
def test_events_out_of_place_are_refused(found: tuple[Event, ...]) -> None:
    with pytest.raises(ValueError, match="tag"):
        track(*found)
    assert track(Event("a", 0.0), Event("b", 1.0), Event("c", 1.0)).events[-1].tag == "c"


def test_documents_from_before_there_were_events_still_load() -> None:
    document = track(Event("a", 0.5, (0, 3))).to_document()
    documents.type_of("alignment").model_validate(document)
    del document["events"]
    documents.type_of("alignment").model_validate(document)
    assert PhoneTrack.from_document(document) == track()


# Files

MANY = (
    Event('break time="1s"', 0.0),
    Event("emotion: happy", 0.5),
    Event("laughs", 0.5),
    Event("😀 يضحك", 0.75),
    Event("/emotion", 1.0),
)


@pytest.mark.parametrize(("name", "form"), [("a.TextGrid", "textgrid"), ("a.json", "alignment")])
def test_events_survive_the_round_trip(name: str, form: str, tmp_path: Path) -> None:
    write_timings(track(*MANY), tmp_path / name, form)
    again = track_from(read_timings(tmp_path / name), language="en", duration_s=1.0)
    assert again.events == MANY
    assert (again.phones, len(again.words)) == (track().phones, 1)
    write_timings(track(), tmp_path / name, form)
    assert track_from(read_timings(tmp_path / name), language="en", duration_s=1.0).events == ()


@pytest.mark.parametrize("form", [name for name, form in FORMATS.items() if form.write])
def test_events_do_not_get_into_the_words_of_other_formats(form: str, tmp_path: Path) -> None:
    path = tmp_path / f"a{FORMATS[form].suffixes[0]}"
    write_timings(track(*MANY), path, form)
    found = read_timings(path)
    assert {span.label for span in found.words} <= {"oh", "OW"}


def test_praatio_reads_the_tier_of_events(tmp_path: Path) -> None:
    textgrid = pytest.importorskip("praatio.textgrid", reason="praatio is not installed")
    path = tmp_path / "a.TextGrid"
    write_timings(track(*MANY), path, "textgrid")
    grid = textgrid.openTextgrid(str(path), includeEmptyIntervals=True, reportingMode="error")
    assert grid.tierNames == ("words", "phones", "events")
    tier = grid.getTier("events")
    # praatio leaves a point's doubled quotation marks as they are.
    assert [(entry.time, entry.label.replace('""', '"')) for entry in tier.entries] == [
        (0.0, 'break time="1s"'),
        (0.5, "emotion: happy\nlaughs"),
        (0.75, "😀 يضحك"),
        (1.0, "/emotion"),
    ]


# Assets


@pytest.fixture(scope="module")
def spoken_assets(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The sample's crab and Ada with one line whose given timings have tags."""
    folder = tmp_path_factory.mktemp("tagged")
    (folder / "dialogue" / "en").mkdir(parents=True)
    recording = SAMPLE / "dialogue" / "en" / "moon.wav"
    shutil.copyfile(recording, folder / "dialogue" / "en" / "moon.wav")
    length_s = soundfile.info(recording).duration
    phones = (Phone("sil", 0.0, 0.5), Phone("M", 0.5, 0.7), Phone("UW", 0.7, length_s))
    timed = PhoneTrack("en", "arpabet", phones, (), MANY)
    write_timings(timed, folder / "dialogue" / "en" / "moon.TextGrid", "textgrid")
    assets = [str(SAMPLE / name) for name in ("ada.glb", "ada.usdc")]
    (folder / "job.toml").write_text(
        f'[job]\nname = "t"\n[dialogue]\nroot = "dialogue"\n[characters.ada]\nasset = {assets}\n',
        encoding="utf-8",
    )
    report = animeme.run(folder / "job.toml", output=folder / "out", executor="inline")
    assert report.lines[0].outputs, report.all_findings
    return folder / "out"


WRITTEN = [(event.tag, event.time_s) for event in MANY]


def test_a_gltf_animation_carries_the_tags(spoken_assets: Path) -> None:
    (path,) = spoken_assets.rglob("*.glb")
    extras = [a.extras.get("animeme", {}) for a in pygltflib.GLTF2.load(str(path)).animations]
    (note,) = (note for note in extras if note.get("line") == "moon")
    assert [(event["tag"], event["time_s"]) for event in note["events"]] == WRITTEN


def test_a_usd_animation_carries_the_tags(spoken_assets: Path) -> None:
    notes = []
    for path in spoken_assets.rglob("*.usd*"):
        stage = Usd.Stage.Open(str(path))
        data = [prim.GetCustomDataByKey("animeme") or {} for prim in stage.TraverseAll()]
        notes += [note for note in data if "eventTags" in note]
    assert notes
    for note in notes:
        found = zip(note["eventTags"], note["eventTimes_s"], strict=True)
        assert list(found) == WRITTEN


def test_the_alignment_of_a_run_keeps_the_tags(spoken_assets: Path) -> None:
    document = documents.read("alignment", spoken_assets / "alignments" / "en" / "moon.json")
    assert PhoneTrack.from_document(document).events == MANY
