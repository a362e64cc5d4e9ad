"""Which column of a sheet is what."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

from animeme.documents import suggestion
from animeme.errors import InputError
from animeme.languages import find_tag, is_common, language_tag
from animeme.manifest import Columns, Row
from animeme_stages.ingest.sheets import Table

# Role → usual headers in small letters without signs, the surest first.
ALIASES: Mapping[str, Sequence[str]] = {
    "id": (
        "id", "lineid", "dialogueid", "dialogid", "stringid", "textid", "locid", "cueid", "key",
        "linekey", "stringkey", "uid", "guid", "identifier", "linename", "cue", "name", "line",
    ),
    "audio": (
        "audio", "audiofile", "audiofilename", "audiopath", "file", "filename", "filepath", "wav",
        "wavfile", "wavname", "voicefile", "vofile", "vofilename", "recording", "soundfile",
        "sound", "asset", "path", "voice", "vo",
    ),
    "character": (
        "character", "charactername", "char", "speaker", "speakername", "speakingvoice", "actor",
        "role", "npc", "talker", "who",
    ),
    "language": ("language", "lang", "locale", "culture", "languagecode", "languageid"),
    "text": (
        "text", "transcript", "transcription", "dialogue", "dialog", "dialogueline", "dialogtext",
        "dialoguetext", "spokendialogue", "spokentext", "linetext", "spoken", "script", "subtitle",
        "subtitles", "translation", "target", "string", "source", "sourcetext", "sourcestring",
        "sentence", "content", "line",
    ),
    "notes": (
        "notes", "note", "comment", "comments", "remarks", "direction", "directions",
        "voiceactordirection", "context", "description",
    ),
}  # fmt: skip

PRESET_COLUMNS: Mapping[str, Mapping[str, Sequence[str]]] = {
    # The members of FDialogueScriptEntry, as Unreal's ExportDialogueScript writes them.
    "unreal": {
        "audio": ("audiofilename",),
        "character": ("speakingvoice",),
        "text": ("spokendialogue",),
        "notes": ("voiceactordirection",),
    },
    # What CryENGINE's LocalizedStringsManager reads, newer names before older ones.
    "cryengine": {
        "id": ("key", "audiofilename"),
        "audio": ("audiofilename",),
        "character": ("originalcharactername", "charactername", "person"),
        "text": (
            "translatedactorline", "yourtranslation", "translation", "actorline",
            "originalactorline", "englishdialogue",
        ),
    },
}  # fmt: skip

# A header is looked for in so many rows: titles and dates stand above it.
_HEADER_ROWS = 20


@dataclass
class _Layout:
    """Indices of columns; `texts` and `audios` by language."""

    roles: dict[str, list[int]] = field(default_factory=dict)
    texts: dict[str, int] = field(default_factory=dict)
    audios: dict[str, int] = field(default_factory=dict)

    @property
    def weight(self) -> int:
        """How much of a header the row looks like, 0 if a line could not be told from it."""
        if not self.roles.keys() & {"id", "audio"} and not self.audios:
            return 0
        return len(self.roles) + len(self.texts) + len(self.audios)


def rows_of(tables: Sequence[Table], path: Path, columns: Columns, preset: str) -> Iterator[Row]:
    """The lines in the sheets of one file; sheets without a header of lines are passed over.

    Raises:
        InputError: none has one, or a column that the job names is not there.
    """
    _require_headers(tables, path, columns)
    found = [(table, *_header(table, columns, preset)) for table in tables]
    best = [entry for entry in found if entry[2].weight > 1] or [e for e in found if e[2].weight]
    if not best:
        headers = [", ".join(table.rows[0][1])[:200] for table in tables if table.rows]
        raise InputError(
            "manifest-columns",
            "has no column of ids or recordings; it starts with "
            + ("; ".join(f"'{header}'" for header in headers) or "nothing"),
            place=str(path),
            action="Name its columns in the job's [dialogue.columns].",
        )
    for table, start, layout in best:
        for number, cells in table.rows:
            if number > start:
                sheet = f"{path}:{table.name}" if len(tables) > 1 else str(path)
                yield from _rows(f"{sheet}:{number}", cells, layout)


def _plain(header: str) -> str:
    return re.sub(r"[\W_]+", "", header.casefold())


def _require_headers(tables: Sequence[Table], path: Path, columns: Columns) -> None:
    cells = {
        cell for table in tables for _, row in table.rows[:_HEADER_ROWS] for cell in row if cell
    }
    named = [*columns.roles.values(), *columns.texts.values(), *columns.audios.values()]
    for header in named:
        if _plain(header) not in {_plain(cell) for cell in cells}:
            raise InputError(
                "manifest-columns",
                f"has no column '{header}', which the job names",
                place=str(path),
                action=suggestion(header, sorted(cells)[:40]),
            )


def _header(table: Table, columns: Columns, preset: str) -> tuple[int, _Layout]:
    """Number of the header's row, and what its columns are."""
    best = 0, _Layout()
    for number, cells in table.rows[:_HEADER_ROWS]:
        layout = _layout([_plain(cell) for cell in cells], cells, columns, preset)
        if layout.weight > best[1].weight:
            best = number, layout
    return best


def _layout(plain: Sequence[str], cells: Sequence[str], columns: Columns, preset: str) -> _Layout:
    layout = _Layout()
    aliases = PRESET_COLUMNS.get(preset, ALIASES)
    taken: set[int] = set()

    def take(role: str, names: Sequence[str]) -> None:
        several = [i for name in names for i, p in enumerate(plain) if p == name and i not in taken]
        # A preset's columns stand in for each other row by row; people's have one each.
        several = list(dict.fromkeys(several))[: None if preset else 1]
        if several:
            layout.roles[role] = several
            if not preset:
                taken.update(several)

    for language, header in columns.texts.items():
        if _plain(header) in plain:
            layout.texts[language_tag(language)] = plain.index(_plain(header))
    for language, header in columns.audios.items():
        if _plain(header) in plain:
            layout.audios[language_tag(language)] = plain.index(_plain(header))
    taken |= {*layout.texts.values(), *layout.audios.values()}
    for role, header in columns.roles.items():
        take(role, [_plain(header)])
    for role, names in aliases.items():
        # 'line' may be an id or what is said: an id only where nothing else is.
        if role not in layout.roles and not (role == "text" and layout.texts):
            take(role, names)
    if preset == "":
        _take_languages(layout, plain, cells, taken)
        if "text" not in layout.roles and not layout.texts:
            _spare_line(layout, plain)
    return layout


def _spare_line(layout: _Layout, plain: Sequence[str]) -> None:
    """Take 'line' and 'name' beside a recording for what they say: the text, and who says it."""
    at = layout.roles.get("id", [-1])[0]
    if at >= 0 and plain[at] == "line" and "audio" in layout.roles:
        layout.roles["text"] = layout.roles.pop("id")


def _take_languages(
    layout: _Layout, plain: Sequence[str], cells: Sequence[str], taken: set[int]
) -> None:
    """Columns for one language each: ``en``, ``German``, ``text_fr``, ``Audio (de)``."""
    found: list[tuple[int, str, str]] = []
    for index, cell in enumerate(cells):
        if index in taken or not plain[index]:
            continue
        role, rest = _role_and_rest(cell)
        if rest and len(cell) < 60 and is_common(rest):
            found.append((index, role, find_tag(rest) or ""))
    if len(found) == 1 and cells[found[0][0]].casefold().rstrip(".") == "no":
        return  # a number, and not Norwegian
    for index, role, tag in found:
        (layout.audios if role == "audio" else layout.texts).setdefault(tag, index)


def _role_and_rest(cell: str) -> tuple[str, str]:
    """Role ("text" or "audio"), and what of a header is left without the words that say so."""
    words = [word for word in re.split(r"[^\w]+|_", cell) if word]
    for role in ("audio", "text"):
        for count in (2, 1):
            if len(words) > count:
                for name, rest in (
                    (words[:count], words[count:]),
                    (words[-count:], words[:-count]),
                ):
                    if "".join(name).casefold() in ALIASES[role]:
                        return role, "-".join(rest)
    return "text", cell


def _rows(place: str, cells: Sequence[str], layout: _Layout) -> Iterator[Row]:
    """The line of a row in each language that it has."""

    def cell(index: int) -> str:
        return cells[index] if index < len(cells) else ""

    def said(role: str) -> str:
        return next((value for i in layout.roles.get(role, ()) if (value := cell(i))), "")

    row = Row(
        place,
        said("id"),
        said("audio"),
        said("character"),
        said("language"),
        said("text") if "text" in layout.roles else None,
        said("notes"),
    )
    several = list(dict.fromkeys([*layout.texts, *layout.audios]))
    if "text" in layout.roles or not several:
        yield row
    for tag in several:
        text = cell(layout.texts[tag]) if tag in layout.texts else None
        audio = cell(layout.audios[tag]) if tag in layout.audios else row.audio
        yield Row(place, row.id, audio, row.character, tag, text, row.notes, given=True)
