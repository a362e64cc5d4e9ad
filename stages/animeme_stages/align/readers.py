"""Readers for scripts that neither part words nor spell sounds: Chinese and Japanese."""

from __future__ import annotations

import re
import unicodedata
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import cache
from typing import Any

from animeme.errors import InputError
from animeme_stages.align.language import Language

# Han characters, with the zero and the repetition mark that are written among them.
_HAN = re.compile("[〇々\u3400-\u4dbf\u4e00-\u9fff\uf900-\ufaff\U00020000-\U000323af]+")
_KANA = re.compile("[ぁ-ゖァ-ヺーヽヾ]+")
_HIRAGANA_TO_KATAKANA = {code: code + 0x60 for code in range(ord("ぁ"), ord("ゖ") + 1)}
# The tongue's tip stays where the consonant put it: their i is no [i].
_APICAL = ("zh", "ch", "sh", "r", "z", "c", "s")


@dataclass(frozen=True)
class Piece:
    """A word of a run of text.

    Attributes:
        surface: as written.
        phones: its sounds in IPA; () where the reader has none.
        spelling: how espeak-ng reads it with these sounds (pinyin with tones, kana); "" where the
            reader has none.
    """

    surface: str
    phones: tuple[str, ...] = ()
    spelling: str = ""


Reader = Callable[[str], list[Piece]]


@cache
def reader(language: Language) -> Reader:
    """The function that parts a run of `language` into words with their sounds.

    Raises:
        InputError: its extra is not installed; says how to install it.
    """
    try:
        return {"chinese": _chinese, "japanese": _japanese}[language.reader](language)
    except ImportError:
        raise InputError(
            "extra-missing",
            f"{language.name} is written without spaces and needs a reader, which is not installed",
            place=f"extra '{language.reader}'",
            action=f"Run `pip install 'animeme[{language.reader}]'`.",
        ) from None


def holds_script(word: str) -> bool:
    """Whether a word has characters that only a reader can pronounce."""
    return bool(_HAN.search(word) or _KANA.search(word))


def _chinese(language: Language) -> Reader:
    """Words of a phrase table, with pypinyin's readings."""
    from pypinyin import Style, lazy_pinyin
    from pypinyin.seg.mmseg import seg

    sounds = language.sounds

    def phones(word: str) -> tuple[str, ...]:
        found: list[str] = []
        initials = lazy_pinyin(word, style=Style.INITIALS, errors="ignore")
        finals = lazy_pinyin(word, style=Style.FINALS, errors="ignore")
        names = lazy_pinyin(word, errors="ignore")
        for initial, final, name in zip(initials, finals, names, strict=True):
            if not initial and not final:  # 嗯, 呣: a consonant alone
                initial = name
            apical = final == "i" and initial in _APICAL
            known = "-i" if apical else final
            found += f"{sounds.get(initial, '')} {sounds.get(known, '')}".split()
        return tuple(found)

    def spelling(word: str) -> str:
        toned = lazy_pinyin(word, style=Style.TONE3, errors="ignore", neutral_tone_with_five=True)
        return "".join(language.spellings.get(s[:-1], s[:-1]) + s[-1] for s in toned)

    def read(run: str) -> list[Piece]:
        pieces: list[Piece] = []
        for part, is_han in _parted(run, _HAN):
            if is_han:
                pieces += [Piece(word, phones(word), spelling(word)) for word in seg.cut(part)]
            else:
                pieces.append(Piece(part))
        return pieces

    return read


def _japanese(language: Language) -> Reader:
    """Janome's words, and the sounds of the kana that it reads them as."""
    tokenizer = _janome()

    def read(run: str) -> list[Piece]:
        pieces: list[Piece] = []
        for token in tokenizer.tokenize(run):
            kana = token.surface if token.phonetic == "*" else token.phonetic
            phones = kana_phones(kana, language)
            pieces.append(Piece(token.surface, phones, kana if phones else ""))
        whole = "".join(piece.surface for piece in pieces)
        return pieces if whole == run else [Piece(run)]

    return read


@cache
def _janome() -> Any:
    from janome.tokenizer import Tokenizer

    return Tokenizer()


def kana_phones(text: str, language: Language) -> tuple[str, ...]:
    """IPA of kana as they are spoken; () if there is anything else in `text`.

    The doubling sign lengthens the consonant after it, the long-vowel sign the vowel before it,
    and the final nasal takes the place of the consonant that follows.
    """
    kana = unicodedata.normalize("NFKC", text).translate(_HIRAGANA_TO_KATAKANA)
    found: list[str] = []
    doubled = False
    position = 0
    while position < len(kana):
        length = 2 if kana[position : position + 2] in language.sounds else 1
        mora = kana[position : position + length]
        position += length
        if mora == "ー":
            if found and not found[-1].endswith("ː"):
                found[-1] += "ː"
        elif mora == "ッ":
            doubled = True
        elif mora not in language.sounds:
            return ()
        else:
            first, *others = language.sounds[mora].split()
            found += [first + "ː" if doubled and others else first, *others]
            doubled = False
    if doubled:
        found.append("ʔ")
    return tuple(_placed(found))


def _placed(phones: list[str]) -> Iterator[str]:
    """The final nasal before lips, teeth ridge and velum."""
    for index, phone in enumerate(phones):
        following = phones[index + 1][0] if index + 1 < len(phones) else ""
        if phone != "ɴ" or not following:
            yield phone
        else:
            places = (("pbm", "m"), ("tdnszɾ", "n"), ("kɡ", "ŋ"))
            yield next((nasal for after, nasal in places if following in after), phone)


def _parted(run: str, pattern: re.Pattern[str]) -> Iterator[tuple[str, bool]]:
    """The parts of `run`, each with whether it matches."""
    cursor = 0
    for match in pattern.finditer(run):
        if match.start() > cursor:
            yield run[cursor : match.start()], False
        yield match[0], True
        cursor = match.end()
    if cursor < len(run):
        yield run[cursor:], False
