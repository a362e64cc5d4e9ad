"""Any transcript is read, or refused with `InputError`; none takes more time than its length."""

from __future__ import annotations

import random
import unicodedata
from collections.abc import Callable
from pathlib import Path

import pytest

from animeme.errors import InputError
from animeme.phones import Word
from animeme_stages.align.language import language, languages
from animeme_stages.align.pronounce import pronounce
from animeme_stages.align.tags import timed_tags, unpaired_brackets
from animeme_stages.align.text import tokens
from animeme_stages.ingest.transcript import read_transcript

SEED = 11
LONG = 100_000

# One character or a few of every kind that texts are made of, and that break programs.
ALPHABETS: dict[str, str] = {
    "ascii": "".join(map(chr, range(128))),
    "letters": "abcxyz ",
    "digits": "0123456789",
    "numbers": "0123456789.,:-/ %$€°",
    "arabic digits": "٠١٢٣٤٥٦٧٨٩٫٬ ",
    "odd digits": "²½Ⅳ㊿𝟘१๓",
    "brackets": "[]<>(){}/='\" a1",
    "blanks": " \t\n\r\v\f\x85\xa0\u2028\u2029\u202f\u3000\ufeff",
    "controls": "".join(map(chr, [*range(32), *range(127, 160)])),
    "directions": "\u200e\u200f\u202a\u202b\u202c\u202d\u202e\u2066\u2067\u2068\u2069אבשלام ",
    "joiners": "\u00ad\u200b\u200c\u200d\u2060\ufe0fab",
    "combining": "a\u0300\u0301\u0327\u0338\u0483\u0591\u064b\u0900\u0e31\u20d0\u3099",
    "emoji": "😀👩\u200d👩\u200d👧🏽🇩🇪⚡\ufe0f❤ ",
    "hebrew and arabic": "שלוםمرحباًـ ",
    "indic": "नमस्तेক্ষதமிழ் ",
    "cjk": "你好吗我是日本語かなカナー々〇 한국어",
    "hangul jamo": "ᄀ까ᅢᆨᆩ",
    "greek and cyrillic": "ΑβγΣςПривет ёй ґї",
    "turkish": "Iıİi ĞğŞş",
    "apostrophes": "a'’‘ʼ`´- ",
    "planes": "\U0001d400\U00010330\U00020000\U000323af\U000e0001\U000f0000\U0010ffff\ufffd\ufffe",
}


def _any_character(chance: random.Random) -> str:
    code = chance.randrange(0x110000)
    return "\ufffd" if 0xD800 <= code < 0xE000 else chr(code)


def _text(chance: random.Random) -> str:
    """A few runs of characters of one kind each, some of them long."""
    parts: list[str] = []
    for _ in range(chance.choice((1, 2, 5, 12))):
        count = chance.choice((1, 3, 10, 40))
        if chance.random() < 0.2:
            parts.append("".join(_any_character(chance) for _ in range(count)))
        else:
            alphabet = ALPHABETS[chance.choice(list(ALPHABETS))]
            parts.append("".join(chance.choices(alphabet, k=count)))
        parts.append(chance.choice(("", " ")))
    return "".join(parts)


def _encoded(text: str, chance: random.Random) -> bytes:
    kind = chance.randrange(8)
    if kind == 0:
        return text.encode("utf-16")
    if kind == 1:
        return b"\xff\xfe" + text.encode("utf-16-le")[:-1]
    if kind == 2:
        data = bytearray(text.encode())
        for _ in range(chance.choice((1, 5))):
            data.insert(chance.randrange(len(data) + 1), chance.randrange(256))
        return bytes(data)
    return (b"\xef\xbb\xbf" if kind == 3 else b"") + text.encode()


def use(text: str, tag: str) -> int:
    """All that is done with a transcript before audio is touched; the number of its words."""
    settings = language(tag)
    found = tokens(text, settings)
    words = []
    for index, token in enumerate(found):
        assert 0 <= token.start < token.end <= len(text)
        assert token.text == token.text.strip()
        assert token.text
        words.append(Word(token.text, index * 1.0, index + 1.0, (token.start, token.end)))
    events = timed_tags(text, words)
    assert [e.time_s for e in events] == sorted(e.time_s for e in events)
    list(unpaired_brackets(text))
    spoken = pronounce(found, settings, "fuzz")
    assert len(spoken) <= len(found)
    return len(found)


def attempt(path: Path, data: bytes, tag: str) -> str:
    """What became of a transcript: "read", or the code of its refusal."""
    path.write_bytes(data)
    try:
        use(read_transcript(path), tag)
    except InputError as error:
        refusal = error
    else:
        return "read"
    assert refusal.problem
    assert refusal.action
    return refusal.code


def run(path: Path, seed: str, count: int, tag: str) -> set[str]:
    chance = random.Random(seed)
    return {attempt(path, _encoded(_text(chance), chance), tag) for _ in range(count)}


@pytest.mark.parametrize("tag", languages())
def test_random_transcripts(tag: str, tmp_path: Path) -> None:
    outcomes = run(tmp_path / "a.txt", f"{SEED}-{tag}", 25, tag)
    assert len(outcomes) > 1


@pytest.mark.slow
@pytest.mark.parametrize("tag", languages())
def test_many_random_transcripts(tag: str, tmp_path: Path) -> None:
    outcomes = run(tmp_path / "a.txt", f"slow-{SEED}-{tag}", 500, tag)
    assert {"read", "transcript-unreadable"} <= outcomes


# Texts that a naive reader is slow, deep or wrong on.
STORMS: dict[str, Callable[[], str]] = {
    "5,000 digits": lambda: "7" * 5000,
    "5,000 zeros": lambda: "0" * 5000,
    "5,000 groups": lambda: "1" + ",000" * 5000,
    "5,000 points": lambda: "1" + ".1" * 5000,
    "digits and blanks": lambda: "1 000" * 5000,
    "decimal storm": lambda: "1.,1,." * 5000,
    "times": lambda: "12:30:" * 5000,
    "dates": lambda: "2024-01-" * 5000,
    "minus": lambda: " -1" * 5000 + "-" * 5000,
    "money": lambda: "$" * 5000 + "€1" * 5000,
    "percent": lambda: "1%" * 5000,
    "open brackets": lambda: "[" * LONG + "word",
    "deep brackets": lambda: "[" * 20_000 + "x" + "]" * 20_000 + " word",
    "mixed brackets": lambda: "<[" * 20_000 + "word" + "]>" * 20_000,
    "open tags": lambda: "<a " * 30_000,
    "open values": lambda: "<a b=\"'" * 10_000 + " word",
    "apostrophes": lambda: "a'" * 20_000,
    "hyphens": lambda: "a-" * 20_000,
    "one word": lambda: "a" * 20_000,
    "accents": lambda: "a" + "\u0301" * LONG,
    "decomposed": lambda: unicodedata.normalize("NFD", "é") * 20_000,
    "marks without letters": lambda: "\u0301" * LONG,
    "vowel signs": lambda: "क" + "ि" * 50_000,
    "joiners": lambda: "\u200d" * LONG,
    "blanks": lambda: " " * LONG + "word" + "\u00a0" * LONG,
    "line ends": lambda: "\r\n" * 50_000 + "word",
    "nul": lambda: "word" + "\0" * LONG,
    "byte order marks": lambda: "\ufeff" * LONG + "word",
    "emoji": lambda: "👩\u200d👩\u200d👧" * 20_000 + " word",
    "right to left": lambda: "\u202eשלום\u202c " * 200,
    "Arabic digits": lambda: "٧" * 5000,
    "abbreviations": lambda: "Dr. " * 2000,
    "signs": lambda: "&+=@" * 5000,
    "han": lambda: "你好" * 2000,
    "kana": lambda: "かーっん" * 1000,
}


@pytest.mark.parametrize("tag", ["en", "ar", "ja", "zh"])
@pytest.mark.parametrize("storm", STORMS)
def test_storms_end_soon(storm: str, tag: str, tmp_path: Path) -> None:
    text = STORMS[storm]()
    if tag in ("ja", "zh"):  # a dictionary is asked for every piece
        text = text[: len(text) // 8]
    attempt(tmp_path / "a.txt", text.encode(), tag)  # that this returns is the test


@pytest.mark.slow
@pytest.mark.parametrize("tag", sorted({*languages()} - {"en", "ar"}))
@pytest.mark.parametrize("storm", STORMS)
def test_storms_end_soon_in_every_language(storm: str, tag: str, tmp_path: Path) -> None:
    attempt(tmp_path / "a.txt", STORMS[storm]().encode(), tag)


def test_a_hundred_thousand_characters_are_read_whole() -> None:
    sentence = "The 3 boats [splash] left at 12:30 for $5, didn't they? "
    text = sentence * (LONG // len(sentence))
    assert use(text, "en") == len(tokens(sentence, language("en"))) * (LONG // len(sentence))
