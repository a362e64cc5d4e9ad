"""Every language: its data file is complete, and each of its sounds has a phone and a mouth."""

from __future__ import annotations

import sys
from pathlib import Path

import pytest

from animeme.errors import InputError
from animeme.phones import ARPABET_TO_IPA, plain_ipa
from animeme_stages.align import readers
from animeme_stages.align.language import Language, acoustic_phones, language, languages
from animeme_stages.align.numerals import number_words
from animeme_stages.align.pronounce import guess, pronounce
from animeme_stages.align.readers import kana_phones
from animeme_stages.align.text import Token, tokens
from animeme_stages.synthesize.cohen_massaro import CohenMassaro
from animeme_stages.synthesize.segments import split_symbol

WORDS = Path(__file__).parent / "fixtures" / "words"
EUROPEAN = ("cs", "de", "el", "en", "es", "fr", "it", "nl", "pl", "pt", "ru", "sv", "tr", "uk")
PROMISED = (*EUROPEAN, "ar", "hi", "ja", "ko", "zh")
PACKAGES = {"chinese": "pypinyin", "japanese": "janome"}
READERS = ("ja", "zh")


def readable(tag: str) -> Language:
    """The language; skips where its reader is not installed."""
    found = language(tag)
    if found.reader:
        pytest.importorskip(PACKAGES[found.reader])
    return found


def words_of(tag: str) -> list[Token]:
    return tokens((WORDS / f"{tag}.txt").read_text(encoding="utf-8"), readable(tag))


def known_mouths() -> dict[str, int]:
    document = CohenMassaro.default().to_document()
    return {phone: 1 for shape in document["classes"].values() for phone in shape["phones"]}


def test_every_promised_language_is_there_and_has_a_word_list() -> None:
    assert set(languages()) == set(PROMISED)
    assert {file.stem for file in WORDS.glob("*.txt")} == set(PROMISED)


@pytest.mark.parametrize("tag", PROMISED)
def test_every_sound_of_the_word_list_has_an_acoustic_phone_and_a_mouth(tag: str) -> None:
    pytest.importorskip("espeakng_loader")
    found = words_of(tag)
    assert len(found) >= 60
    mouths = known_mouths()
    for token in found:
        variants = guess(token, language(tag))
        assert variants, token
        for pronunciation in variants:
            for symbol, acoustic in pronunciation:
                assert acoustic, (token, symbol)
                assert set(acoustic) <= set(ARPABET_TO_IPA), (token, symbol)
                ipa = ARPABET_TO_IPA.get(symbol, plain_ipa(symbol))
                assert "".join(split_symbol(ipa, mouths)) == ipa, (token, symbol)


@pytest.mark.parametrize("tag", READERS)
def test_every_sound_of_a_reader_has_an_acoustic_phone_and_a_mouth(tag: str) -> None:
    mouths = known_mouths()
    for unit, phones in language(tag).sounds.items():
        for symbol in phones.split():
            assert acoustic_phones(symbol), (unit, symbol)
            ipa = plain_ipa(symbol)
            assert "".join(split_symbol(ipa, mouths)) == ipa, (unit, symbol)


@pytest.mark.parametrize("tag", PROMISED)
def test_a_language_names_numbers_times_dates_units_and_money(tag: str) -> None:
    settings = readable(tag)
    assert settings.numerals or settings.numbers
    assert settings.units["km"]
    assert settings.units["kg"]
    assert settings.currencies["$"]
    assert settings.currencies["€"]
    assert len(settings.date["months"]) == 12
    for text in ("7", "42", "365", "1984", "999999", "10:30", "1:00", "2026-11-22", "5 km", "$5"):
        spoken = tokens(text, settings)
        assert spoken, text
        assert {(token.start, token.end) for token in spoken} == {(0, len(text))}
        assert not any(c.isdigit() for token in spoken for c in token.text)


@pytest.mark.parametrize("tag", PROMISED)
def test_numbers_differ_from_each_other(tag: str) -> None:
    names = [" ".join(number_words(str(n), language(tag))) for n in range(2000)]
    assert len(set(names)) == len(names)


@pytest.mark.parametrize("tag", PROMISED)
def test_every_abbreviation_is_read_as_it_stands(tag: str) -> None:
    settings = readable(tag)
    for short, said in settings.abbreviations.items():
        expected = [t.text for t in tokens(said, settings)]
        assert [t.text for t in tokens(short, settings)] == expected, short
        tight = short.replace(" ", "")
        assert [t.text for t in tokens(tight, settings)] == expected, tight


CHINESE = [
    ("我去银行。", "我 去 银行"),
    ("12", "十 二"),
    ("10:30", "十 点 三 十分"),
    ("50%", "百分 之 五 十"),
    ("1005", "一 千 零 五"),
    ("我用iPhone。", "我 用 iphone"),
]
JAPANESE = [
    ("今日は東京へ行きます。", "今日 は 東京 へ 行き ます"),
    ("コーヒー、ください", "コーヒー ください"),
    ("12", "十 二"),
    ("10:30", "十 ジ 三 十 フン"),
    ("5 km", "五 キロメートル"),
    ("¥100", "百 円"),
]


@pytest.mark.parametrize(
    ("tag", "text", "spoken"),
    [("zh", *case) for case in CHINESE] + [("ja", *case) for case in JAPANESE],
)
def test_a_reader_parts_a_text_into_words(tag: str, text: str, spoken: str) -> None:
    found = tokens(text, readable(tag))
    assert " ".join(token.text for token in found) == spoken
    for token in found:
        if not any(c.isdigit() for c in text):
            assert text[token.start : token.end].lower() == token.text


@pytest.mark.parametrize("tag", READERS)
@pytest.mark.parametrize(
    "text", ["", "a\0b", "龘𠮷𪚥", "ッーン", "ー", "😀", "ｶﾞｷﾞ", "é文é", "e\u0301", "[x] <y>"]
)
def test_no_text_breaks_a_reader(tag: str, text: str) -> None:
    for token in tokens(text, readable(tag)):
        assert token.text
        assert 0 <= token.start < token.end <= len(text)


@pytest.mark.parametrize(
    ("text", "phones"),
    [
        ("银行", "i n x ɑ ŋ"),  # and not xíng
        ("长大", "ʈʂ ɑ ŋ t a"),  # and not cháng
        ("四十", "s ɨ ʂ ɨ"),
        ("女", "n y"),
        ("五月", "u ɥ ɛ"),
        ("嗯", "n"),
    ],
)
def test_chinese_words_are_read_in_context(text: str, phones: str) -> None:
    found = tokens(text, readable("zh"))
    assert " ".join(phone for token in found for phone in token.phones) == phones


@pytest.mark.parametrize(
    ("kana", "phones"),
    [
        ("きって", "k i tː e"),
        ("サンポ", "s a m p o"),
        ("リンゴ", "ɾ i ŋ ɡ o"),
        ("ホン", "h o ɴ"),
        ("トーキョー", "t oː kʲ oː"),
        ("ニッポン", "ɲ i pː o ɴ"),
        ("ｶﾞ", "ɡ a"),
        ("ッ", "ʔ"),
        ("ー", ""),
        ("漢", ""),
    ],
)
def test_kana_have_the_sounds_of_their_neighbours(kana: str, phones: str) -> None:
    assert " ".join(kana_phones(kana, language("ja"))) == phones


def test_japanese_particles_are_read_as_spoken() -> None:
    found = tokens("私は家へ", readable("ja"))
    assert [token.phones for token in found][1::2] == [("w", "a"), ("e",)]


@pytest.mark.parametrize(("tag", "extra"), [("zh", "chinese"), ("ja", "japanese")])
def test_without_its_reader_the_error_names_the_extra(
    tag: str, extra: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    for module in ("pypinyin", "janome", "janome.tokenizer"):
        monkeypatch.setitem(sys.modules, module, None)
    readers.reader.cache_clear()
    readers._janome.cache_clear()
    with pytest.raises(InputError, match="extra") as caught:
        tokens("日本", language(tag))
    readers.reader.cache_clear()
    assert caught.value.code == "extra-missing"
    assert caught.value.place == f"extra '{extra}'"
    assert f"animeme[{extra}]" in caught.value.action


def test_a_character_without_reading_is_named() -> None:
    settings = readable("zh")
    token = Token("𪚥", 0, 1)
    with pytest.raises(InputError, match="𪚥") as caught:
        pronounce([token], settings, "line.txt")
    assert caught.value.code == "word-unknown"


def test_accents_are_offered_as_variants() -> None:
    pytest.importorskip("espeakng_loader")
    settings = language("es")
    (word,) = pronounce(tokens("cielo", settings), settings, "line.txt")
    spoken = [" ".join(symbol for symbol, _ in variant) for variant in word.variants]
    assert len(spoken) == 2
    assert spoken[0].startswith("θ")
    assert spoken[1].startswith("s")
