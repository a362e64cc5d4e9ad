"""The user's pronunciations, from a text file.

Two kinds of lines, which may be mixed: ``WORD  P R OW N`` in ARPAbet as in CMUdict, and
``word<TAB>ipa ipa ipa``. A further line for a word, or ``WORD(2)``, is a variant. ``;;;`` starts a
comment. A comment ``;;; [de]`` says that what follows, up to the next of its kind, is German;
before the first of them entries count for every language.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path

from animeme.errors import InputError
from animeme.phones import ARPABET_TO_IPA
from animeme_stages.align.language import Language, acoustic_phones
from animeme_stages.align.language import language as language_of
from animeme_stages.align.text import tokens

_SECTION = re.compile(r";;;\s*\[([A-Za-z][A-Za-z0-9_-]*)\]\s*$")
_VARIANT = re.compile(r"(.+)\(\d+\)$")
_ARPABET = re.compile(r"([A-Z]{1,2})[0-2]?$")


@dataclass(frozen=True)
class Entry:
    """One pronunciation: symbols of ARPAbet without stress, or of IPA."""

    phones: tuple[str, ...]
    arpabet: bool


@dataclass(frozen=True)
class Lexicon:
    """Pronunciations by word.

    Attributes:
        source: the file.
        entries: word as `tokens` spells it → its pronunciations in the file's order.
        unused: ``file:line`` of entries that no text can match, since they are not one word.
    """

    source: str
    entries: Mapping[str, tuple[Entry, ...]] = field(default_factory=dict)
    unused: tuple[str, ...] = ()


def read_lexicon(path: Path, language: Language) -> Lexicon:
    """The entries of a lexicon file that are for `language`.

    Raises:
        InputError: the file cannot be read, or a line of it cannot be used; names the line.
    """
    entries: dict[str, dict[Entry, None]] = {}
    unused: list[str] = []
    section = ""
    for number, line in enumerate(_text(path).splitlines(), start=1):
        place = f"{path}:{number}"
        heading = _SECTION.match(line.strip())
        if heading:
            section = heading[1].replace("_", "-").split("-")[0].lower()
        content = line.split(";;;")[0].rstrip()
        if not content.strip() or section not in ("", language.tag):
            continue
        written, entry = _entry(content, place)
        word = _word(written, language)
        if word:
            entries.setdefault(word, {})[entry] = None
        else:
            unused.append(place)
    return Lexicon(
        str(path), {word: tuple(found) for word, found in entries.items()}, tuple(unused)
    )


def check_lexicon(path: Path) -> None:
    """Read a lexicon for every language that it has a section for.

    Raises:
        InputError: as `read_lexicon`.
    """
    sections = {match[1] for line in _text(path).splitlines() if (match := _SECTION.match(line))}
    for tag in sorted(sections) or ["en"]:
        read_lexicon(path, language_of(tag))


def _text(path: Path) -> str:
    try:
        return path.read_text(encoding="utf-8-sig")
    except (OSError, UnicodeDecodeError) as error:
        reason = getattr(error, "strerror", None) or "is not UTF-8 text"
        raise InputError(
            "lexicon-unreadable",
            f"the lexicon cannot be read: {reason}",
            place=str(path),
            action="Name a text file in UTF-8.",
        ) from error


def _entry(content: str, place: str) -> tuple[str, Entry]:
    """The word of a line, and its pronunciation."""
    tabbed = "\t" in content.strip()
    written, _, said = content.strip().partition("\t") if tabbed else _halves(content.strip())
    written, phones = written.strip(), said.split(" #")[0].split()
    if not written or not phones:
        raise _broken("has a word without a pronunciation", place)
    arpabet = [_ARPABET.match(phone) for phone in phones]
    plain = tuple(match[1] for match in arpabet if match)
    if len(plain) == len(phones) and all(symbol in ARPABET_TO_IPA for symbol in plain):
        return written, Entry(plain, arpabet=True)
    if not tabbed:
        wrong = next(
            p for p in phones if (m := _ARPABET.match(p)) is None or m[1] not in ARPABET_TO_IPA
        )
        raise _broken(f"has '{wrong}', which is not an ARPAbet phone", place)
    for phone in phones:
        _require_ipa(phone, place)
    return written, Entry(tuple(phones), arpabet=False)


def _halves(content: str) -> tuple[str, str, str]:
    word, *rest = content.split(maxsplit=1)
    return word, " ", rest[0] if rest else ""


def _require_ipa(phone: str, place: str) -> None:
    try:
        known = acoustic_phones(phone)
    except KeyError as error:
        raise _broken(
            f"has '{phone}', in which {error} is no IPA sound that is known", place
        ) from None
    if not known:
        raise _broken(f"has '{phone}', which is a mark without a sound", place)


def _broken(problem: str, place: str) -> InputError:
    return InputError(
        "lexicon-invalid",
        f"the line {problem}",
        place=place,
        action="Write `WORD  P R OW N` in ARPAbet, or the word, a tab, and its IPA with a blank "
        "between sounds.",
    )


def _word(written: str, language: Language) -> str:
    """`written` as `tokens` spells it; "" if it is not one word."""
    variant = _VARIANT.match(written)
    found = tokens(variant[1] if variant else written, language)
    return "".join(token.text for token in found) if len(found) == 1 or language.reader else ""
