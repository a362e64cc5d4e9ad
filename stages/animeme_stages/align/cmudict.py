"""The CMU Pronouncing Dictionary of PocketSphinx, and what other accents make of its words."""

from __future__ import annotations

from collections.abc import Iterator
from functools import cache, lru_cache
from pathlib import Path

import pocketsphinx

from animeme_stages.align.language import Language

Pronunciation = tuple[tuple[str, tuple[str, ...]], ...]
"""Phones to report, each with the acoustic phones that stand for it."""

_VOWELS = frozenset(
    ["AA", "AE", "AH", "AO", "AW", "AY", "EH", "ER", "EY", "IH", "IY", "OW", "OY", "UH", "UW"]
)
# The vowel of "goat" as most of England says it; the model knows the American one.
_GOAT = ("OW", ("AH", "UH"))


def in_dictionary(word: str) -> bool:
    """Whether the dictionary has `word`, lower case."""
    return bool(_entry(word))


@lru_cache(maxsize=100_000)
def pronunciations(word: str, language: Language) -> tuple[Pronunciation, ...]:
    """All pronunciations of a word that the dictionary has, its own first.

    Args:
        word: lower case.
        language: English, with its further pronunciations.

    Raises:
        KeyError: the dictionary does not have it.
    """
    found = list(_entry(word))
    if not found:
        raise KeyError(word)
    found += [tuple(sounds.split()) for sounds in language.also.get(word, ())]
    variants = [variant for sounds in found for variant in _accents(sounds)]
    return tuple(dict.fromkeys(variants))


def _accents(sounds: tuple[str, ...]) -> Iterator[Pronunciation]:
    """A pronunciation as it is, without the r that half of English drops, and with its "goat"."""
    without_r = tuple(
        sound
        for at, sound in enumerate(sounds)
        if not (
            sound == "R"
            and at
            and sounds[at - 1] in _VOWELS
            and (at + 1 == len(sounds) or sounds[at + 1] not in _VOWELS)
        )
    )
    for each in dict.fromkeys((sounds, without_r)):
        plain = tuple((sound, (sound,)) for sound in each)
        yield plain
        if "OW" in each:
            yield tuple(_GOAT if sound == "OW" else (sound, (sound,)) for sound in each)


@lru_cache(maxsize=100_000)
def _entry(word: str) -> tuple[tuple[str, ...], ...]:
    """The dictionary's own pronunciations, () if it has none."""
    found: list[tuple[str, ...]] = []
    for name in (word, *(f"{word}({number})" for number in range(2, 10))):
        key = f"\n{name} ".encode()
        at = dictionary_text().find(key)
        if at < 0:
            break
        start = at + len(key)
        found.append(
            tuple(dictionary_text()[start : dictionary_text().index(b"\n", start)].decode().split())
        )
    return tuple(found)


@cache
def dictionary_text() -> bytes:
    """The dictionary as it is: looking a word up takes less than parsing all 134,000."""
    path = Path(pocketsphinx.get_model_path("en-us")) / "cmudict-en-us.dict"
    return b"\n" + path.read_bytes() + b"\n"
