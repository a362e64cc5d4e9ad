"""Transcripts to words, each tied to its place in the original."""

from __future__ import annotations

import re
import unicodedata
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cache

from num2words import num2words

from animeme_stages.align.language import Language

# Stage directions and engine tags are not spoken.
_TAG = re.compile(r"<[^<>]*>|\[[^\[\]]*\]")
_APOSTROPHES = str.maketrans({"’": "'", "‘": "'", "ʼ": "'", "`": "'", "´": "'"})
_SOFT_HYPHEN = "\u00ad"
# A letter with the accents that are written after it.
_LETTERS = rf"(?:[^\W\d_][\u0300-\u036f{_SOFT_HYPHEN}]*)+"
_CURRENCY = "$€£"
# Longer runs of digits are serial numbers, read one by one; num2words has no names for them.
_LONGEST_NUMBER = 12


@dataclass(frozen=True)
class Token:
    """A word to pronounce, lower case, and the characters [start, end) it was read from."""

    text: str
    start: int
    end: int


def tokens(text: str, language: Language) -> list[Token]:
    """The words of a transcript in speaking order.

    Numbers and signs become words of the language, tags in ``<…>`` and ``[…]`` are left out,
    punctuation separates.

    Args:
        text: the transcript, which the positions refer to.
        language: whose words numbers become.
    """
    plain = text.translate(_APOSTROPHES)
    plain = _TAG.sub(lambda match: " " * len(match[0]), plain)
    found: list[Token] = []
    for match in _pattern(language.tag, "".join(language.symbols)).finditer(plain):
        spoken = unicodedata.normalize("NFC", " ".join(_spoken(match, language)))
        words = spoken.lower().replace(_SOFT_HYPHEN, "").replace("-", " ").replace(",", " ")
        found += [Token(word, match.start(), match.end()) for word in words.split()]
    return found


@cache
def _pattern(tag: str, symbols: str) -> re.Pattern[str]:
    """What can be spoken: numbers with what belongs to them, signs, words."""
    signs = f"[{re.escape(symbols)}]" if symbols else r"(?!)"
    ordinal = r"(?P<ordinal>(?:st|nd|rd|th)\b)?" if tag == "en" else ""
    number = rf"(?:(?P<minus>(?<!\S)[-−])|(?P<currency>[{re.escape(_CURRENCY)}])\s?)?"
    number += rf"(?P<number>\d+(?:[.,]\d+)*){ordinal}"
    return re.compile(rf"{number}|(?P<sign>{signs})|(?P<word>{_LETTERS}(?:'{_LETTERS})*)", re.I)


def _spoken(match: re.Match[str], language: Language) -> Iterator[str]:
    """What one match of `_pattern` is read as."""
    if match["word"]:
        yield match["word"]
    elif match["sign"]:
        yield language.symbols[match["sign"]]
    else:
        digits = "".join(str(int(c)) if c.isdigit() else c for c in match["number"])
        if match["minus"]:
            yield language.minus
        if "ordinal" in match.re.groupindex and match["ordinal"] and _is_plain(digits):
            yield str(num2words(int(digits), to="ordinal", lang=language.numbers))
        else:
            yield from _number_words(digits, language)
        if match["currency"]:
            yield language.symbols.get(match["currency"], "")


def _number_words(digits: str, language: Language) -> Iterator[str]:
    """Words for a number as written, with the language's separators."""
    thousands = "," if language.decimal == "." else "."
    whole, *rest = digits.split(language.decimal)
    if len(rest) > 1:  # no number: a version, a date, an address
        for part in digits.split(language.decimal):
            yield from _number_words(part, language)
        return
    if re.fullmatch(rf"\d{{1,3}}(?:\{thousands}\d{{3}})+", whole):
        whole = whole.replace(thousands, "")
    for part in re.split(r"[.,]", whole):
        yield from _whole_words(part, language)
    if rest:
        yield language.decimal_word
        for part in rest[0].split(thousands):
            yield from (_name(digit, language) for digit in part)


def _whole_words(digits: str, language: Language) -> Iterator[str]:
    if _is_plain(digits):
        yield _name(digits, language)
    else:
        yield from (_name(digit, language) for digit in digits)


def _is_plain(digits: str) -> bool:
    """Whether digits are read as one number; a leading zero is part of what is said."""
    return digits.isdigit() and len(digits) <= _LONGEST_NUMBER and str(int(digits)) == digits


@cache
def _name(digits: str, language: Language) -> str:
    return str(num2words(int(digits), lang=language.numbers))
