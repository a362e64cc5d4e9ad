"""``animeme align``: words and phones of one recording, for people and programs."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path

import pytest
import soundfile

from support.jobs import SAMPLE, Capture, animeme
from support.schemas import validate

WELCOME = SAMPLE / "dialogue" / "en" / "welcome"


def _as_file() -> str:
    return f"{WELCOME}.txt"


def _as_words() -> str:
    return Path(f"{WELCOME}.txt").read_text(encoding="utf-8")


@pytest.mark.parametrize("text", [_as_file, _as_words])
def test_align_takes_a_file_or_the_words(text: Callable[[], str], capsys: Capture) -> None:
    ran = animeme(capsys, "align", f"{WELCOME}.wav", text(), "--json")
    assert ran.code == 0
    assert ran.err == ""
    document = json.loads(ran.out)
    validate("alignment", document)
    assert [word["text"] for word in document["words"]][:2] == ["welcome", "back"]
    assert document["language"] == "en"
    assert document["phones"][0]["start_s"] == 0.0
    assert document["phones"][-1]["end_s"] == document["duration_s"]
    assert document["duration_s"] == pytest.approx(soundfile.info(f"{WELCOME}.wav").duration)


@pytest.mark.usefixtures("wide")
def test_align_shows_people_a_table(capsys: Capture) -> None:
    ran = animeme(capsys, "align", f"{WELCOME}.wav", f"{WELCOME}.txt")
    assert ran.code == 0
    for cell in ("start", "end", "word", "phones", "welcome", "back"):
        assert cell in ran.out


def test_align_speaks_german(capsys: Capture) -> None:
    line = SAMPLE / "dialogue" / "de" / "moon"
    ran = animeme(capsys, "align", f"{line}.wav", f"{line}.txt", "--language", "de-AT", "--json")
    assert ran.code == 0
    document = json.loads(ran.out)
    validate("alignment", document)
    assert (document["language"], document["inventory"]) == ("de-AT", "ipa")


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        pytest.param(("no.wav", "hello"), ("no.wav", "no such recording"), id="no-audio"),
        pytest.param((f"{WELCOME}.wav", "no.txt"), ("no.txt", "transcript-missing"), id="no-text"),
        pytest.param((f"{WELCOME}.wav", ""), ("no word", "transcript-empty"), id="empty"),
        pytest.param((f"{WELCOME}.txt", "hello"), ("cannot be decoded", "WAV"), id="text"),
        pytest.param(
            (f"{WELCOME}.wav", "hello", "--language", "tlh"), ("'tlh'", "ar, cs, de"), id="language"
        ),
        pytest.param(
            (f"{WELCOME}.wav", "hello", "--aligner", "sphinx"),
            ("'sphinx'", "pocketsphinx"),
            id="aligner",
        ),
    ],
)
def test_align_says_what_it_cannot_use(
    arguments: tuple[str, ...], words: tuple[str, ...], capsys: Capture
) -> None:
    ran = animeme(capsys, "align", *arguments, "--json")
    ran.says(*words)
    assert (ran.code, ran.out) == (2, "")
