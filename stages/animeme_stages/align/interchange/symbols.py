"""Phone symbols as other tools spell them, and what they are here."""

from __future__ import annotations

import re
from collections.abc import Sequence

from animeme.phones import ARPABET_TO_IPA, SILENCE, Inventory
from animeme_stages.align.interchange.timings import Span
from animeme_stages.align.language import acoustic_phones

SILENCES = frozenset(
    {"", "sil", "sp", "spn", "silence", "pau", "pause", "h#", "#", "_", "epi", "br", "breath"}
    | {"noise", "<eps>", "<sil>", "<p:>", "<s>", "</s>", "!sil"}
)
"""What MFA, Kaldi, HTK, Festival, TIMIT and WebMAUS write for a pause, in lower case."""

# ARPAbet beyond CMUdict's 39 phones (TIMIT, Buckeye, Festival) → the nearest of these; after
# Zue & Seneff 1988, "Transcription and alignment of the TIMIT database", table 1.
_VARIANTS = {
    "AX": "AH",
    "AX-H": "AH",
    "AXR": "ER",
    "IX": "IH",
    "UX": "UW",
    "DX": "D",
    "NX": "N",
    "HV": "HH",
    "EL": "L",
    "EM": "M",
    "EN": "N",
    "ENG": "NG",
}

# Interjections that are spelt like ARPAbet vowels.
_ALSO_WORDS = frozenset({"AH", "AW", "EH", "ER", "OW", "OY", "SH", "UH"})

_TRIPHONE = re.compile(r"[^-+]*-([^-+]+)\+[^-+]*")  # HTK: left-centre+right
_POSITION = re.compile(r"_[BIES]$")  # Kaldi: begin, inside, end, single
_LONGEST = 12  # a diphthong of two letters with three marks each, and room
_TONES = str.maketrans("", "", "˥˦˧˨˩⁰¹²³⁴⁵")  # heard, not seen


def arpabet(label: str) -> str | None:
    """The ARPAbet phone of a label, stress and context dropped; None where it is none.

    Example:
        >>> arpabet("AA1"), arpabet("iy_E"), arpabet("sil-hh+ah"), arpabet("SP"), arpabet("ə")
        ('AA', 'IY', 'HH', 'sil', None)
    """
    bare = _bare(label)
    if bare.lower() in SILENCES:
        return SILENCE
    symbol = re.sub(r"[012]$", "", bare).upper()
    symbol = _VARIANTS.get(symbol, symbol)
    return symbol if symbol in ARPABET_TO_IPA else None


def ipa(label: str) -> str | None:
    """The IPA symbol of a label, tone and context dropped; None where it is none.

    Example:
        >>> ipa("t͡ʃ"), ipa("a˥˩"), ipa(""), ipa("PT")
        ('t͡ʃ', 'a', 'sil', None)
    """
    bare = _bare(label)
    if bare.lower() in SILENCES:
        return SILENCE
    symbol = bare.translate(_TONES)
    try:
        known = len(symbol) <= _LONGEST and bool(acoustic_phones(symbol))
    except KeyError:
        known = False
    return symbol if known else None


def inventory_of(labels: Sequence[str]) -> Inventory | None:
    """The inventory that all `labels` belong to; None where there is none.

    Small single letters alone are IPA: [t y], French "tu", has a vowel where ARPAbet has a glide.

    Example:
        >>> inventory_of(["T", "Y"]), inventory_of(["t", "y", ""]), inventory_of(["t", "uw"])
        ('arpabet', 'ipa', 'arpabet')
    """
    in_ipa = all(ipa(label) is not None for label in labels)
    if all(arpabet(label) is not None for label in labels):
        spoken = [_bare(label) for label in labels if arpabet(label) != SILENCE]
        single = all(len(label) == 1 and label.islower() for label in spoken)
        return "ipa" if in_ipa and single and spoken else "arpabet"
    return "ipa" if in_ipa else None


def looks_phonetic(spans: Sequence[Span]) -> bool:
    """Whether a tier without a telling name holds phones rather than words.

    Phones are known symbols. "uh" and "er" are words as well, so ARPAbet needs one label that is
    none; and so are "a" and "la", so IPA needs symbols that are mostly single.
    """
    spoken = [_bare(span.label) for span in spans if _bare(span.label).lower() not in SILENCES]
    if not spoken:
        return False
    inventory = inventory_of(spoken)
    if inventory == "arpabet":
        return any(label.upper() not in _ALSO_WORDS for label in spoken)
    return inventory == "ipa" and sum(map(len, spoken)) <= 1.7 * len(spoken)


def _bare(label: str) -> str:
    label = label.strip()
    triphone = _TRIPHONE.fullmatch(label)
    return triphone[1] if triphone else _POSITION.sub("", label)
