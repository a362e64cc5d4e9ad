"""Words to phones: dictionary first, espeak-ng for what it lacks."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

from animeme.errors import InputError
from animeme_stages.align.espeak import espeak
from animeme_stages.align.language import Language, acoustic_phones
from animeme_stages.align.text import Token


@dataclass(frozen=True)
class SpokenWord:
    """A word as the aligner will look for it.

    Attributes:
        token: the word and its place in the transcript.
        key: its name in the decoder's dictionary.
        phones: phones to report, each with the acoustic phones that stand for it; empty where the
            decoder's own dictionary is used and its phones are reported as they are.
    """

    token: Token
    key: str
    phones: tuple[tuple[str, tuple[str, ...]], ...] = ()


def pronounce(
    tokens: Sequence[Token], language: Language, in_dictionary: Callable[[str], bool], place: str
) -> list[SpokenWord]:
    """Pronunciations of all `tokens`.

    Args:
        tokens: words in speaking order.
        language: theirs.
        in_dictionary: whether the decoder's own (English) dictionary has a word.
        place: the transcript's file, for messages.

    Raises:
        InputError: no word has a sound, or some cannot be pronounced with what is installed.
    """
    spoken: list[SpokenWord] = []
    unknown: list[str] = []
    for token in tokens:
        if language.inventory == "arpabet" and in_dictionary(token.text):
            spoken.append(SpokenWord(token, token.text))
            continue
        try:
            phones = _espeak_phones(token.text, language)
        except InputError as error:
            if language.inventory != "arpabet":
                raise
            unknown.append(token.text)
            action = error.action
            continue
        if phones:
            spoken.append(SpokenWord(token, f"{language.tag}:{token.text}", phones))
    if unknown:
        raise InputError(
            "word-unknown",
            f"not in the dictionary: {', '.join(dict.fromkeys(unknown))}",
            place=place,
            action=f"{action} Or correct the spelling.",
        )
    if not spoken:
        raise InputError(
            "transcript-empty",
            "the transcript has no word that can be spoken",
            place=place,
            action="Write what is said in the recording, or take the line out of the folder.",
        )
    return spoken


def _espeak_phones(word: str, language: Language) -> tuple[tuple[str, tuple[str, ...]], ...]:
    """IPA phones of a word, or ARPAbet ones where that is the language's inventory."""
    phones: list[tuple[str, tuple[str, ...]]] = []
    for ipa in espeak().pronounce(word, language.voice):
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
            phones += [(symbol, (symbol,)) for symbol in acoustic]
        else:
            phones.append((ipa, acoustic))
    return tuple(phones)
