"""What folders and sheets call a language."""

from __future__ import annotations

from pathlib import Path

import langcodes
import pytest

from animeme.errors import InputError
from animeme.languages import _tables, find_tag, is_common, language_of_file, language_tag

TAGS = {
    "en": "en",
    "EN": "en",
    " En ": "en",
    "English": "en",
    "English(US)": "en-US",
    "English (United Kingdom)": "en-GB",
    "French(France)": "fr-FR",
    "Spanish (Latin America)": "es-419",
    "LATAM": "es-419",
    "es-419": "es-419",
    "jp": "ja",
    "German": "de",
    "deutsch": "de",
    "GER": "de",
    "deu": "de",
    "zh_CN": "zh-CN",
    "Chinese(PRC)": "zh-CN",
    "Chinese (Simplified)": "zh-Hans",
    "zh-hans-cn": "zh-Hans-CN",
    "CHT": "zh-Hant",
    "pt-br": "pt-BR",
    "ptbr": "pt-BR",
    "Brazilian Portuguese": "pt-BR",
    "sr_Latn_RS": "sr-Latn-RS",
    "日本語": "ja",
    "français": "fr",
    "franc\u0327ais": "fr",
    "iw": "he",
    "tlh": "tlh",
    "x-elvish": "x-elvish",
}


@pytest.mark.parametrize("name", TAGS)
def test_a_name_becomes_a_tag(name: str) -> None:
    assert language_tag(name) == TAGS[name]
    assert find_tag(TAGS[name]) == TAGS[name]


@pytest.mark.parametrize("name", ["", " ", "Klingon", "music", "sfx", "line01", "xx", "en-", "()"])
def test_what_is_no_language_is_an_error(name: str) -> None:
    if name == "en-":
        assert find_tag(name) == "en"
        return
    assert find_tag(name) is None
    with pytest.raises(InputError) as caught:
        language_tag(name, place="lines.csv:3")
    assert (caught.value.code, caught.value.place) == ("language-unknown", "lines.csv:3")


def test_an_error_names_the_language_that_was_meant() -> None:
    with pytest.raises(InputError, match=r"Did you mean 'German' \(de\)"):
        language_tag("Germn")


def test_every_tag_of_the_table_is_in_the_register() -> None:
    names, regions = _tables()
    for tag in {*names.values(), *(f"en-{region}" for region in regions.values())}:
        assert langcodes.tag_is_valid(tag), tag
        assert langcodes.standardize_tag(tag) == tag
        assert find_tag(tag) == tag


def test_words_that_are_rare_languages_are_not_common() -> None:
    assert is_common("de")
    assert is_common("English(US)")
    assert not is_common("vo")  # Volapük, and voice-over
    assert not is_common("to")


@pytest.mark.parametrize(
    ("path", "tag"),
    [
        ("de/lines.csv", "de"),
        ("lines_de.csv", "de"),
        ("game_pt_BR.po", "pt-BR"),
        ("ja/LC_MESSAGES/game.po", "ja"),
        ("EN_dialogue.csv", "en"),
        ("sheets/lines.csv", ""),
    ],
)
def test_a_file_may_tell_its_language(path: str, tag: str, tmp_path: Path) -> None:
    assert language_of_file(tmp_path / "x" / path) == tag
