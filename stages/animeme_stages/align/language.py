"""What is known of each language: a data file in ``languages/``, and the acoustic map."""

from __future__ import annotations

import tomllib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import cache, cached_property
from importlib.resources import files
from typing import Any

from animeme.errors import InputError
from animeme.phones import Inventory, plain_ipa

_FOLDER = files("animeme_stages.align").joinpath("languages")


@dataclass(frozen=True)
class Scale:
    """A number that others are counted by: 1000, thousand."""

    value: int
    name: str


@dataclass(frozen=True)
class Numerals:
    """Names of numbers, for a language that num2words lacks.

    Attributes:
        small: names of 0, 1, 2 …
        scales: from the largest to the smallest; below the smallest, `small` has every name.
        special: names that are not composed, by number in digits.
        joint: between parts.
        gap: said where powers are left out.
        before_rest: form of a part that another follows.
    """

    small: tuple[str, ...]
    scales: tuple[Scale, ...]
    special: Mapping[str, str] = field(default_factory=dict)
    joint: str = " "
    gap: str = ""
    before_rest: Mapping[str, str] = field(default_factory=dict)


@dataclass(frozen=True, eq=False)  # one object per tag, hashed by identity
class Language:
    """One language's settings.

    Attributes:
        tag: primary BCP-47 subtag.
        name: in English.
        voice: espeak-ng voice.
        inventory: of the phones that alignments report.
        decimal: decimal separator; the other of ``.`` and ``,`` groups thousands.
        decimal_word, minus: how the separator and a minus sign are spoken.
        numbers: num2words locale, "" where it has none and `numerals` names the numbers.
        symbols: sign → words.
        accents: espeak-ng voices whose pronunciations are offered too.
        reader: "chinese" or "japanese" where words and sounds need one, which is also its extra.
        sounds: the reader's units (kana, or initials and finals of pinyin) → IPA.
        also: word → pronunciations beside the dictionary's, in ARPAbet.
        spellings: the reader's unit → one that espeak-ng reads with the same sounds.
        ipa: espeak-ng's own spelling of a phone → IPA.
        numerals: names of the numbers where num2words has none.
        respell: mends num2words' spelling, part by part.
        blanks: blanks group thousands too.
        grouping: regular expression of a whole number whose thousands are grouped.
        one: 1 before a noun, "" if it is said as it is counted.
        plural: rule that chooses among the forms of units and currencies.
        units, currencies: abbreviation or sign → forms of the noun.
        magnitudes: words that stand between a number and its currency, but are said before it.
        cents: the two decimals of a sum are said after the currency.
        percent: what is said before a number that ``%`` follows, "" if it is said after it.
        abbreviations: as written → words; blanks in them are optional.
        ordinal: ``suffix``, a regular expression after digits, and ``ending``, added to it.
        ordinals: ordinals that num2words lacks or gets wrong, by number in digits.
        time: how ``10:30`` (words), ``10:00`` (full), ``10:05`` (early) are said, the same at one
            o'clock (words_one …), names of the hours, and a word to take along (after).
        date: how an ISO date is said, with months and the forms of day and year.
    """

    tag: str
    name: str
    voice: str
    inventory: Inventory
    decimal: str
    decimal_word: str
    minus: str
    numbers: str
    symbols: Mapping[str, str]
    accents: tuple[str, ...] = ()
    reader: str = ""
    sounds: Mapping[str, str] = field(default_factory=dict)
    also: Mapping[str, Sequence[str]] = field(default_factory=dict)
    spellings: Mapping[str, str] = field(default_factory=dict)
    ipa: Mapping[str, str] = field(default_factory=dict)
    numerals: Numerals | None = None
    respell: Mapping[str, str] = field(default_factory=dict)
    blanks: bool = False
    grouping: str = ""
    one: str = ""
    plural: str = "one"
    units: Mapping[str, Sequence[str]] = field(default_factory=dict)
    currencies: Mapping[str, Sequence[str]] = field(default_factory=dict)
    magnitudes: Sequence[str] = ()
    cents: bool = True
    percent: str = ""
    abbreviations: Mapping[str, str] = field(default_factory=dict)
    ordinal: Mapping[str, str] = field(default_factory=dict)
    ordinals: Mapping[str, str] = field(default_factory=dict)
    time: Mapping[str, str] = field(default_factory=dict)
    date: Mapping[str, Any] = field(default_factory=dict)

    @property
    def family(self) -> str:
        """Which calibration its alignments need: whether the acoustic model knows its phones."""
        return "en" if self.inventory == "arpabet" else "mapped"

    @property
    def thousands(self) -> str:
        """Separator that groups thousands."""
        return "," if self.decimal == "." else "."

    @cached_property
    def signs(self) -> dict[str, str]:
        """Signs that are spoken on their own: symbols, and currencies without a number."""
        money = {sign: forms[-1] for sign, forms in self.currencies.items() if len(sign) == 1}
        return {
            **{sign: said for sign, said in money.items() if not sign.isalpha()},
            **self.symbols,
        }

    def abbreviation(self, written: str) -> str:
        """What an abbreviation stands for, however its blanks and capitals are written."""
        short = "".join(written.split())
        return self._abbreviations.get(short) or self._abbreviations[short.casefold()]

    @cached_property
    def _abbreviations(self) -> dict[str, str]:
        exact = {"".join(short.split()): said for short, said in self.abbreviations.items()}
        return {short.casefold(): said for short, said in exact.items()} | exact


@cache
def languages() -> tuple[str, ...]:
    """Tags of all languages that have a data file, sorted."""
    return tuple(
        sorted(f.name.removesuffix(".toml") for f in _FOLDER.iterdir() if f.name.endswith(".toml"))
    )


def language(tag: str) -> Language:
    """The language of a BCP-47 tag; region and script subtags are looked past.

    Raises:
        InputError: there is no data file for it.
    """
    primary = tag.replace("_", "-").split("-")[0].lower()
    if primary not in languages():
        raise InputError(
            "language-unknown",
            f"'{tag}' is not a language that can be aligned",
            place=tag,
            action=f"Known languages: {', '.join(languages())}. Folders are named by BCP-47 tag.",
        )
    return _read(primary)


@cache
def _read(primary: str) -> Language:
    data = tomllib.loads(_FOLDER.joinpath(f"{primary}.toml").read_text(encoding="utf-8"))
    if "numerals" in data:
        table = data["numerals"]
        scales = tuple(Scale(value, name) for value, name in table.pop("scales"))
        data["numerals"] = Numerals(tuple(table.pop("small").split()), scales, **table)
    thousands = "," if data["decimal"] == "." else "."
    data.setdefault("grouping", rf"\d{{1,3}}(?:\{thousands}\d{{3}})+")
    data["accents"] = tuple(data.get("accents", ()))
    return Language(tag=primary, **data)


@cache
def _acoustic_map() -> dict[str, tuple[str, ...]]:
    text = files("animeme_stages.align").joinpath("acoustic_map.toml").read_text(encoding="utf-8")
    tables = tomllib.loads(text)
    return {ipa: tuple(cmu.split()) for table in tables.values() for ipa, cmu in table.items()}


@cache
def acoustic_phones(ipa: str) -> tuple[str, ...]:
    """The English model's phones that come nearest to an IPA symbol.

    Args:
        ipa: one phone, marks allowed; a symbol outside the map is read piece by piece.

    Raises:
        KeyError: a piece has no entry.

    Example:
        >>> acoustic_phones("ts"), acoustic_phones("əl")
        (('T', 'S'), ('AH', 'L'))
    """
    table = _acoustic_map()
    rest = plain_ipa(ipa)
    found: list[str] = []
    while rest:
        length = next((n for n in range(len(rest), 0, -1) if rest[:n] in table), 0)
        if not length:
            raise KeyError(rest[0])
        found += table[rest[:length]]
        rest = rest[length:]
    return tuple(found)
