"""Transcripts to words, each tied to its place in the original."""

from __future__ import annotations

import re
import unicodedata
from dataclasses import dataclass

from num2words import num2words

from animeme_stages.align.language import Language

# Stage directions and engine tags are not spoken.
_TAG = re.compile(r"<[^<>]*>|\[[^\[\]]*\]")
_LETTERS = r"[^\W\d_][^\W\d_\u0300-\u036f]*[\u0300-\u036f]*"
_TOKEN = re.compile(
    rf"(?P<number>\d+(?:[.,]\d+)*)|(?P<word>{_LETTERS}(?:'{_LETTERS})*)|(?P<sign>\S)"
)
_APOSTROPHES = str.maketrans({"’": "'", "‘": "'", "ʼ": "'", "`": "'", "´": "'"})


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
        text: the transcript; positions refer to its NFC form.
        language: whose words numbers become.
    """
    plain = unicodedata.normalize("NFC", text).translate(_APOSTROPHES)
    plain = _TAG.sub(lambda match: " " * len(match[0]), plain)
    found: list[Token] = []
    for match in _TOKEN.finditer(plain):
        if match["word"]:
            spoken = match["word"]
        elif match["number"]:
            spoken = _number_words(match["number"], language)
        else:
            spoken = language.symbols.get(match["sign"], "")
        words = spoken.lower().replace("-", " ").replace(",", " ").split()
        found += [Token(word, match.start(), match.end()) for word in words]
    return found


def _number_words(digits: str, language: Language) -> str:
    """Words for a number as written, with the language's separators."""
    thousands = "," if language.decimal == "." else "."
    if re.fullmatch(rf"\d{{1,3}}(\{thousands}\d{{3}})+", digits):
        digits = digits.replace(thousands, "")
    if digits.isdigit():
        # Longer runs are serial numbers, read one by one, and num2words has no names for them.
        values = [digits] if len(digits) <= 12 else list(digits)
        return " ".join(num2words(int(value), lang=language.numbers) for value in values)
    parts = re.split(r"[.,]", digits)
    if len(parts) == 2 and language.decimal in digits:
        return str(num2words(float(f"{parts[0]}.{parts[1]}"), lang=language.numbers))
    return " ".join(_number_words(part, language) for part in parts)
