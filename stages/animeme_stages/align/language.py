"""What is known of each language: a data file in ``languages/``, and the acoustic map."""

from __future__ import annotations

import tomllib
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache
from importlib.resources import files

from animeme.errors import InputError
from animeme.phones import Inventory, plain_ipa

_FOLDER = files("animeme_stages.align").joinpath("languages")


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
        numbers: num2words locale.
        symbols: sign → words.
        beams: the decoder's, for the first try.
        squeezed_share: share of phones at their shortest above which a line is for review.
        score_floor: mean acoustic score per frame below which a line is for review.
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
    beams: Mapping[str, float]
    squeezed_share: float
    score_floor: float


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
