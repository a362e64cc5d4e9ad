"""Times of words and subtitles beside a recording hold the phones that are found for it."""

from __future__ import annotations

import json
import re
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest

import animeme
from animeme.contracts import Alignment, Anchor, Speech
from animeme.errors import InputError
from animeme.findings import Finding, Severity
from animeme.phones import Phone, PhoneTrack, Word, contiguous
from animeme_stages.align.anchors import SUBTITLE_SLACK_S, WORD_SLACK_S, anchors_of, match
from animeme_stages.align.interchange import Span, kind_of
from animeme_stages.align.language import language
from animeme_stages.align.text import tokens
from animeme_stages.ingest.audio import read_speech
from animeme_stages.ingest.timings import read_alignment
from conftest import SAMPLE
from support.timing_files import FOLDER, NAMES
from support.word_timings import WRITERS, ctm, cues

Capture = pytest.CaptureFixture[str]
BOAT = SAMPLE / "dialogue" / "en" / "boat.wav"
TEXT = "Mama bought a big blue boat for Bob."
WORDS = ("mama", "bought", "a", "big", "blue", "boat", "for", "bob")


@dataclass
class Placer:
    """An aligner that puts each word where its anchor says, and remembers what it was asked."""

    duration_s: float
    text: str = ""
    anchors: tuple[Anchor, ...] = ()
    findings: tuple[Finding, ...] = field(default=())

    def __call__(self, text: str, anchors: Sequence[Anchor]) -> Alignment:
        self.text, self.anchors = text, tuple(anchors)
        words = []
        for anchor in anchors or [Anchor(0, len(text), 0.0, self.duration_s, 0.0)]:
            spoken = tokens(text, language("en"))
            inside = [t for t in spoken if anchor.start <= t.start < anchor.end]
            edges = np.linspace(anchor.start_s, anchor.end_s, len(inside) + 1).tolist()
            words += [
                Word(t.text, *edge, (t.start, t.end))
                for t, edge in zip(inside, pairwise(edges), strict=True)
            ]
        phones = [Phone("AA", word.start_s, word.end_s) for word in words]
        filled = contiguous(phones, self.duration_s)
        return Alignment(PhoneTrack("en", "arpabet", filled, tuple(words)), self.findings, 0.9)

    def said(self) -> list[str]:
        """What each anchor covers in the text."""
        return [self.text[anchor.start : anchor.end] for anchor in self.anchors]


@pytest.fixture(scope="module")
def speech() -> Speech:
    return read_speech(BOAT)


@pytest.fixture(scope="module")
def true_words() -> tuple[Word, ...]:
    return animeme.align(BOAT, TEXT).track.words


def given(path: Path, speech: Speech, text: str | None = TEXT) -> tuple[Alignment, Placer]:
    placer = Placer(speech.duration_s)
    source = None if text is None else lambda: text
    return read_alignment(path, speech, language="en", text=source, align=placer), placer


def codes(alignment: Alignment) -> list[str]:
    return [finding.code for finding in alignment.findings]


@pytest.mark.parametrize("name", WRITERS)
def test_words_become_anchors_at_their_places_in_the_transcript(
    name: str, speech: Speech, true_words: tuple[Word, ...], tmp_path: Path
) -> None:
    path = tmp_path / name
    path.write_text(WRITERS[name](true_words), encoding="utf-8")
    alignment, placer = given(path, speech)
    assert placer.text == TEXT
    groups = [[w] for w in true_words]
    slack_s, said = WORD_SLACK_S, [*TEXT.removesuffix(".").split()]
    if name.endswith((".vtt", ".srt")):
        groups, slack_s = [list(cue) for cue in cues(true_words)], SUBTITLE_SLACK_S
        said = ["Mama bought a big blue", "boat for Bob"]
    assert placer.said() == said
    for anchor, group in zip(placer.anchors, groups, strict=True):
        assert anchor.start_s == pytest.approx(group[0].start_s, abs=0.001)
        assert anchor.slack_s == slack_s
        if "polly" not in WRITERS[name].__name__:  # whose words last until the next
            assert anchor.end_s == pytest.approx(group[-1].end_s, abs=0.001)
    assert tuple(word.text for word in alignment.track.words) == WORDS
    assert alignment.track.words[-1].source == (32, 35)
    assert codes(alignment) == ["timings-used"]
    assert alignment.score == 0.9


def test_without_a_transcript_the_timings_say_what_is_spoken(
    speech: Speech, true_words: tuple[Word, ...], tmp_path: Path
) -> None:
    path = tmp_path / "boat.ctm"
    path.write_text(ctm(true_words), encoding="utf-8")
    alignment, placer = given(path, speech, None)
    assert placer.text == " ".join(WORDS)
    assert placer.said() == list(WORDS)
    assert codes(alignment) == ["timings-used"]


def spans(*labels: str) -> tuple[Span, ...]:
    return tuple(Span(label, float(i), i + 0.5) for i, label in enumerate(labels))


@pytest.mark.parametrize(
    ("tag", "text", "labels", "anchored"),
    [
        ("en", "Hello, World!", ["hello", "world"], ["Hello", "World"]),
        ("en", "It costs £5.", ["It", "costs", "£5."], ["It", "costs", "£5"]),
        # Written as one, timed as two, and the other way round.
        ("en", "25 boats", ["twenty", "five", "boats"], ["25", "boats"]),
        ("en", "twenty five boats", ["25", "boats"], ["twenty five", "boats"]),
        ("en", "5 km away", ["5", "km", "away"], ["5 km", "away"]),
        ("en", "a well-known boat", ["a", "well", "known", "boat"], ["a", "well", "known", "boat"]),
        ("en", "[sighs] Oh no", ["Oh", "no"], ["Oh", "no"]),
        ("en", "Oh no", ["[sighs]", "Oh", "no", "♪"], ["Oh", "no"]),
        ("fr", "l'homme d’ici", ["l'", "homme", "d'", "ici"], ["l'homme", "d’ici"]),
        ("de", "Grüße aus Köln", ["gru\u0308ße", "aus", "KÖLN"], ["Grüße", "aus", "Köln"]),
        ("ru", "Да, нет", ["да", "нет"], ["Да", "нет"]),
    ],
)
def test_texts_are_compared_as_they_are_spoken(
    tag: str, text: str, labels: list[str], anchored: list[str]
) -> None:
    labelled = spans(*labels)
    found = match(text, labelled, language(tag))
    assert found.difference == ""
    anchors = anchors_of(found, labelled, "ctm")
    assert [text[a.start : a.end] for a in anchors] == anchored
    for before, after in pairwise(anchors):
        assert before.end <= after.start
        assert before.end_s <= after.start_s


@pytest.mark.parametrize("tag", ["zh", "ja"])
def test_words_of_scripts_without_spaces_are_found(tag: str) -> None:
    pytest.importorskip({"zh": "pypinyin", "ja": "janome"}[tag])
    text, labels = {
        "zh": ("你好,世界。", ["你", "好", "世界"]),
        "ja": ("今日は、いい天気です。", ["今日", "は", "いい", "天気", "です"]),
    }[tag]
    labelled = spans(*labels)
    found = match(text, labelled, language(tag))
    assert found.difference == ""
    anchors = anchors_of(found, labelled, "whisper")
    assert "".join(text[a.start : a.end] for a in anchors) == re.sub("[,、。]", "", text)


@pytest.mark.parametrize(
    ("old", "new", "message", "anchored"),
    [
        ("boat", "coat", "the transcript has 'boat', the timings 'coat'", 7),
        ("boat", "", "the transcript has 'boat', which the timings lack", 7),
        ("boat", "boat today", "the timings have 'today', which the transcript lacks", 8),
        ("bob", "", "at the end the transcript has 'bob', which the timings lack", 7),
    ],
)
def test_a_differing_text_is_told_with_its_time(
    old: str,
    new: str,
    message: str,
    anchored: int,
    speech: Speech,
    true_words: tuple[Word, ...],
    tmp_path: Path,
) -> None:
    changed = []
    for word in true_words:
        said = new.split() if word.text == old else [word.text]
        edges = np.linspace(word.start_s, word.end_s, len(said) + 1).tolist()
        changed += [Word(s, a, b) for s, (a, b) in zip(said, pairwise(edges), strict=True)]
    path = tmp_path / "boat.ctm"
    path.write_text(ctm(changed), encoding="utf-8")
    alignment, placer = given(path, speech)
    finding = next(f for f in alignment.findings if f.code == "timings-text-differs")
    assert finding.severity == Severity.WARNING
    assert message in finding.message
    if "end" not in message:
        at = next(w.start_s for w in true_words if w.text == old)
        assert f" {at:.1f}" in finding.message or " at " in finding.message
    assert len(placer.anchors) == anchored


def test_another_lines_timings_are_refused(
    speech: Speech, true_words: tuple[Word, ...], tmp_path: Path
) -> None:
    path = tmp_path / "boat.ctm"
    path.write_text(ctm(true_words), encoding="utf-8")
    with pytest.raises(InputError, match="'think of three things") as caught:
        given(path, speech, "Think of three things that are better left alone.")
    assert caught.value.code == "timings-text-differs"
    assert str(path) in str(caught.value)


def test_a_long_text_of_one_word_does_not_take_for_ever() -> None:
    labelled = tuple(Span("a", i / 10, i / 10 + 0.1) for i in range(30_000))
    found = match("b " + "a " * 30_000 + "c", labelled, language("en"))
    assert found.difference


def test_speech_behind_the_last_word_is_noticed(
    speech: Speech, true_words: tuple[Word, ...], tmp_path: Path
) -> None:
    path = tmp_path / "boat.ctm"
    path.write_text(ctm(true_words[:3]), encoding="utf-8")
    alignment, _ = given(path, speech, None)
    assert "align-untranscribed" in codes(alignment)


def test_mouth_shapes_alone_leave_the_line_to_its_transcript(speech: Speech) -> None:
    alignment, placer = given(FOLDER / "rhubarb.tsv", speech)
    assert (placer.text, placer.anchors) == (TEXT, ())
    assert codes(alignment) == ["timings-without-words"]
    with pytest.raises(InputError) as caught:
        given(FOLDER / "rhubarb.tsv", speech, None)
    assert caught.value.code == "timings-without-words"


def test_without_an_aligner_only_phones_will_do(speech: Speech) -> None:
    with pytest.raises(InputError) as caught:
        read_alignment(FOLDER / "words.ctm", speech, language="en")
    assert caught.value.code == "timings-without-phones"


def test_given_phones_keep_their_words_places_in_the_transcript(
    speech: Speech, tmp_path: Path
) -> None:
    track = animeme.align(BOAT, TEXT).track
    path = tmp_path / "boat.json"
    path.write_text(json.dumps(track.to_document()), encoding="utf-8")
    alignment, placer = given(path, speech)
    assert placer.text == ""  # nobody was asked
    assert [w.source for w in alignment.track.words] == [w.source for w in track.words]
    assert codes(alignment) == ["timings-used"]
    differing, _ = given(path, speech, TEXT.replace("blue", "red"))
    assert codes(differing) == ["timings-used", "timings-text-differs"]
    assert [p.symbol for p in differing.track.phones] == [p.symbol for p in track.phones]


@pytest.mark.parametrize("name", ["mary", "bobby"])
def test_hand_labelled_words_of_real_speech(name: str, shared: Path) -> None:
    folder = shared / "data" / "phone-labels"
    recording = read_speech(folder / f"{name}.wav")
    path = folder / ("mary.TextGrid" if name == "mary" else "bobby_words.TextGrid")
    alignment, placer = given(path, recording, None)
    assert len(alignment.track.words) == 4
    if name == "bobby":
        assert placer.said() == ["BOBBY", "RIPPED", "THE", "LEDGER"]


@pytest.mark.parametrize("name", NAMES)
def test_a_spoilt_file_is_refused_or_used_and_nothing_else(name: str, tmp_path: Path) -> None:
    """Seeded: bytes changed, lost, doubled and cut off; also for the question what it is."""
    random = np.random.default_rng(NAMES.index(name))
    whole = (FOLDER / name).read_bytes()
    noise = random.integers(-3000, 3000, 16_000 * 3, np.int16)
    recording = Speech(tmp_path / "a.wav", noise, 16_000, 3.0)
    for _ in range(40):
        data = bytearray(whole)
        for _ in range(int(random.integers(1, 4))):
            at, length = int(random.integers(len(data))), int(random.integers(1, 40))
            data[at : at + length] = random.choice(
                [b"", bytes(data[at : at + length]) * 2, random.bytes(2), b"9", b" -1 "]
            )
        (tmp_path / name).write_bytes(data)
        assert kind_of(tmp_path / name) in ("timings", "mouth shapes", "other")
        with suppress(InputError):
            alignment, _ = given(tmp_path / name, recording, "hello world")
            assert alignment.track.duration_s == 3.0
