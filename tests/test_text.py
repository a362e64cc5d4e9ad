"""Transcripts to words: real cases, and any text at all."""

from __future__ import annotations

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from animeme_stages.align.language import language
from animeme_stages.align.text import tokens

LANGUAGES = ("de", "en", "es")


def words(text: str, tag: str) -> str:
    return " ".join(token.text for token in tokens(text, language(tag)))


REAL: dict[str, list[tuple[str, str]]] = {
    "en": [
        ("", ""),
        (" \t\n", ""),
        ("Hello, World!", "hello world"),
        ("HELLO", "hello"),
        ("don't", "don't"),
        ("Don’t", "don't"),
        ("it´s", "it's"),
        ("“Quoted,” she said — twice…", "quoted she said twice"),
        ("‘single’ quotes", "single quotes"),
        ("dogs' 'n' cats", "dogs n cats"),
        ("rock-n-roll", "rock n roll"),
        ("snake_case", "snake case"),
        ("either/or", "either or"),
        ("www.example.com", "www example com"),
        ("12", "twelve"),
        ("0", "zero"),
        ("A1 b2", "a one b two"),
        ("COVID-19", "covid nineteen"),
        ("1,000", "one thousand"),
        ("1,234,567", "one million two hundred and thirty four thousand"
         " five hundred and sixty seven"),
        ("3.5", "three point five"),
        ("0.25", "zero point two five"),
        ("3.14159", "three point one four one five nine"),
        ("1,000.5", "one thousand point five"),
        ("12345678901234567890", "one two three four five six seven eight nine zero"
         " one two three four five six seven eight nine zero"),
        ("50%", "fifty percent"),
        ("R&D", "r and d"),
        ("a+b=c", "a plus b equals c"),
        ("me@home", "me at home"),
        ("20 °", "twenty degrees"),
        ("[laughs] Oh, <break time='1s'/>no [sighs]", "oh no"),
        ("<b>bold</b>", "bold"),
        ("a < b", "a b"),
        ("[unclosed word", "unclosed word"),
        ("café naïve Zoë", "café naïve zoë"),
        ("cafe\u0301 Zoe\u0308", "café zoë"),
        ("hi 😀 there 👩‍👩‍👧", "hi there"),
        ("a\0b\x1bc", "a b c"),
        ("zero\u200bwidth", "zero width"),
        ("\ufefffirst", "first"),
        ("１２", "twelve"),
        ("10:30", "ten thirty"),
        # A leading zero is part of what is said.
        ("007", "zero zero seven"),
        ("1.0", "one point zero"),
        ("99999999999999999999.5", "nine " * 20 + "point five"),
        # A soft hyphen only marks where a line may break.
        ("de\u00advice", "device"),
        # No composed form exists, and it still is one word.
        ("x\u030cyz", "x\u030cyz"),
    ],
    "de": [
        ("Straße", "straße"),
        ("Größe über Öl", "größe über öl"),
        ("U\u0308ber", "über"),
        ("12", "zwölf"),
        ("21", "einundzwanzig"),
        ("1.000", "eintausend"),
        ("3,5", "drei komma fünf"),
        ("0,25", "null komma zwei fünf"),
        ("50 %", "fünfzig prozent"),
        ("10 €", "zehn euro"),
        ("„Zitat“ »auch« ‚so‘", "zitat auch so"),
        ("E-Mail-Adresse", "e mail adresse"),
        ("Geht’s gut?", "geht's gut"),
        ("1.000,5", "eintausend komma fünf"),
        ("1.234.567,25", "eine million zweihundertvierunddreißigtausendfünfhundertsiebenundsechzig"
         " komma zwei fünf"),
        ("007", "null null sieben"),
    ],
    "es": [
        ("¿Qué tal, señor?", "qué tal señor"),
        ("¡Ñandú!", "ñandú"),
        ("12", "doce"),
        ("21", "veintiuno"),
        ("31 pollos", "treinta y uno pollos"),
        ("1.000", "mil"),
        ("50 %", "cincuenta por ciento"),
        ("3,5", "tres coma cinco"),
        ("1.000,5", "mil coma cinco"),
        ("007", "cero cero siete"),
    ],
}  # fmt: skip
# Signs and letters that change how a number is said.
DECORATED = [
    ("en", "$5", "five dollars"),
    ("en", "-5", "minus five"),
    ("en", "1st 2nd 3rd 21st", "first second third twenty first"),
    ("en", "½ cup", "one half cup"),
    ("de", "5 €", "fünf euro"),
    ("es", "-5", "menos cinco"),
]
CASES = [(tag, text, spoken) for tag, cases in REAL.items() for text, spoken in cases]


@pytest.mark.parametrize(("tag", "text", "spoken"), CASES)
def test_a_real_text_is_read_as_people_say_it(tag: str, text: str, spoken: str) -> None:
    assert words(text, tag) == spoken


@pytest.mark.parametrize(("tag", "text", "spoken"), DECORATED)
def test_signs_at_a_number_are_read_as_people_say_them(tag: str, text: str, spoken: str) -> None:
    assert words(text, tag) == spoken


HOSTILE = {
    "many digits and a half": "9" * 400 + ".5",
    "many thousands": "1" + ",000" * 2500 + " 1" + ".000" * 2500,
    "many decimals": "0." + "1" * 10_000,
    "10,000 characters": "word " * 2000,
    "10,000 letters": "a" * 10_000,
    "10,000 digits": "7" * 10_000,
    "10,000 apostrophes": "a'" * 5000,
    "10,000 accents": "e" + "\u0301" * 10_000,
    "10,000 open tags": "<[" * 5000,
    "10,000 numbers apart": "1.2," * 2500,
    "right to left": "שלום עולם ‏مرحبا‎ 123 ٣٫٥ ۱۲",
    "control characters": "".join(map(chr, range(32))) + "\x7f\x80\x9f",
    "half an emoji": "a\ud83db",
    "superscripts and circles": "m² ① Ⅷ ½ ㍿ ﬁ",
    "digits of other scripts": "१२३ ௧௨ 𝟙𝟚 ๑,๒ ²³",
    "upper case that grows": "İSTANBUL ŞİŞLİ ẞ ǅ",
}


@pytest.mark.parametrize("tag", LANGUAGES)
@pytest.mark.parametrize("case", HOSTILE)
def test_no_text_raises(case: str, tag: str) -> None:
    require_sound(HOSTILE[case], tag)


CHARACTERS = st.one_of(
    st.characters(exclude_categories=("Cs",)),
    st.sampled_from("019.,'’-<>[]%$ \u0301\u00ad½²٣éÉaZß"),
)


@given(st.text(CHARACTERS, max_size=30), st.sampled_from(LANGUAGES))
@settings(deadline=None, derandomize=True, max_examples=300)
def test_any_text_gives_words_that_point_at_their_source(text: str, tag: str) -> None:
    require_sound(text, tag)


@given(
    st.from_regex(r"[0-9]{1,15}([.,][0-9]{1,4}){0,3}", fullmatch=True), st.sampled_from(LANGUAGES)
)
@settings(deadline=None, derandomize=True, max_examples=150)
def test_any_number_is_read_as_words_without_digits(text: str, tag: str) -> None:
    require_sound(text, tag)
    found = tokens(text, language(tag))
    assert found
    assert {(token.start, token.end) for token in found} == {(0, len(text))}
    assert all(token.text.isalpha() for token in found)


def require_sound(text: str, tag: str) -> None:
    """Words are lower case without separators, in order, each from a part that is not blank."""
    cursor = (0, 0)
    for token in tokens(text, language(tag)):
        assert token.text
        assert token.text == token.text.lower()
        assert not set(token.text) & set(" \t\n,.-<>[]")
        assert 0 <= token.start < token.end <= len(text)
        piece = text[token.start : token.end]
        assert piece == piece.strip()
        span = (token.start, token.end)
        assert span == cursor or token.start >= cursor[1]
        cursor = span
        if piece[0].isalpha() and piece.isascii():
            assert piece.lower() == token.text


@given(
    st.lists(st.sampled_from(("one", "Zoë", "don’t", "x")), max_size=6),
    st.sampled_from((" ", "\n", ", ", " — ", "… ", " [tag] ", " <t/>", " 😀 ")),
)
@settings(deadline=None, derandomize=True, max_examples=100)
def test_separators_of_any_kind_leave_the_words_alone(spoken: list[str], between: str) -> None:
    text = between.join(spoken)
    found = tokens(text, language("en"))
    assert [token.text for token in found] == [w.lower().replace("’", "'") for w in spoken]
    assert [text[token.start : token.end] for token in found] == spoken


@pytest.mark.parametrize("text", ["cafe\u0301 noir", "e\u0301e\u0301 b", "\u212b b"])
def test_positions_are_those_of_the_transcript_itself(text: str) -> None:
    last = tokens(text, language("en"))[-1]
    assert text[last.start : last.end] == text.split()[-1]


@pytest.mark.parametrize("tag", ["en", "en-GB", "EN_us", "de-AT", "es-419"])
def test_region_and_case_of_a_tag_do_not_matter(tag: str) -> None:
    assert language(tag) == language(tag[:2].lower())
