"""Recorded lines on disk."""

from __future__ import annotations

import os
import unicodedata
from collections import defaultdict
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from operator import attrgetter
from os.path import basename, splitext
from pathlib import Path

from animeme import registry
from animeme.errors import InputError
from animeme.files import walk
from animeme.findings import Finding, Severity
from animeme.languages import find_tag, language_tag

FILM_SUFFIXES = (".m4a", ".mp4", ".mov")  # with the extra `video`
AUDIO_SUFFIXES = (".wav", ".flac", ".mp3", ".ogg", ".opus", ".aiff", ".aif", *FILM_SUFFIXES)
TEXT_SUFFIXES = (".txt", ".lab")
TIMING_SUFFIXES = (".textgrid", ".eaf", ".vtt", ".srt", ".ctm", ".marks")
# Timings, or somebody else's; a .lab is timings or a transcript.
UNSURE_SUFFIXES = (".json", ".jsonl", ".tsv")
# Files of these kinds alone are no line: a folder may hold subtitles and lists of many things.
ABOUT_SUFFIXES = (".eaf", ".vtt", ".srt", ".ctm", ".marks", *UNSURE_SUFFIXES)
_SUFFIXES = frozenset(AUDIO_SUFFIXES + TEXT_SUFFIXES + TIMING_SUFFIXES + UNSURE_SUFFIXES)


@dataclass(frozen=True)
class SideCar:
    """A file by hand beside a recording.

    Attributes:
        kind: "curves" or "edits".
        path: the file.
        character: for whom alone it is, "" for everybody who speaks the line.
    """

    kind: str
    path: Path
    character: str


@dataclass(frozen=True, slots=True)
class Line:
    """One recording in one language. There may be a million: paths are kept as text.

    Attributes:
        id: path below the language (and character) folder, without suffix; ``/`` separates. As a
            sheet has it where one lists the line.
        language: BCP-47 tag of the folder's name, which may be ``English(US)``; the name itself if
            it is no language.
        character: whose line it is, "" for every character of the job.
        audio_file: the recording.
        transcript_file: file of its text; it need not be there if `text` is.
        timings_file: phones or words that somebody has already timed, or None.
        findings: what its discovery noticed.
        side_cars: curves and edits by hand, those for everybody first.
        text: what is said, where a sheet or a translation has it; it goes before `transcript`.
        origin: where `text`, or a sheet's row about the line, is to be found; "" for files alone.
    """

    id: str
    language: str
    character: str
    audio_file: str
    transcript_file: str
    timings_file: str | None = None
    findings: tuple[Finding, ...] = ()
    side_cars: tuple[SideCar, ...] = ()
    text: str | None = None
    origin: str = ""

    @property
    def audio(self) -> Path:
        """The recording."""
        return Path(self.audio_file)

    @property
    def transcript(self) -> Path:
        """The file of its text."""
        return Path(self.transcript_file)

    @property
    def timings(self) -> Path | None:
        """What somebody has already timed, or None."""
        return None if self.timings_file is None else Path(self.timings_file)

    def files_of(self, kind: str, character: str, *, alone: bool = False) -> tuple[Path, ...]:
        """Files by hand of one kind that concern a character, those for everybody first.

        Args:
            kind: "curves" or "edits".
            character: its name, "" for everybody.
            alone: leave out those for everybody.
        """
        whose = {character} if alone else {"", character}
        return tuple(c.path for c in self.side_cars if c.kind == kind and c.character in whose)

    @property
    def key(self) -> str:
        """``<language>/<id>``, or ``<language>/<character>/<id>`` for one character's line."""
        if self.language and self.id and not self.character:  # most lines, and asked for often
            return f"{self.language}/{self.id}"
        return "/".join(part for part in (self.language, self.character, self.id) if part)


def has_transcript(line: Line) -> bool:
    """Whether anything says what is said in a line."""
    return line.text is not None or line.transcript.is_file()


def transcript_of(line: Line) -> str:
    """What is said in a line.

    Raises:
        InputError: there is no transcript, or it cannot be read.
    """
    if line.text is None:
        text: str = registry.stage("read-transcript")(line.transcript)
        return text
    if not line.text.strip():
        raise InputError(
            "transcript-empty",
            "the line has no text",
            place=line.origin,
            action="Write what is said there, or into a .txt beside the recording.",
        )
    return line.text.strip()


def find_lines(
    root: Path, characters: Iterable[str], *, without: Path | None = None
) -> tuple[Line, ...]:
    """Lines below ``root/<language>/[character/]``, sorted by key.

    A recording without transcript is a line, and so is a transcript without recording: what is
    missing shows when it is read. Timings of another tool beside a recording are its own; whether a
    file that may be something else has any, its content tells (the stage ``timings-kind``). A first
    folder that bears the name of a character belongs to it; any other folder becomes part of the
    line's id. A character's own recording takes the place of one for all of the same language and
    id.

    Args:
        root: the dialogue folder.
        characters: names of the job's characters.
        without: a folder that is left out.
    """
    known = {composed(name): name for name in characters}
    groups: Groups = defaultdict(list)
    for folder in sorted(entry for entry in root.iterdir() if entry.is_dir()):
        language = find_tag(folder.name) or folder.name
        for place, names in _places_below(folder, root, without):
            parts = place.relative_to(folder).parts
            character = known.get(composed(parts[0]), "") if parts else ""
            start = "".join(f"{part}/" for part in (parts[1:] if character else parts))
            above = os.path.join(place, "")
            for name in names:
                stem = composed(start + name.rpartition(".")[0])
                groups[language, character, stem].append(f"{above}{name}")
    return lines_of_files(groups)


def find_lines_of(root: Path, language: str, *, without: Path | None = None) -> tuple[Line, ...]:
    """Lines below a folder whose recordings are all in one language, sorted by key.

    As `find_lines` has them, but every folder becomes part of the line's id.

    Args:
        root: the folder.
        language: BCP-47 tag.
        without: a folder that is left out.
    """
    groups: Groups = defaultdict(list)
    for file in files_below(root, root, without):
        name = composed(file.relative_to(root).with_suffix("").as_posix())
        groups[find_tag(language) or language, "", name].append(str(file))
    return lines_of_files(groups)


def folders_with_lines(root: Path, *, without: Path | None = None) -> tuple[tuple[str, ...], ...]:
    """Folders below `root` that have recordings or transcripts, as the parts of their paths.

    () is among them if `root` has some of its own.
    """
    spoken = AUDIO_SUFFIXES + TEXT_SUFFIXES
    places = (
        file.relative_to(root).parts[:-1]
        for file in files_below(root, root, without)
        if file.suffix.lower() in spoken
    )
    return tuple(sorted(set(places)))


def files_below(folder: Path, root: Path, without: Path | None) -> Iterator[Path]:
    """Files that may belong to a line; nothing hidden below `root`, nothing below `without`."""
    for place, names in _places_below(folder, root, without):
        yield from (place / name for name in names)


def _places_below(
    folder: Path, root: Path, without: Path | None
) -> Iterator[tuple[Path, list[str]]]:
    """As `files_below`, by the folder that they are in."""
    hidden = any(part.startswith(".") for part in folder.relative_to(root).parts)
    if hidden or (without is not None and folder.is_relative_to(without)):
        return
    for place, names in walk(str(folder), without="" if without is None else str(without)):
        wanted = [name for name in names if suffix_of(name) in _SUFFIXES]
        if wanted:
            yield Path(place), wanted


def suffix_of(name: str) -> str:
    """The suffix of a file that is not hidden, in small letters; quicker than a path's."""
    _, dot, tail = name.rpartition(".")
    return f".{tail.lower()}" if dot and "/" not in tail else ""


Groups = dict[tuple[str, str, str], list[str]]
"""(language, character, id) → files."""


def lines_of_files(groups: Groups) -> tuple[Line, ...]:
    """The lines that files are about, sorted by key; the groups are used up."""
    lines = []
    while groups:
        key, files = groups.popitem()
        line = _line(*key, files)
        lines += [line] if line is not None else []
    lines.sort(key=attrgetter("key"))
    return tuple(lines)


def _line(language: str, character: str, name: str, files: list[str]) -> Line | None:
    """The line that `files` are about; None if they are about something else."""
    suffixes = [suffix_of(file) for file in files]
    if all(suffix in ABOUT_SUFFIXES for suffix in suffixes):
        return None
    kinds: dict[str, list[str]] = defaultdict(list)
    for file, suffix in zip(files, suffixes, strict=True):
        kinds[_KINDS.get(suffix) or kind_of(Path(file))].append(file)
    # A film beside a recording is what the line looks like, not a second recording.
    sounds = [file for file in kinds["audio"] if not file.lower().endswith(FILM_SUFFIXES)]
    audio, texts = sounds or kinds["audio"], kinds["text"]
    # Mouth shapes cannot be used; where there is nothing else, whoever reads them says so.
    timings = kinds["timings"] or kinds["mouth shapes"][:1]
    findings = []
    named = (("recordings", audio), ("transcripts", texts), ("files of timings", timings))
    for kind, found in named:
        if len(found) > 1:
            names = ", ".join(shown(basename(file)) for file in found)
            message = f"has {len(found)} {kind}: {names}"
            action = "Keep one of them."
            findings.append(Finding(Severity.ERROR, "line-duplicate", message, action=action))
    if shown(name) != name:
        message, action = "its file name is not UTF-8", "Rename it."
        findings.append(Finding(Severity.ERROR, "line-name-unreadable", message, action=action))
    if find_tag(language) is None:
        try:
            language_tag(shown(language))
        except InputError as error:
            findings.append(Finding.from_error(error))
    return Line(
        shown(name),
        shown(language),
        character,
        audio[0] if audio else f"{splitext(files[0])[0]}.wav",
        texts[0] if texts else f"{splitext(files[0])[0]}.txt",
        timings[0] if timings else None,
        tuple(findings),
    )


def voice_of(voices: Path | None, line: Line) -> Path | None:
    """The voice that says a line, None if nobody learned it.

    Args:
        voices: a folder of voices (see `voice_path`), one voice for all lines, or None.
        line: the line.
    """
    if voices is None or voices.is_file():
        return voices
    path = voice_path(voices, line.language, line.character)
    return path if path.is_file() else None


def voice_path(voices: Path, language: str, character: str) -> Path:
    """Where the voice is that says a character's lines in a language.

    ``<language>/<character>.voice``; ``<language>.voice`` for lines that are no character's own.
    """
    folder = voices / language if character else voices
    return folder / f"{character or language}.voice"


_KINDS = {".txt": "text", **dict.fromkeys(AUDIO_SUFFIXES, "audio")}
"""What a suffix tells by itself; most files' do."""


def kind_of(file: Path) -> str:
    """What a file is to its line: "audio", "text", "timings", "mouth shapes" or "other".

    The file is opened only if its suffix leaves this open.
    """
    suffix = file.suffix.lower()
    if suffix in AUDIO_SUFFIXES:
        return "audio"
    if suffix in TIMING_SUFFIXES:
        return "timings"
    told = "text" if suffix in TEXT_SUFFIXES else "other"
    # The name may be no file's but a sentence, and too long for the file system.
    if suffix in (".lab", *UNSURE_SUFFIXES) and os.path.isfile(file):
        found: str = registry.stage("timings-kind")(file)
        return told if found == "other" else found
    return told


def composed(name: str) -> str:
    """A name in composed form (NFC): file systems differ in the one that they keep."""
    return name if name.isascii() else unicodedata.normalize("NFC", name)


def shown(name: str) -> str:
    """A file name as it can be written down: bytes that are not UTF-8 become escapes."""
    return name if name.isascii() else os.fsencode(name).decode("utf-8", "backslashreplace")


def is_spoken(line: Line, speak: bool, recorded: bool) -> bool:
    """Whether a program speaks the line."""
    return speak and line.timings_file is None and not recorded
