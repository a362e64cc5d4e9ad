"""Times of words and subtitles beside a recording hold the phones that are found for it."""

from __future__ import annotations

import json
import re
import shutil
from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import animeme
from animeme.contracts import Alignment, Anchor, Speech
from animeme.errors import InputError
from animeme.findings import Finding, Severity
from animeme.phones import SILENCE, Phone, PhoneTrack, Word, contiguous
from animeme_stages.align.anchors import SUBTITLE_SLACK_S, WORD_SLACK_S, anchors_of, match
from animeme_stages.align.interchange import Span, kind_of
from animeme_stages.align.language import language
from animeme_stages.align.text import tokens
from animeme_stages.ingest.audio import read_speech
from animeme_stages.ingest.timings import read_alignment
from conftest import SAMPLE
from support.jobs import SmallJob, run_inline, small_job
from support.jobs import animeme as command
from support.timing_files import FOLDER, NAMES

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


def _ctm(words: Sequence[Word]) -> str:
    return "".join(f"boat 1 {w.start_s:.3f} {w.end_s - w.start_s:.3f} {w.text}\n" for w in words)


def _lab(words: Sequence[Word]) -> str:
    return "".join(f"{w.start_s * 1e7:.0f} {w.end_s * 1e7:.0f} {w.text}\n" for w in words)


def _whisperx(words: Sequence[Word]) -> str:
    entries = [{"word": w.text, "start": w.start_s, "end": w.end_s} for w in words]
    segment = {"start": words[0].start_s, "end": words[-1].end_s, "words": entries, "text": ""}
    return json.dumps({"segments": [segment]})


def _azure(words: Sequence[Word]) -> str:
    return json.dumps(
        [
            {
                "Text": w.text,
                "AudioOffset": round(w.start_s * 1000),
                "Duration": round((w.end_s - w.start_s) * 1000),
                "BoundaryType": "WordBoundary",
            }
            for w in words
        ]
    )


def _polly(words: Sequence[Word]) -> str:
    marks = [{"time": round(w.start_s * 1000), "type": "word", "value": w.text} for w in words]
    return "".join(json.dumps(mark) + "\n" for mark in marks)


def _clock(seconds: float, mark: str) -> str:
    return f"00:00:{int(seconds):02d}{mark}{round(seconds % 1 * 1000):03d}"


def _cues(words: Sequence[Word]) -> list[Sequence[Word]]:
    return [words[:5], words[5:]]


def _vtt(words: Sequence[Word]) -> str:
    cues = (
        f"{_clock(cue[0].start_s, '.')} --> {_clock(cue[-1].end_s, '.')}\n"
        f"<v Ada>{' '.join(w.text.title() for w in cue)}!\n"
        for cue in _cues(words)
    )
    return "WEBVTT\n\n" + "\n".join(cues)


def _srt(words: Sequence[Word]) -> str:
    return "\n".join(
        f"{number}\n{_clock(cue[0].start_s, ',')} --> {_clock(cue[-1].end_s, ',')}\n"
        f"<i>{' '.join(w.text for w in cue)}</i>\n"
        for number, cue in enumerate(_cues(words), 1)
    )


WRITERS: dict[str, Callable[[Sequence[Word]], str]] = {
    "boat.ctm": _ctm,
    "boat.lab": _lab,
    "boat.json": _whisperx,
    "boat.JSON": _azure,
    "boat.marks": _polly,
    "boat.jsonl": _polly,
    "boat.vtt": _vtt,
    "boat.srt": _srt,
}


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
        groups, slack_s = [list(cue) for cue in _cues(true_words)], SUBTITLE_SLACK_S
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
    path.write_text(_ctm(true_words), encoding="utf-8")
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
    path.write_text(_ctm(changed), encoding="utf-8")
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
    path.write_text(_ctm(true_words), encoding="utf-8")
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
    path.write_text(_ctm(true_words[:3]), encoding="utf-8")
    alignment, _ = given(path, speech, None)
    assert "align-untranscribed" in codes(alignment)


def test_mouth_shapes_alone_leave_the_line_to_its_transcript(speech: Speech) -> None:
    alignment, placer = given(FOLDER / "rhubarb.tsv", speech)
    assert (placer.text, placer.anchors) == (TEXT, ())
    assert codes(alignment) == ["timings-without-words"]
    with pytest.raises(InputError) as caught:
        given(FOLDER / "rhubarb.tsv", speech, None)
    assert caught.value.code == "timings-without-words"


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


# From outside: files beside a recording


@pytest.fixture
def job(tmp_path: Path) -> SmallJob:
    return small_job(tmp_path / "job", "en/boat")


def beside(job: SmallJob, name: str) -> Path:
    return job.dialogue / "en" / name


def test_a_run_uses_subtitles_beside_a_recording(
    job: SmallJob, capsys: Capture, true_words: tuple[Word, ...]
) -> None:
    beside(job, "boat.srt").write_text(_srt(true_words), encoding="utf-8")
    assert run_inline(capsys, job).code == 0
    assert [f["code"] for f in job.findings("en/boat")] == ["timings-used"]
    assert job.statuses() == {"en/boat": "ok"}


def test_a_label_file_beside_a_transcript_is_no_second_transcript(
    job: SmallJob, capsys: Capture, true_words: tuple[Word, ...]
) -> None:
    beside(job, "boat.lab").write_text(_lab(true_words), encoding="utf-8")
    assert run_inline(capsys, job).code == 0
    assert [f["code"] for f in job.findings("en/boat")] == ["timings-used"]


def test_what_else_lies_beside_a_recording_does_not_matter(job: SmallJob, capsys: Capture) -> None:
    beside(job, "boat.json").write_text('{"take": 3, "words": ["Mama"], "text": ""}')
    beside(job, "boat.tsv").write_text("who\tmood\nada\tglad\n")
    beside(job, "boat.csv").write_text("time_s,lip_gap\n0.0,0.1\n")
    beside(job, "boat.jsonl").write_bytes(b"\x80\x81 nobody's")
    beside(job, "scene.srt").write_text("1\n00:00:00,000 --> 00:00:01,000\nhi\n")
    assert run_inline(capsys, job).code == 0
    assert job.findings("en/boat") == []
    assert job.statuses() == {"en/boat": "ok"}


def test_two_files_of_timings_are_one_too_many(
    job: SmallJob, capsys: Capture, true_words: tuple[Word, ...]
) -> None:
    beside(job, "boat.srt").write_text(_srt(true_words), encoding="utf-8")
    beside(job, "boat.json").write_text(_whisperx(true_words), encoding="utf-8")
    ran = run_inline(capsys, job)
    ran.says("has 2 files of timings: boat.json, boat.srt", "Keep one", "line-duplicate")
    beside(job, "boat.json").unlink()
    assert run_inline(capsys, job).code == 0


def test_rhubarb_beside_other_timings_does_not_count(
    job: SmallJob, capsys: Capture, true_words: tuple[Word, ...]
) -> None:
    shutil.copy(FOLDER / "rhubarb.json", beside(job, "boat.json"))
    assert run_inline(capsys, job).code == 0
    assert [f["code"] for f in job.findings("en/boat")] == ["timings-without-words"]
    beside(job, "boat.ctm").write_text(_ctm(true_words), encoding="utf-8")
    assert run_inline(capsys, job).code == 0
    assert [f["code"] for f in job.findings("en/boat")] == ["timings-used"]


@pytest.mark.parametrize("share", [0.0, 0.4, 0.8])
def test_half_a_file_of_timings_fails_its_line(
    share: float, job: SmallJob, capsys: Capture, true_words: tuple[Word, ...]
) -> None:
    whole = _whisperx(true_words)
    beside(job, "boat.json").write_text(whole[: int(len(whole) * share)], encoding="utf-8")
    ran = run_inline(capsys, job)
    ran.says("timings-damaged", "boat.json", "take the file away")
    assert ran.code == 1
    beside(job, "boat.json").write_text(whole, encoding="utf-8")
    assert run_inline(capsys, job).code == 0


def test_one_recording_may_be_aligned_from_its_timings(
    capsys: Capture, true_words: tuple[Word, ...], tmp_path: Path
) -> None:
    path = tmp_path / "boat.vtt"
    path.write_text(_vtt(true_words), encoding="utf-8")
    track = animeme.align(BOAT, timings=path).track
    assert tuple(word.text for word in track.words) == WORDS
    assert any(phone.symbol == SILENCE for phone in track.phones)
    ran = command(capsys, "align", BOAT, path, "--json")
    assert ran.code == 0
    document: dict[str, Any] = json.loads(ran.out)
    assert [word["text"] for word in document["words"]] == list(WORDS)
    command(capsys, "align", BOAT, tmp_path / "none.vtt").says("none.vtt", "No such file")
    with pytest.raises(ValueError, match="neither"):
        animeme.align(BOAT)
