"""Recorded lines on disk."""

from __future__ import annotations

import os
import unicodedata
from collections import defaultdict
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path

from animeme.findings import Finding, Severity

FILM_SUFFIXES = (".m4a", ".mp4", ".mov")  # with the extra `video`
AUDIO_SUFFIXES = (".wav", ".flac", ".mp3", ".ogg", ".opus", ".aiff", ".aif", *FILM_SUFFIXES)
TEXT_SUFFIXES = (".txt", ".lab")
TIMING_SUFFIXES = (".textgrid",)


@dataclass(frozen=True)
class Line:
    """One recording in one language.

    Attributes:
        id: path below the language (and character) folder, without suffix; ``/`` separates.
        language: the folder's name, a BCP-47 tag.
        character: whose line it is, "" for every character of the job.
        audio: the recording.
        transcript: its text.
        timings: phones that somebody has already timed, used instead of aligning, or None.
        findings: what its discovery noticed.
    """

    id: str
    language: str
    character: str
    audio: Path
    transcript: Path
    timings: Path | None = None
    findings: tuple[Finding, ...] = ()

    @property
    def key(self) -> str:
        """``<language>/<id>``, or ``<language>/<character>/<id>`` for one character's line."""
        return "/".join(part for part in (self.language, self.character, self.id) if part)


def find_lines(root: Path, characters: Iterable[str]) -> tuple[Line, ...]:
    """Lines below ``root/<language>/[character/]``, sorted by key.

    A recording without transcript is a line, and so is a transcript without recording: what is
    missing shows when it is read. A Praat TextGrid beside a recording has its timings. A first
    folder that bears the name of a character belongs to it; any other folder becomes part of the
    line's id. A character's own recording takes the place of one for all of the same language and
    id.

    Args:
        root: the dialogue folder.
        characters: names of the job's characters.
    """
    known = {_composed(name): name for name in characters}
    groups: dict[tuple[str, str, str], list[Path]] = defaultdict(list)
    for folder in sorted(entry for entry in root.iterdir() if entry.is_dir()):
        for file in sorted(folder.rglob("*")):
            relative = file.relative_to(folder)
            hidden = any(part.startswith(".") for part in file.relative_to(root).parts)
            known_suffix = file.suffix.lower() in AUDIO_SUFFIXES + TEXT_SUFFIXES + TIMING_SUFFIXES
            if hidden or not known_suffix:
                continue
            if not file.is_file():
                continue
            parts = relative.with_suffix("").parts
            character = known.get(_composed(parts[0]), "") if len(parts) > 1 else ""
            name = _composed("/".join(parts[1:] if character else parts))
            groups[folder.name, character, name].append(file)
    lines = [_line(*key, files) for key, files in groups.items()]
    return tuple(sorted(lines, key=lambda line: line.key))


def _line(language: str, character: str, name: str, files: list[Path]) -> Line:
    audio = [file for file in files if file.suffix.lower() in AUDIO_SUFFIXES]
    # A film beside a recording is what the line looks like, not a second recording.
    audio = [file for file in audio if file.suffix.lower() not in FILM_SUFFIXES] or audio
    texts = [file for file in files if file.suffix.lower() in TEXT_SUFFIXES]
    findings = []
    timings = [file for file in files if file.suffix.lower() in TIMING_SUFFIXES]
    named = (("recordings", audio), ("transcripts", texts), ("files of timings", timings))
    for kind, found in named:
        if len(found) > 1:
            message = f"has {len(found)} {kind}: {', '.join(shown(file.name) for file in found)}"
            action = "Keep one of them."
            findings.append(Finding(Severity.ERROR, "line-duplicate", message, action=action))
    if shown(name) != name:
        message, action = "its file name is not UTF-8", "Rename it."
        findings.append(Finding(Severity.ERROR, "line-name-unreadable", message, action=action))
    return Line(
        shown(name),
        shown(language),
        character,
        audio[0] if audio else files[0].with_suffix(".wav"),
        texts[0] if texts else files[0].with_suffix(".txt"),
        timings[0] if timings else None,
        tuple(findings),
    )


def _composed(name: str) -> str:
    """A name in composed form (NFC): file systems differ in the one that they keep."""
    return unicodedata.normalize("NFC", name)


def shown(name: str) -> str:
    """A file name as it can be written down: bytes that are not UTF-8 become escapes."""
    return os.fsencode(name).decode("utf-8", "backslashreplace")
