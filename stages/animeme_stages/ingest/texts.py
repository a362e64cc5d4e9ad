"""Texts as translators deliver them: gettext's PO, XLIFF 1.2 and 2."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from xml.etree.ElementTree import Element

from animeme.dialogue import composed
from animeme.errors import InputError
from animeme.translations import Text
from animeme_stages.ingest.safe_xml import read_xml
from animeme_stages.ingest.sheets import damaged, decoded

SUFFIXES = (".po", ".pot", ".xlf", ".xliff", ".mxliff", ".sdlxliff")

# Native codes, which nobody says: their content is markup of another format. The rest (g, mrk, pc,
# mrk) is put around what is said.
_CODES = frozenset({"bpt", "ept", "ph", "it", "x", "bx", "ex", "sc", "ec", "cp", "note"})
_UNFINISHED = ("new", "needs-", "initial")


def read_texts(path: Path) -> tuple[Text, ...]:
    """See `animeme.translations.read_translations`; a text without words is none.

    Raises:
        InputError: it cannot be used.
        OSError: it cannot be read.
    """
    if path.suffix.lower() in (".po", ".pot"):
        return tuple(_po(path))
    if path.suffix.lower() in SUFFIXES:
        return tuple(_xliff(path))
    raise InputError(
        "texts-unknown",
        f"'{path.suffix}' files hold no texts that could be joined",
        place=str(path),
        action=f"Give one of {', '.join(SUFFIXES)}; a sheet is a `manifest`.",
    )


def _po(path: Path) -> Iterator[Text]:
    # Imported here: few jobs have any.
    import polib

    text = decoded(path)
    for number, line in enumerate(text.splitlines(), 1):
        bare = line.strip()
        if bare and bare[0] != "#" and not (bare.endswith('"') and bare.count('"') > 1):
            damaged(path, f"line {number} is neither a comment nor a text in quotes")
    try:
        # With the text in place of a name polib reads that; a line end tells it from a name.
        entries = polib.pofile(text + "\n")
    except (OSError, ValueError, IndexError, UnicodeError, AttributeError, TypeError) as error:
        damaged(path, f"it is no complete PO file ({str(error).strip()[:80]})")
    language = str(entries.metadata.get("Language", "")).strip()
    for entry in entries:
        said = (entry.msgstr or "").strip()
        if entry.obsolete or not said:
            continue
        # With a context, gettext's own id is the text in the first language. Unreal writes
        # "namespace,key" there.
        context = entry.msgctxt or ""
        ids = [context, context.rpartition(",")[2]] if context else []
        yield Text(
            f"{path}:{entry.linenum}",
            language,
            _ids([*ids, entry.msgid]),
            said,
            entry.fuzzy,
        )


def _xliff(path: Path) -> Iterator[Text]:
    root = read_xml(path)
    if root.tag != "xliff":
        damaged(path, f"its root is <{root.tag[:40]}>, not <xliff>")
    if root.get("version", "").startswith("2"):
        for unit in root.iter("unit"):
            yield from _unit_2(unit, root, path)
        return
    for file in root.iter("file"):
        for unit in file.iter("trans-unit"):
            yield from _unit_1(unit, file, path)


def _unit_1(unit: Element, file: Element, path: Path) -> Iterator[Text]:
    ids = _ids([unit.get("resname", ""), unit.get("id", "")])
    for name, language in (("source", "source-language"), ("target", "target-language")):
        part = unit.find(name)
        said = "" if part is None else _said(part)
        if part is not None and said and ids and file.get(language):
            state = part.get("state", "") if name == "target" else ""
            place = f"{path}:{ids[0]}"
            yield Text(place, file.get(language, ""), ids, said, state.startswith(_UNFINISHED))


def _unit_2(unit: Element, root: Element, path: Path) -> Iterator[Text]:
    ids = _ids([unit.get("name", ""), unit.get("id", "")])
    for name, language in (("source", "srcLang"), ("target", "trgLang")):
        segments = [s for s in unit if s.tag in ("segment", "ignorable")]
        parts = [segment.find(name) for segment in segments]
        said = "".join("".join(_words(p)) for p in parts if p is not None).strip()
        states = [s.get("state", "") for s in segments if s.tag == "segment"]
        unfinished = name == "target" and any(s.startswith(_UNFINISHED) for s in states)
        if said and ids and root.get(language):
            place = f"{path}:{ids[0]}"
            yield Text(place, root.get(language, ""), ids, " ".join(said.split()), unfinished)


def _said(part: Element) -> str:
    return " ".join("".join(_words(part)).split())


def _words(part: Element) -> Iterator[str]:
    """The text in an element, without the content of codes."""
    yield part.text or ""
    for child in part:
        if child.tag not in _CODES:
            yield from _words(child)
        yield child.tail or ""


def _ids(said: list[str]) -> tuple[str, ...]:
    names = (composed(name.strip().replace("\\", "/")) for name in said)
    return tuple(dict.fromkeys(name for name in names if name and len(name) <= 1000))
