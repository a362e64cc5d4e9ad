"""Lists of lines: what a sheet says of each, before anybody has looked for the recordings."""

from __future__ import annotations

import os
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from animeme import documents, registry
from animeme.dialogue import Line, has_transcript, transcript_of
from animeme.errors import InputError
from animeme.files import unreadable


@dataclass(frozen=True)
class Row:
    """One line in one language, as a sheet has it; "" stands for what it does not say.

    Attributes:
        place: file and row, for messages.
        id: the line's id.
        audio: path of its recording, relative to the sheet; any separators.
        character: who says it.
        language: a tag or name.
        text: what is said; None if the sheet has no texts, "" if this one is empty.
        notes: for people.
        given: the language was said for this text alone, by its column: where the text is empty,
            the line may not exist in that language.
    """

    place: str
    id: str = ""
    audio: str = ""
    character: str = ""
    language: str = ""
    text: str | None = None
    notes: str = ""
    given: bool = False


@dataclass(frozen=True)
class Manifest:
    """A list of lines.

    Attributes:
        path: the file.
        rows: in its order.
        bases: folders beside its own at which its paths may start.
    """

    path: Path
    rows: tuple[Row, ...]
    bases: tuple[Path, ...] = ()


@dataclass(frozen=True)
class Columns:
    """What a sheet's columns are called, where nobody could guess it.

    Attributes:
        roles: "id", "audio", "character", "language", "text" or "notes" → header.
        texts, audios: language → header.
    """

    roles: Mapping[str, str] = field(default_factory=dict)
    texts: Mapping[str, str] = field(default_factory=dict)
    audios: Mapping[str, str] = field(default_factory=dict)


PRESETS = ("cryengine", "fmod", "unreal", "wwise")
"""Kinds of lists that other programs write."""


def read_manifest(path: Path, columns: Columns, preset: str = "") -> Manifest:
    """The lines that a file lists: an ``animeme.manifest/1`` document, or another program's.

    Args:
        path: the file; its suffix says what it is, if there is no preset.
        columns: of a sheet.
        preset: one of `PRESETS`, "" for sheets that people write.

    Raises:
        InputError: it cannot be read, or nobody can tell which column is what.
    """
    if not path.is_file():
        raise InputError(
            "manifest-missing",
            "there is no such list of lines",
            place=str(path),
            action="Check the name; paths in a job start at the job file.",
        )
    try:
        if path.suffix.lower() == ".json":
            return Manifest(path, tuple(_document_rows(path)))
        made: Manifest = registry.stage("read-manifest")(path, columns, preset)
    except OSError as error:
        raise unreadable(path, "manifest-unreadable", error) from error
    return made


def _document_rows(path: Path) -> Iterable[Row]:
    document = documents.read("manifest", path)
    for number, entry in enumerate(document["lines"]):
        yield Row(f"{path}:lines.{number}", **{**entry, "text": entry["text"]})


def manifest_document(lines: Iterable[Line], folder: Path) -> dict[str, Any]:
    """An ``animeme.manifest/1`` document of lines.

    Args:
        lines: what was found, whatever it was found in.
        folder: where the document will be; its paths start there.
    """
    return {"schema": "animeme.manifest/1", "lines": [_entry(line, folder) for line in lines]}


def _entry(line: Line, folder: Path) -> dict[str, Any]:
    text: str | None = None
    try:
        text = transcript_of(line) if has_transcript(line) else None
    except InputError:
        text = ""  # whoever uses the line is told
    try:
        audio = Path(os.path.relpath(line.audio.absolute(), folder.absolute())).as_posix()
    except ValueError:  # on another drive
        audio = line.audio.absolute().as_posix()
    return {
        "id": line.id,
        "audio": audio,
        "character": line.character,
        "language": line.language,
        "text": text,
        "notes": "",
    }
