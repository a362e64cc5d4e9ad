"""How phones are articulated: classes that look alike, and the nearest of a set.

Places and manners: the IPA chart (IPA Handbook 1999). What can be seen of them: Jeffers & Barley,
Speechreading (1971).
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from functools import lru_cache

from animeme.phones import SILENCE

# Manner → place → symbols, voiceless first.
_CONSONANTS: dict[str, dict[str, str]] = {
    "plosive": {
        "bilabial": "pb", "dental": "", "alveolar": "td", "retroflex": "ʈɖ", "palatal": "cɟ",
        "velar": "kɡg", "uvular": "qɢ", "glottal": "ʔ",
    },
    "nasal": {
        "bilabial": "m", "labiodental": "ɱ", "alveolar": "n", "retroflex": "ɳ", "palatal": "ɲ",
        "velar": "ŋ", "uvular": "ɴ",
    },
    "trill": {"bilabial": "ʙ", "alveolar": "r", "uvular": "ʀ"},
    "tap": {"labiodental": "ⱱ", "alveolar": "ɾ", "retroflex": "ɽ"},
    "fricative": {
        "bilabial": "ɸβ", "labiodental": "fv", "dental": "θð", "alveolar": "sz",
        "postalveolar": "ʃʒ", "retroflex": "ʂʐ", "alveolopalatal": "ɕʑ", "palatal": "çʝ",
        "velar": "xɣ", "uvular": "χʁ", "glottal": "hɦħʕ",
    },
    "approximant": {
        "labiodental": "ʋ", "alveolar": "ɹ", "retroflex": "ɻ", "palatal": "j", "velar": "ɰ",
        "labiovelar": "wʍ", "labiopalatal": "ɥ",
    },
    "lateral": {"alveolar": "lɬɮɫ", "retroflex": "ɭ", "palatal": "ʎ", "velar": "ʟ"},
}  # fmt: skip

# Height → backness → (spread, rounded).
_VOWELS: dict[str, dict[str, tuple[str, str]]] = {
    "close": {"front": ("i", "y"), "central": ("ɨ", "ʉ"), "back": ("ɯ", "u")},
    "near-close": {"front": ("ɪ", "ʏ"), "central": ("ᵻ", ""), "back": ("", "ʊ")},
    "close-mid": {"front": ("e", "ø"), "central": ("ɘ", "ɵ"), "back": ("ɤ", "o")},
    "mid": {"central": ("ə", "")},
    "open-mid": {"front": ("ɛ", "œ"), "central": ("ɜɝɚ", "ɞ"), "back": ("ʌ", "ɔ")},
    "near-open": {"front": ("æ", ""), "central": ("ɐ", "")},
    "open": {"front": ("a", "ɶ"), "back": ("ɑ", "ɒ")},
}
_HEIGHTS = dict(zip(_VOWELS, (0.0, 0.15, 0.35, 0.5, 0.65, 0.85, 1.0), strict=True))
_BACKNESS = {"front": 0.0, "central": 0.5, "back": 1.0}

# Places on a scale of what can be seen: the lips are far from all else.
_PLACES = {
    "bilabial": 0.0,
    "labiodental": 4.0,
    "labiovelar": 8.0,
    "labiopalatal": 8.5,
    "dental": 12.0,
    "alveolar": 13.0,
    "postalveolar": 15.5,
    "alveolopalatal": 15.5,
    "retroflex": 15.0,
    "palatal": 17.0,
    "velar": 18.0,
    "uvular": 18.5,
    "glottal": 19.5,
}
_SIBILANTS = frozenset("szʃʒʂʐɕʑ")
_RHOTIC = frozenset("ɹɻɝɚ")

CLASSES = (
    "silence",
    "bilabial",
    "labiodental",
    "dental",
    "alveolar",
    "sibilant",
    "postalveolar",
    "rhotic",
    "glide-rounded",
    "palatal",
    "back",
    "vowel-close",
    "vowel-mid",
    "vowel-open",
    "vowel-central",
    "vowel-rounded-mid",
    "vowel-rounded-close",
    "unknown",
)
"""Classes of phones that look alike, the finest that contexts are told apart by."""

GROUPS: dict[str, frozenset[str]] = {
    "vowels": frozenset(c for c in CLASSES if c.startswith("vowel")),
    "rounded": frozenset(
        {"glide-rounded", "vowel-rounded-mid", "vowel-rounded-close", "postalveolar", "rhotic"}
    ),
    "labials": frozenset({"bilabial", "labiodental"}),
    "narrow": frozenset({"bilabial", "labiodental", "glide-rounded", "vowel-rounded-close"}),
    "open-vowels": frozenset({"vowel-open", "vowel-mid"}),
}
"""Wider classes, by name."""


@dataclass(frozen=True)
class Articulation:
    """How one piece of a phone is made.

    Attributes:
        symbol: one IPA letter.
        vowel: or a consonant.
        place: consonants: on the scale of `_PLACES`; vowels: backness, 0 front to 1 back.
        height: vowels: 0 close to 1 open; 0 for consonants.
        rounded: the lips are rounded.
        manner: row of the IPA chart, or height of the vowel.
    """

    symbol: str
    vowel: bool
    place: float
    height: float
    rounded: bool
    manner: str


def _table() -> dict[str, Articulation]:
    found: dict[str, Articulation] = {}
    for manner, places in _CONSONANTS.items():
        for place, symbols in places.items():
            for symbol in symbols:
                rounded = place.startswith("labio") and place != "labiodental"
                found[symbol] = Articulation(symbol, False, _PLACES[place], 0.0, rounded, manner)
    for height, columns in _VOWELS.items():
        for column, (spread, rounded_ones) in columns.items():
            for symbol in spread + rounded_ones:
                found[symbol] = Articulation(
                    symbol, True, _BACKNESS[column], _HEIGHTS[height],
                    symbol in rounded_ones or symbol in _RHOTIC, height,
                )  # fmt: skip
    return found


_LETTERS = _table()


def letters() -> tuple[str, ...]:
    """Every IPA letter that is known, in a fixed order."""
    return tuple(_LETTERS)


def pieces(symbol: str) -> tuple[Articulation, ...]:
    """The letters of a plain IPA symbol that are known, in order (``aɪ`` has two)."""
    return tuple(_LETTERS[letter] for letter in symbol if letter in _LETTERS)


@lru_cache(maxsize=1024)
def class_of(symbol: str, *, end: bool = False) -> str:
    """The class of a plain IPA symbol at its beginning, or at its end.

    Example:
        >>> class_of("m"), class_of("aʊ"), class_of("aʊ", end=True)
        ('bilabial', 'vowel-open', 'vowel-rounded-close')
    """
    if symbol == SILENCE:
        return "silence"
    letters = pieces(symbol)
    if not letters:
        return "unknown"
    # An affricate looks like its fricative from the start.
    return _class_of_letter(letters[-1] if end or not letters[0].vowel else letters[0])


def _class_of_letter(letter: Articulation) -> str:
    if letter.symbol in _RHOTIC:
        return "rhotic"
    if letter.vowel:
        if letter.rounded:
            return "vowel-rounded-close" if letter.height < 0.3 else "vowel-rounded-mid"
        if (letter.height >= 0.85 and letter.symbol != "æ") or letter.symbol in "ʌ":
            return "vowel-open"
        if letter.place > 0:
            return "vowel-central"
        return "vowel-close" if letter.height < 0.3 else "vowel-mid"
    if letter.rounded:
        return "glide-rounded"
    if letter.place <= _PLACES["labiodental"]:
        return "bilabial" if letter.place == 0.0 else "labiodental"
    if letter.symbol in _SIBILANTS:
        return "sibilant" if letter.place == _PLACES["alveolar"] else "postalveolar"
    if letter.place <= _PLACES["retroflex"]:
        return "dental" if letter.place == _PLACES["dental"] else "alveolar"
    return "palatal" if letter.place <= _PLACES["palatal"] else "back"


def nearest(symbol: str, known: Iterable[str]) -> str:
    """The symbol of `known` that looks most like `symbol`; itself if it is among them.

    What has no known letter looks like schwa. A pause is like nothing but a pause.

    Raises:
        ValueError: `known` is empty.
    """
    candidates = sorted(known)
    if symbol in candidates:
        return symbol
    spoken = [c for c in candidates if c != SILENCE] or candidates
    if not spoken:
        raise ValueError("no phone to choose from")
    return min(spoken, key=lambda other: (distance(symbol, other), other))


def distance(first: str, second: str) -> float:
    """How different two plain IPA symbols look, 0 if alike, at their starts and ends."""
    a, b = pieces(first) or pieces("ə"), pieces(second) or pieces("ə")
    extra = 0.5 * abs(len(a) - len(b))
    return (_between(a[0], b[0]) + _between(a[-1], b[-1])) / 2 + extra


def _between(a: Articulation, b: Articulation) -> float:
    if a.vowel != b.vowel:
        glide = {a.manner, b.manner} & {"approximant"} and a.rounded == b.rounded
        return 6.0 if glide else 14.0
    rounding = 3.0 * (a.rounded != b.rounded)
    if a.vowel:
        return 6.0 * abs(a.height - b.height) + 1.5 * abs(a.place - b.place) + rounding
    sibilance = 2.0 * ((a.symbol in _SIBILANTS) != (b.symbol in _SIBILANTS))
    return abs(a.place - b.place) + 0.5 * (a.manner != b.manner) + sibilance + rounding
