"""Words to phones: the user's lexicon, then the dictionary, then what a program guesses."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache, lru_cache

from animeme.errors import InputError
from animeme.phones import ARPABET_TO_IPA
from animeme_stages.align.cmudict import Pronunciation, in_dictionary, pronunciations
from animeme_stages.align.espeak import espeak, plain_symbol
from animeme_stages.align.g2p_words import can_spell, english_words
from animeme_stages.align.language import Language, acoustic_phones
from animeme_stages.align.lexicon import Lexicon
from animeme_stages.align.readers import holds_script
from animeme_stages.align.text import Token


@dataclass(frozen=True)
class SpokenWord:
    """A word as the aligner will look for it.

    Attributes:
        token: the word and its place in the transcript.
        variants: its pronunciations, at least one; each is as good as the first.
    """

    token: Token
    variants: tuple[Pronunciation, ...]


def pronounce(
    tokens: Sequence[Token],
    language: Language,
    place: str,
    lexicon: Lexicon | None = None,
) -> list[SpokenWord]:
    """Pronunciations of all `tokens`.

    Args:
        tokens: words in speaking order.
        language: theirs.
        place: the transcript's file, for messages.
        lexicon: the user's pronunciations, which come before all others.

    Raises:
        InputError: no word has a sound, or some cannot be pronounced with what is installed.
    """
    spoken: list[SpokenWord] = []
    unknown: dict[str, str] = {}
    for token in tokens:
        own = _from_lexicon(token.text, language, lexicon) if lexicon else ()
        if own:
            spoken.append(SpokenWord(token, own))
        elif language.inventory == "arpabet" and in_dictionary(token.text):
            spoken.append(SpokenWord(token, pronunciations(token.text, language)))
        else:
            try:
                found = guess(token, language)
            except InputError as error:
                if error.code not in ("word-unknown", "extra-missing"):
                    raise
                if language.inventory != "arpabet" and error.code == "extra-missing":
                    raise
                unknown[token.text] = error.action
                continue
            if found:
                spoken.append(SpokenWord(token, found))
    if unknown:
        raise InputError(
            "word-unknown",
            f"not in the dictionary: {', '.join(unknown)}",
            place=place,
            action=f"{next(iter(unknown.values()))} Or correct the spelling.",
        )
    if not spoken:
        raise InputError(
            "transcript-empty",
            "the transcript has no word that can be spoken",
            place=place,
            action="Write what is said in the recording, or take the line out of the folder.",
        )
    return spoken


def _from_lexicon(word: str, language: Language, lexicon: Lexicon) -> tuple[Pronunciation, ...]:
    found = lexicon.entries.get(word, ())
    return tuple(_arpabet(p.phones, language) if p.arpabet else _ipa(p.phones, word, language)
                 for p in found)  # fmt: skip


def proposer(token: Token, language: Language) -> str:
    """What `guess` asks about a word: its reader, the analogy with English words, or espeak-ng."""
    if token.phones:
        return "reader"
    by_analogy = language.inventory == "arpabet" and can_spell(token.text)
    return "analogy" if by_analogy else "espeak"


def guess(token: Token, language: Language) -> tuple[Pronunciation, ...]:
    """Pronunciations of a word that no lexicon and no dictionary has; () if it has no sound.

    Raises:
        InputError: it cannot be pronounced with what is installed, or at all.
    """
    if token.phones:
        return (_ipa(token.phones, token.text, language),)
    if language.reader and holds_script(token.text):
        raise InputError(
            "word-unknown",
            f"no reading of '{token.text}' is known",
            place=token.text,
            action="Add it to a lexicon.",
        )
    return _guess(token.text, language)


@lru_cache(maxsize=100_000)
def _guess(word: str, language: Language) -> tuple[Pronunciation, ...]:
    own = english_words().pronounce(word) if language.inventory == "arpabet" else ()
    if own:  # nearer to the dictionary than espeak-ng (docs/alignment.md), and always there
        return tuple(_arpabet(phones, language) for phones in own)
    spoken = [espeak().pronounce(word, voice) for voice in (language.voice, *language.accents)]
    clean = [tuple(language.ipa.get(ipa, ipa) for ipa in phones) for phones in spoken]
    return tuple(dict.fromkeys(_ipa(phones, word, language) for phones in clean if phones))


def espeak_phones(symbol: str, language: Language) -> tuple[str, ...]:
    """A phone of espeak-ng's in the language's inventory: none for a mark, several where needed.

    Raises:
        InputError: it has no counterpart in the acoustic model.
    """
    plain = plain_symbol(symbol)
    ipa = language.ipa.get(plain, plain)
    return tuple(name for name, _ in _ipa((ipa,) if ipa else (), symbol, language))


def _arpabet(phones: Sequence[str], language: Language) -> Pronunciation:
    """ARPAbet phones in the language's inventory."""
    if language.inventory == "arpabet":
        return tuple((symbol, (symbol,)) for symbol in phones)
    return tuple((ARPABET_TO_IPA[symbol], (symbol,)) for symbol in phones)


def _ipa(phones: Sequence[str], word: str, language: Language) -> Pronunciation:
    """IPA phones in the language's inventory."""
    found: list[tuple[str, tuple[str, ...]]] = []
    for ipa in phones:
        try:
            acoustic = acoustic_phones(ipa)
        except KeyError as error:
            raise InputError(
                "phone-unmapped",
                f"the sound {error} of '{word}' has no counterpart in the acoustic model",
                place=f"{language.name}, /{ipa}/",
                action="Please report it; the line can go on with another spelling.",
            ) from None
        if language.inventory == "arpabet":
            found += [(symbol, (symbol,)) for symbol in acoustic]
        elif acoustic:
            found.append((ipa, acoustic))
    return tuple(found)


@cache
def dictionary() -> frozenset[str]:
    """Words of the CMU dictionary that comes with PocketSphinx, lower case."""
    return frozenset(english_words().known)
