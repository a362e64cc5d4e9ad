"""Lexicon files, what comes before what, and ``animeme lexicon``."""

from __future__ import annotations

import json
import sys
from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from animeme.cli import main
from animeme.errors import InputError
from animeme_stages.align import pronounce as pronounce_module
from animeme_stages.align.language import language
from animeme_stages.align.lexicon import Entry, Lexicon, read_lexicon
from animeme_stages.align.pronounce import SpokenWord, pronounce
from animeme_stages.align.text import tokens

SAMPLE = Path(__file__).parents[1] / "sample_assets"


def lexicon(folder: Path, text: str, tag: str = "en") -> Lexicon:
    file = folder / "names.lex"
    file.write_text(text, encoding="utf-8")
    return read_lexicon(file, language(tag))


def spoken(text: str, tag: str, own: Lexicon | None = None) -> list[SpokenWord]:
    found = language(tag)
    return pronounce(tokens(text, found), found, "line.txt", own)


def symbols(word: SpokenWord) -> list[str]:
    return [" ".join(symbol for symbol, _ in variant) for variant in word.variants]


def test_both_kinds_of_lines_variants_and_comments(tmp_path: Path) -> None:
    own = lexicon(
        tmp_path,
        ";;; names\n\nANIMEME  AE1 N IH0 M IY2 M ;;; ours\nANIMEME(2)  AA N IH M IY M # also\n"
        "Zoë\tˈz oʊ iː\nD'Arcy\td ɑ ɹ s i\n",
    )
    assert own.entries == {
        "animeme": (
            Entry(("AE", "N", "IH", "M", "IY", "M"), arpabet=True),
            Entry(("AA", "N", "IH", "M", "IY", "M"), arpabet=True),
        ),
        "zoë": (Entry(("ˈz", "oʊ", "iː"), arpabet=False),),
        "d'arcy": (Entry(("d", "ɑ", "ɹ", "s", "i"), arpabet=False),),
    }


def test_words_are_taken_from_timings_where_there_is_no_transcript(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "en").mkdir()
    (tmp_path / "en" / "a.wav").touch()
    (tmp_path / "en" / "a.srt").write_text("1\n00:00:00,000 --> 00:00:01,000\nHello Xyzzyq\n")
    with pytest.raises(SystemExit):
        main(["lexicon", str(tmp_path), "--json"])
    found = json.loads(capsys.readouterr().out)
    assert [word["word"] for word in found["unknown"]] == ["xyzzyq"]


def test_sections_keep_languages_apart(tmp_path: Path) -> None:
    text = "all\ta\n;;; [de-AT]\nbob\tb ɔ p\n;;; [en]\nbob\tb ɑ b\n"
    assert lexicon(tmp_path, text, "de").entries["bob"][0].phones == ("b", "ɔ", "p")
    assert lexicon(tmp_path, text, "en").entries["bob"][0].phones == ("b", "ɑ", "b")
    assert set(lexicon(tmp_path, text, "fr").entries) == {"all"}


@pytest.mark.parametrize(
    ("line", "problem"),
    [
        ("word", "without a pronunciation"),
        ("word\t", "without a pronunciation"),
        ("word  W ER Q", "'Q', which is not an ARPAbet phone"),
        ("word  w ɜ d", "'w', which is not an ARPAbet phone"),
        ("word\tw 5 d", "'5'"),
        ("word\tw ː d", "a mark without a sound"),
    ],
)
def test_a_broken_line_is_named(tmp_path: Path, line: str, problem: str) -> None:
    with pytest.raises(InputError) as caught:
        lexicon(tmp_path, f";;; one\nfine  F AY N\n{line}\n")
    assert caught.value.code == "lexicon-invalid"
    assert caught.value.place == f"{tmp_path / 'names.lex'}:3"
    assert problem in caught.value.problem


def test_a_lexicon_that_is_no_text_is_refused(tmp_path: Path) -> None:
    (tmp_path / "names.lex").write_bytes(b"\xff\xfe\x00")
    for path in (tmp_path / "names.lex", tmp_path / "absent.lex", tmp_path):
        with pytest.raises(InputError) as caught:
            read_lexicon(path, language("en"))
        assert caught.value.code == "lexicon-unreadable"


@given(st.text(max_size=60))
@settings(deadline=None, derandomize=True, max_examples=200)
def test_any_text_is_a_lexicon_or_an_input_error(
    tmp_path_factory: pytest.TempPathFactory, text: str
) -> None:
    try:
        lexicon(tmp_path_factory.getbasetemp(), text)
    except InputError as error:
        assert error.code == "lexicon-invalid"  # noqa: PT017
    except UnicodeEncodeError:
        pass  # half a surrogate cannot be written to the file


def test_entries_that_no_text_matches_are_told(tmp_path: Path) -> None:
    own = lexicon(tmp_path, "New York\tn u j ɔ ɹ k\nE-MAIL  IY M EY L\n")
    assert own.entries == {}
    assert [place.rsplit(":", 1)[1] for place in own.unused] == ["1", "2"]


def test_the_lexicon_comes_before_the_dictionary(tmp_path: Path) -> None:
    own = lexicon(tmp_path, "hello\th ɛ l u\nHELLO(2)  HH AA L AA\n")
    plain, theirs = spoken("hello hello", "en")[0], spoken("hello", "en", own)[0]
    assert symbols(plain)[:2] == ["HH AH L OW", "HH AH L OW"]
    assert symbols(theirs) == ["HH EH L UW", "HH AA L AA"]
    edited = lexicon(tmp_path, "hello  HH\n")
    assert symbols(spoken("hello", "en", edited)[0]) == ["HH"]


def test_arpabet_entries_serve_a_language_of_ipa(tmp_path: Path) -> None:
    own = lexicon(tmp_path, "Bob  B AA B\n", "de")
    expected = (("b", ("B",)), ("ɑ", ("AA",)), ("b", ("B",)))
    assert spoken("Bob", "de", own)[0].variants == (expected,)


def test_with_a_lexicon_no_extra_is_needed(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    without_espeak(monkeypatch)
    own = lexicon(tmp_path, "ja\tj aː\n", "de")
    assert symbols(spoken("Ja", "de", own)[0]) == ["j aː"]
    with pytest.raises(InputError, match="espeak") as caught:
        spoken("Ja nein", "de", own)
    assert caught.value.code == "extra-missing"


def without_espeak(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "espeakng_loader", None)
    pronounce_module.espeak.cache_clear()
    pronounce_module._guess.cache_clear()


def test_english_in_other_letters_names_the_extra(monkeypatch: pytest.MonkeyPatch) -> None:
    without_espeak(monkeypatch)
    with pytest.raises(InputError, match="привет") as caught:
        spoken("Привет", "en")
    assert caught.value.code == "word-unknown"
    assert "animeme[espeak]" in caught.value.action


def dialogue(folder: Path) -> Path:
    for key, text in {
        "en/a": "Hello Zorblax! Hello, glimmerfen.",
        "en/ada/b": "Zorblax, <wave/> zorblax.",
        "de/a": "Guten Morgen.",
    }.items():
        file = folder / "dialogue" / f"{key}.txt"
        file.parent.mkdir(parents=True, exist_ok=True)
        file.write_text(text, encoding="utf-8")
    return folder / "dialogue"


def run(*arguments: object) -> int:
    with pytest.raises(SystemExit) as caught:
        main([str(argument) for argument in arguments])
    return int(caught.value.code or 0)


def test_the_command_lists_what_is_unknown(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    pytest.importorskip("espeakng_loader")
    root, output = dialogue(tmp_path), tmp_path / "out" / "review.lex"
    assert run("lexicon", root, "--json", "--output", output) == 0
    document = json.loads(capsys.readouterr().out)
    assert (document["lines"], document["words"], document["vocabulary"]) == (3, 8, 5)
    rows = [(w["language"], w["word"], w["count"], w["lines"]) for w in document["unknown"]]
    assert rows == [
        ("de", "guten", 1, ["de/a"]),
        ("de", "morgen", 1, ["de/a"]),
        ("en", "zorblax", 3, ["en/a", "en/ada/b"]),
        ("en", "glimmerfen", 1, ["en/a"]),
    ]
    assert all(word["pronunciations"] for word in document["unknown"])
    sources = {(word["language"], word["source"]) for word in document["unknown"]}
    assert sources == {("de", "espeak"), ("en", "analogy")}
    text = output.read_text(encoding="utf-8")
    assert ";;; [de]" in text
    assert ";;; 3× en/a, en/ada/b\nzorblax  Z " in text
    # What was reviewed is known the next time, and is never written over.
    assert run("lexicon", root, "--json", "--lexicon", output) == 0
    assert json.loads(capsys.readouterr().out)["unknown"] == []
    assert run("lexicon", root, "--output", output) == 2


def test_the_command_takes_job_files_and_shows_a_table(capsys: pytest.CaptureFixture[str]) -> None:
    pytest.importorskip("espeakng_loader")
    assert run("lexicon", SAMPLE / "job.toml", SAMPLE / "dialogue") == 0
    assert capsys.readouterr().out.startswith("36 lines, ")


def test_what_cannot_be_read_is_told_and_the_rest_is_done(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    root = dialogue(tmp_path)
    (root / "en" / "silent.wav").touch()
    (root / "tlh").mkdir()
    (root / "tlh" / "a.txt").write_text("nuqneH", encoding="utf-8")
    assert run("lexicon", root / ".." / "dialogue", "--json") == 1
    document = json.loads(capsys.readouterr().out)
    assert [finding["code"] for finding in document["findings"]] == [
        "transcript-missing",
        "language-unknown",
    ]
    assert document["lines"] == 3


@pytest.mark.parametrize("path", ["absent", "empty", "file.wav", "absent.toml"])
def test_a_path_that_holds_no_dialogue_is_refused(tmp_path: Path, path: str) -> None:
    (tmp_path / "empty").mkdir()
    (tmp_path / "file.wav").touch()
    assert run("lexicon", tmp_path / path) == 2


def test_ten_thousand_lines_guess_each_word_once(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    pytest.importorskip("espeakng_loader")
    folder = tmp_path / "dialogue" / "de"
    folder.mkdir(parents=True)
    for index in range(10_000):
        (folder / f"{index:05}.txt").write_text("Guten Morgen, liebe Leute.", encoding="utf-8")
    asked: list[str] = []
    real = pronounce_module.espeak()
    pronounce_module._guess.cache_clear()

    class Counting:
        def pronounce(self, word: str, voice: str) -> tuple[str, ...]:
            asked.append(word)
            return real.pronounce(word, voice)

    monkeypatch.setattr(pronounce_module, "espeak", Counting)
    assert run("lexicon", tmp_path / "dialogue", "--json") == 0
    assert sorted(asked) == ["guten", "leute", "liebe", "morgen"]
    assert json.loads(capsys.readouterr().out)["words"] == 40_000
