"""Transcripts to words, each tied to its place in the original."""

from __future__ import annotations

import re
import unicodedata
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field
from functools import cache

from animeme_stages.align import numerals
from animeme_stages.align.language import Language
from animeme_stages.align.readers import Piece, reader
from animeme_stages.align.tags import untagged

_APOSTROPHES = str.maketrans({"’": "'", "‘": "'", "ʼ": "'", "`": "'", "´": "'"})
# Part of the spelling, but not of the word: soft hyphen, joiners, the Arabic stretching line.
_SILENT = str.maketrans(dict.fromkeys("\u00ad\u200c\u200d\u0640", ""))
_BLANK = "[ \u00a0\u202f]"


@dataclass(frozen=True)
class Token:
    """A word to pronounce, lower case, and the characters [start, end) it was read from.

    `phones` is its pronunciation in IPA where the language's reader gave one, and `spelling` what
    espeak-ng reads so.
    """

    text: str
    start: int
    end: int
    phones: tuple[str, ...] = ()
    spelling: str = field(default="", compare=False)


def tokens(text: str, language: Language) -> list[Token]:
    """The words of a transcript in speaking order.

    Numbers and signs become words of the language, inline tags are left out (`timed_tags` keeps
    them), punctuation separates.

    Args:
        text: the transcript, which the positions refer to.
        language: whose words numbers become.

    Raises:
        InputError: the language needs a reader whose extra is not installed.
    """
    plain = _plain(untagged(text), language)
    found: list[Token] = []
    for match in _pattern(language).finditer(plain):
        spoken = " ".join(numerals.spoken(match, language))
        if language.reader:
            found += _read(spoken, match, language)
        else:
            found += [Token(w, match.start(), match.end()) for w in _words(spoken, language)]
    return found


def _plain(text: str, language: Language) -> str:
    """`text`, as long as before, with one kind of apostrophe, digit and separator."""
    separators = {"٫": language.decimal, "٬": language.thousands}
    text = text.translate(_APOSTROPHES | str.maketrans(separators))
    if text.isascii():
        return text
    return "".join(str(int(c)) if c.isdecimal() and not c.isascii() else c for c in text)


def _words(spoken: str, language: Language) -> list[str]:
    composed = unicodedata.normalize("NFC", spoken)
    parted = composed.translate(_SILENT).replace("-", " ").replace(",", " ")
    return [_lower(word, language) for word in parted.split()]


def _lower(word: str, language: Language) -> str:
    if language.tag == "tr":  # dotted and dotless i are two letters
        word = word.replace("I", "ı").replace("İ", "i")
    return word.lower()


def _read(spoken: str, match: re.Match[str], language: Language) -> Iterator[Token]:
    """Words of a script without spaces, or of none, as the language's reader finds them."""
    start = match.start()
    in_place = spoken == match[0]
    for piece in _pieces(spoken, language):
        end = start + len(piece.surface)
        place = (start, end) if in_place else (match.start(), match.end())
        start = end
        for word in _words(piece.surface, language):
            yield Token(word, *place, piece.phones, piece.spelling)


def _pieces(spoken: str, language: Language) -> Iterable[Piece]:
    for run in re.split(r"(\s+)", spoken):
        if run.isascii():  # a foreign word, or what separates
            yield Piece(run)
        else:
            yield from reader(language)(run)


@cache
def _marks() -> str:
    """Regular-expression class of what is written on or after a letter and belongs to it.

    Accents, vowel signs of Indic scripts, Arabic vowels, joiners; not variation selectors.
    """
    chosen = [
        chr(code)
        for code in range(0x300, 0xFE00)
        if unicodedata.category(chr(code)) in ("Mn", "Mc")
    ]
    return "[" + "".join(chosen) + "\u00ad\u200c\u200d]"


@cache
def _pattern(language: Language) -> re.Pattern[str]:
    """What can be spoken: numbers with what belongs to them, signs, words."""
    letters = rf"(?:[^\W\d_]{_marks()}*)+"
    signs = "".join(re.escape(sign) for sign in language.signs)
    parts = [
        *_dates_and_times(language),
        _number(language),
        rf"(?P<abbreviation>(?<!\w){_one_of(language.abbreviations, _BLANK)}(?!\w))",
        rf"(?P<sign>[{signs}])" if signs else r"(?!)",
        rf"(?P<word>{letters}(?:'{letters})*)",
    ]
    return re.compile("|".join(parts))


def _dates_and_times(language: Language) -> Iterator[str]:
    if language.date:
        yield (
            r"(?<!\d)(?P<year>[12]\d{3})-(?P<month>0[1-9]|1[0-2])-(?P<day>0[1-9]|[12]\d|3[01])"
            r"(?!\d|-\d)"
        )
    if language.time:
        after = re.escape(language.time.get("after", ""))
        yield (
            r"(?<![\d:.,])(?P<hour>[01]?\d|2[0-4]):(?P<minute>[0-5]\d)(?![\d:]|[.,]\d)"
            + (rf"(?:{_BLANK}?(?i:{after})\b)?" if after else "")
        )


def _number(language: Language) -> str:
    """A number with a sign or currency before it, and an ending, unit or currency after it."""
    number = r"\d+(?:[.,]\d+)*"
    if language.blanks:
        number = rf"\d{{1,3}}(?:{_BLANK}\d{{3}})+(?!\d)(?:[.,]\d+)?|{number}"
    money = _one_of(language.currencies)
    after = [
        rf"(?P<percent>{_BLANK}?%)" if language.percent else r"(?!)",
        rf"(?P<ordinal>(?i:{language.ordinal['suffix']})(?!\w))" if language.ordinal else r"(?!)",
        rf"{_BLANK}(?P<magnitude>{_one_of(language.magnitudes)})(?!\w)",
        rf"{_BLANK}?(?P<currency_after>{money})(?!\w)",
        rf"{_BLANK}?(?P<unit>{_one_of(language.units)})(?!\w)",
    ]
    before = rf"(?:(?P<minus>(?<!\S)[-−])|(?P<currency>{money}){_BLANK}?)?"
    return f"{before}(?P<number>{number})(?:{'|'.join(after)})?"


def _one_of(words: Iterable[str], blank: str = " ") -> str:
    """Alternatives, the longest first; where one has a blank, it may be missing."""
    ordered = sorted(words, key=len, reverse=True)
    return f"(?:{'|'.join(_literal(word, blank) for word in ordered)})" if ordered else "(?!)"


def _literal(word: str, blank: str) -> str:
    return f"{blank}?".join(re.escape(part) for part in word.split(" "))
