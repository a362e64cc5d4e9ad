"""All lines of a dialogue, wherever they are listed, and what does not fit together."""

from __future__ import annotations

import os
from collections import defaultdict
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

from animeme import affixes
from animeme.dialogue import AUDIO_SUFFIXES, Line, composed, files_below, find_lines
from animeme.documents import suggestion
from animeme.findings import Finding, Severity
from animeme.listing import Listing
from animeme.manifest import PRESETS, Columns, read_manifest
from animeme.translations import read_translations

# A finding about many lines names so many of them.
_NAMED = 3


@dataclass(frozen=True)
class DialogueSource:
    """Where lines come from: a folder, lists, or both.

    Attributes:
        root: folder of recordings, or None.
        manifests: lists of lines.
        columns: of sheets, where nobody could guess them.
        preset: one of `animeme.manifest.PRESETS`, "prefix", "suffix" or "".
        texts: translations to join by id.
        language: tag of what does not say its own, or "".
    """

    root: Path | None
    manifests: tuple[Path, ...] = ()
    columns: Columns = field(default_factory=Columns)
    preset: str = ""
    texts: tuple[Path, ...] = ()
    language: str = ""

    @property
    def files(self) -> tuple[Path, ...]:
        """Lists and translations, which a run reads beside the lines' own files."""
        return (*self.manifests, *self.texts)


@dataclass(frozen=True)
class Dialogue:
    """What was found.

    Attributes:
        lines: sorted by key.
        findings: about rows that are no line, and what the lines lack together.
        folder: below which all recordings are, or should be; None if nothing was found.
    """

    lines: tuple[Line, ...]
    findings: tuple[Finding, ...]
    folder: Path | None


def gather(
    source: DialogueSource,
    characters: Iterable[str] | None = None,
    *,
    without: Path | None = None,
) -> Dialogue:
    """Find the lines of a dialogue. Nothing is read but names, lists and translations.

    Args:
        source: where they come from.
        characters: names of a job's characters; lines of others are left out. None keeps all.
        without: a folder that is left out.

    Raises:
        InputError: a list or translation cannot be used.
    """
    names = tuple(characters or ())
    translations = read_translations(source.texts, source.language)
    findings: list[Finding] = []
    folder = source.root
    if without is not None and folder is not None:  # a folder around the lines' is none of theirs
        whole = Path(os.path.abspath(without))
        inside = whole != (root := Path(os.path.abspath(folder))) and whole.is_relative_to(root)
        without = folder / whole.relative_to(root) if inside else None
    if source.manifests:
        preset = source.preset if source.preset in PRESETS else ""
        manifests = [read_manifest(path, source.columns, preset) for path in source.manifests]
        listing = Listing(source.root, source.language, translations)
        lines = listing.lines(manifests)
        findings += listing.findings
        folder = folder or _common_folder(lines)
        if folder is not None:
            findings += _surplus(folder, lines, without)
        if characters is not None:
            lines, strangers = _known(lines, names)
            findings += strangers
    elif source.root is None:
        lines = ()
    elif source.preset == "prefix" or source.preset == "suffix":
        where: affixes.Where = "prefix" if source.preset == "prefix" else "suffix"
        lines, left = affixes.find_affixed(
            source.root, where, names, language=source.language, without=without
        )
        findings += left
    else:
        lines = find_lines(source.root, names, without=without)
    lines, idle = translations.joined(lines)
    findings += idle
    listed = bool(source.manifests)
    findings += _missing_languages(lines, Severity.WARNING if listed else Severity.INFO)
    return Dialogue(lines, tuple(dict.fromkeys(findings)), folder)


def _known(lines: Sequence[Line], names: Sequence[str]) -> tuple[tuple[Line, ...], list[Finding]]:
    """The lines of the job's characters, spelt as the job does; a remark on each other's."""
    by_name = {composed(name).casefold(): name for name in names}
    exact = {composed(name): name for name in names}
    kept: list[Line] = []
    others: dict[str, list[Line]] = defaultdict(list)
    for line in lines:
        name = exact.get(line.character) or by_name.get(line.character.casefold())
        if name is not None or not line.character:
            kept.append(replace(line, character=name or ""))
        else:
            others[line.character].append(line)
    findings = [
        Finding(
            Severity.INFO,
            "character-unknown",
            f"{len(theirs)} lines are of '{name}', whom the job does not have: {_named(theirs)}",
            place=theirs[0].origin,
            action=suggestion(name, names),
        )
        for name, theirs in sorted(others.items())
    ]
    return tuple(sorted(kept, key=lambda line: line.key)), findings


def _common_folder(lines: Sequence[Line]) -> Path | None:
    """The folder that all recordings are in which are there."""
    folders = {line.audio.parent for line in lines if line.audio.is_file()}
    try:
        return Path(os.path.commonpath(folders)) if folders else None
    except ValueError:  # on several drives
        return None


def _surplus(folder: Path, lines: Sequence[Line], without: Path | None) -> Iterator[Finding]:
    """A warning for each folder with recordings that no list has."""
    stems = {os.path.splitext(os.path.abspath(line.audio_file))[0] for line in lines}
    idle: dict[Path, list[str]] = defaultdict(list)
    for file in files_below(folder, folder, without):
        stem, suffix = os.path.splitext(os.path.abspath(file))
        if suffix.lower() in AUDIO_SUFFIXES and stem not in stems:
            idle[file.parent].append(file.name)
    for place, names in sorted(idle.items()):
        shown = ", ".join(names[:_NAMED]) + (" …" if len(names) > _NAMED else "")
        yield Finding(
            Severity.WARNING,
            "recording-surplus",
            f"{len(names)} recordings are in no list: {shown}",
            place=str(place),
            action="Add a row for each, or take them away.",
        )


def _missing_languages(lines: Sequence[Line], severity: Severity) -> Iterator[Finding]:
    """A remark on each language that lacks lines which others have."""
    have: Mapping[str, set[tuple[str, str]]] = defaultdict(set)
    for line in lines:
        have[line.language].add((line.character, line.id))
    everything = set().union(*have.values())
    for tag in sorted(have):
        lacking = sorted(everything - have[tag])
        if lacking:
            names = ["/".join(part for part in key if part) for key in lacking]
            shown = ", ".join(names[:_NAMED]) + (" …" if len(names) > _NAMED else "")
            others = ", ".join(sorted(have.keys() - {tag}))
            yield Finding(
                severity,
                "line-language-missing",
                f"{len(lacking)} of {len(everything)} lines are in {others} and not in {tag}: "
                f"{shown}",
                place=tag,
                action="Record them, or say that nobody needs them.",
            )


def _named(lines: Sequence[Line]) -> str:
    return ", ".join(line.key for line in lines[:_NAMED]) + (" …" if len(lines) > _NAMED else "")
