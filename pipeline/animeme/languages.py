"""What folders, sheets and engines call a language, as BCP-47 tags."""

from __future__ import annotations

import difflib
import re
import tomllib
import unicodedata
from collections.abc import Collection
from functools import cache
from importlib.resources import files
from pathlib import Path

from animeme.errors import InputError

_SIGNS = re.compile(r"[\W_]+")
# Language, script, region, variants; nobody records dialogue in an extended language subtag.
_TAG = re.compile(
    r"[a-z]{2,3}(-[a-z]{4})?(-([a-z]{2}|[0-9]{3}))?(-([a-z0-9]{5,8}|[0-9][a-z0-9]{3}))*"
)


def language_tag(name: str, *, place: str = "") -> str:
    """The BCP-47 tag of a language, however somebody calls it.

    Args:
        name: a tag in any spelling (``pt_br``), an ISO 639 code, or a name (``English(US)``).
        place: where it was found, for the message.

    Raises:
        InputError: it is no language.

    Example:
        >>> [language_tag(name) for name in ("EN", "jp", "English(US)", "zh_CN", "German")]
        ['en', 'ja', 'en-US', 'zh-CN', 'de']
    """
    tag = find_tag(name)
    if tag is None:
        raise InputError(
            "language-unknown",
            f"'{name[:60]}' is not a language",
            place=place or name[:60],
            action=_advice(name),
        )
    return tag


@cache
@cache
def find_tag(name: str) -> str | None:
    """As `language_tag`, None where there is none."""
    spelt = unicodedata.normalize("NFC", name).strip().casefold()
    if spelt.startswith("x-") and re.fullmatch(r"x(-[a-z0-9]{1,8})+", spelt):
        return spelt  # private use: a plug-in may know it
    names, regions = _tables()
    whole = _SIGNS.sub("", spelt)
    if whole in names:
        return names[whole]
    parts = [part for part in _SIGNS.split(spelt) if part]
    if not parts:
        return None
    if len(parts) == 1 and len(whole) == 4 and whole[:2] in names and whole[2:] in regions:
        parts = [whole[:2], whole[2:]]  # ptbr
    region = regions.get("".join(parts[1:]))
    if region is not None and names.get(parts[0], "-").isalpha():
        return f"{names[parts[0]]}-{region}"
    return _standard("-".join([names.get(parts[0], parts[0]), *parts[1:]]))


def nearest(tag: str, tags: Collection[str]) -> str | None:
    """The one of `tags` that a language goes by: itself, or the only one of its primary language.

    Example:
        >>> nearest("es-ES", ["en", "es"]), nearest("en", ["en-GB", "en-US"])
        ('es', None)
    """
    if tag in tags:
        return tag
    alike = [other for other in tags if other.split("-")[0] == tag.split("-")[0]]
    return alike[0] if len(alike) == 1 else None


def is_common(name: str) -> bool:
    """Whether `name` is a tag or name of one of the languages that games are often recorded in.

    Nearly every word of two or three letters is some language's code; where anything may stand,
    only these are meant.
    """
    names, _ = _tables()
    spelt = unicodedata.normalize("NFC", name).strip().casefold()
    first = _SIGNS.split(spelt)[0] if spelt else ""
    known = _SIGNS.sub("", spelt) in names or first in names
    known = known or (len(first) == 4 and first[:2] in names)  # ptbr
    return known and (tag := find_tag(name)) is not None and tag.split("-")[0] in names


def language_of_file(path: Path) -> str:
    """The tag that a file's folder or name tells, "" if none: ``de/game.po``, ``lines_de.csv``."""
    whole = path.absolute()
    tokens = re.split(r"[\s._-]", whole.stem)
    names = [whole.parent.name, "-".join(tokens[-2:]), tokens[-1], tokens[0]]
    names.append(whole.parent.parent.name)  # de/LC_MESSAGES/game.po
    return next((find_tag(name) or "" for name in names if is_common(name)), "")


@cache
def _tables() -> tuple[dict[str, str], dict[str, str]]:
    """Names → tag, and names → region."""
    text = files("animeme").joinpath("language_names.toml").read_text(encoding="utf-8")
    data = tomllib.loads(text)
    names = {tag: tag for tag in data["names"] if tag.isalpha()}
    names |= {name: tag for tag, several in data["names"].items() for name in several}
    regions = {code.lower(): code for code in data["regions"]}
    regions |= {name: code for code, several in data["regions"].items() for name in several}
    return names, regions


def _standard(tag: str) -> str | None:
    """A tag in its standard form, None if the register of languages does not have it."""
    # Imported here: it takes longer than all else that a run needs, and few names get this far.
    import langcodes

    if not _TAG.fullmatch(tag) or not langcodes.tag_is_valid(tag):
        return None
    standard: str = langcodes.standardize_tag(tag)
    return standard


def _advice(name: str) -> str:
    spelt = _SIGNS.sub("", name.casefold())
    known = [key for key in _tables()[0] if len(key) > 3 and key.isascii()]
    close = difflib.get_close_matches(spelt, known, 1)
    if close:
        return f"Did you mean '{close[0].capitalize()}' ({_tables()[0][close[0]]})?"
    return "Write a BCP-47 tag, such as en, de-AT or zh-Hans, or the language's English name."
