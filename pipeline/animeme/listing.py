"""From rows of lists to lines on disk."""

from __future__ import annotations

import re
from collections import Counter, defaultdict
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path, PurePosixPath, PureWindowsPath

from animeme.dialogue import AUDIO_SUFFIXES, FILM_SUFFIXES, Line, composed, lines_of_files
from animeme.errors import InputError
from animeme.findings import Finding, Severity
from animeme.languages import find_tag, is_common, language_of_file, language_tag
from animeme.manifest import Manifest, Row
from animeme.recordings import Recordings
from animeme.translations import Translations

_NOT_IN_NAMES = re.compile(r'[\x00-\x1f\x7f:*?"<>|\\]')


@dataclass
class Listing:
    """Lists turned into lines, one row at a time.

    Attributes:
        root: folder where recordings are searched beside each list's own, or None.
        language: of rows that do not say theirs, "" if their paths do.
        translations: texts to join; lists get a line for each of their languages.
        findings: about rows that cannot be used.
    """

    root: Path | None
    language: str
    translations: Translations
    findings: list[Finding] = field(default_factory=list)
    _recordings: Recordings = field(default_factory=Recordings)

    def lines(self, manifests: Sequence[Manifest]) -> tuple[Line, ...]:
        """The lines of all lists, sorted by key; what is listed twice is there once."""
        found: dict[str, list[Line]] = defaultdict(list)
        for manifest in manifests:
            for line in self._lines_of(manifest):
                found[line.key].append(line)
        return tuple(_shared(_once(same) for _, same in sorted(found.items())))

    def _lines_of(self, manifest: Manifest) -> Iterator[Line]:
        named = self._named(manifest)
        # A path for all languages of a row is that of the first at most.
        cells = Counter((row.place, row.audio) for row in named)
        own = {cell for cell, count in cells.items() if count == 1}
        bases = [manifest.path.parent, *manifest.bases]
        bases += [self.root] if self.root is not None else []
        rows = [(row, (row.place, row.audio) in own) for row in named]
        rows += [(row, False) for row in self._translated(named)]
        for row, mine in rows:
            line = self._line(row, bases, mine or row.language == self.language)
            if line is not None:
                yield line

    def _named(self, manifest: Manifest) -> list[Row]:
        """The rows with id and language; a finding for each that cannot have them."""
        rows = []
        fallback = self.language or language_of_file(manifest.path)
        unsaid: list[Row] = []
        for row in manifest.rows:
            try:
                language = language_tag(row.language, place=row.place) if row.language else ""
                language = language or self.language or _language_in(row.audio) or fallback
                if language:
                    rows.append(_identified(replace(row, language=language)))
                else:
                    unsaid.append(row)
            except InputError as error:
                self.findings.append(Finding.from_error(error))
        if unsaid:
            message = f"{len(unsaid)} lines do not say their language"
            action = "Add a column of languages, or `language` to the job's [dialogue]."
            place = unsaid[0].place
            self.findings.append(
                Finding(Severity.ERROR, "language-missing", message, place=place, action=action)
            )
        return rows

    def _translated(self, rows: Sequence[Row]) -> Iterator[Row]:
        """A row for each further language that a line is translated into."""
        there = {(row.character, row.id, self.translations.tag_for(row.language)) for row in rows}
        for row in rows:
            for tag in self.translations.languages:
                if (row.character, row.id, tag) not in there:
                    there.add((row.character, row.id, tag))
                    if self.translations.has(tag, row.id):
                        yield replace(row, language=tag, text=None, given=True)

    def _line(self, row: Row, bases: Sequence[Path], mine: bool) -> Line | None:
        audio = self._recording(row, bases, mine)
        files = self._recordings.beside(audio) if audio is not None else []
        text = row.text
        translated = self.translations.has(row.language, row.id)
        if not text and audio is None and row.given and not translated:
            return None  # it is not in this language
        if audio is None:
            written = _parts(row.audio) or tuple(f"{row.id}.wav".split("/"))
            if not mine:
                written = _in_language(written, row.language)
            audio = (self.root or bases[0]).joinpath(*written)
            if audio.suffix.lower() not in AUDIO_SUFFIXES:
                audio = audio.with_name(f"{audio.name}.wav")
        kept = [
            file
            for file in files
            if file == audio
            or file.suffix.lower() not in AUDIO_SUFFIXES
            or (file.suffix.lower() in FILM_SUFFIXES and audio.suffix.lower() not in FILM_SUFFIXES)
        ]
        made = lines_of_files({(row.language, row.character, row.id): [*map(str, kept)]})
        line = made[0] if made else Line(
            row.id, row.language, row.character, str(audio), str(audio.with_suffix(".txt"))
        )  # fmt: skip
        if text == "" and (line.transcript.is_file() or line.timings_file is not None):
            text = None
        return replace(line, audio_file=str(audio), text=text, origin=row.place)

    def _recording(self, row: Row, bases: Sequence[Path], mine: bool) -> Path | None:
        """The recording of a row, whose path is its own or that of several languages."""
        written = _parts(row.audio)
        names = [written] if written else [tuple(row.id.split("/"))]
        if not written and row.character:
            names.insert(0, (row.character, *names[0]))
        for base in bases:
            for parts in names:
                for path in self._places(base, parts, row.language, mine):
                    found = self._recordings.find(base, path)
                    if found is not None:
                        return found
        return None

    def _places(
        self, base: Path, parts: tuple[str, ...], tag: str, mine: bool
    ) -> Iterator[tuple[str, ...]]:
        """Paths below `base` where the recording may be, the surest first."""
        at = next((i for i, part in enumerate(parts[:-1]) if is_common(part)), None)
        if at is not None and find_tag(parts[at]) != tag:
            folder = base.joinpath(*parts[:at])
            for name in self._recordings.language_folders(folder, tag):
                yield (*parts[:at], name, *parts[at + 1 :])
            # A path that is this row's own is right, whatever its folders are called.
            yield from (parts,) if mine else ()
            return
        if at is None:
            for name in self._recordings.language_folders(base, tag):
                yield (name, *parts)
        if at is not None or mine:
            yield parts


def _identified(row: Row) -> Row:
    """The row with an id and a character that can name files.

    Raises:
        InputError: it has none.
    """
    name = row.id
    if not name:
        parts = _parts(row.audio)
        while parts and parts[0] == "..":
            parts = parts[1:]
        if len(parts) > 1 and find_tag(parts[0]) == row.language:
            parts = parts[1:]
        if len(parts) > 1 and composed(parts[0]) == composed(row.character):
            parts = parts[1:]
        name = "/".join(part for part in parts if part not in ("/", ".."))
    name = composed(name.replace("\\", "/"))
    if name.lower().endswith(AUDIO_SUFFIXES):
        name = name.rpartition(".")[0]
    if not name:
        _refuse(row, "the row has neither id nor recording", "Fill one of them in.")
    for said in (*name.split("/"), *([row.character] if row.character else [])):
        if not said.strip(" .") or _NOT_IN_NAMES.search(said) or len(said.encode()) > 200:
            _refuse(row, f"'{said[:40]}' cannot be the name of a file", "Write another there.")
    if "/" in row.character:
        _refuse(row, f"'{row.character[:40]}' cannot be the name of a file", "Write another there.")
    return replace(row, id=name, character=composed(row.character))


def _refuse(row: Row, problem: str, action: str) -> None:
    raise InputError("manifest-row-unusable", problem, place=row.place, action=action)


def _parts(written: str) -> tuple[str, ...]:
    """A path as a sheet has it, in parts; those of an absolute one start with its root."""
    if not written or "\0" in written:
        return ()
    path = PurePosixPath(written.replace("\\", "/"))
    drive = PureWindowsPath(written).drive
    return tuple(part for part in path.parts if part not in (".", drive))


def _language_in(written: str) -> str:
    """The first folder of a path that is named by language."""
    return next((find_tag(p) or "" for p in _parts(written)[:-1] if is_common(p)), "")


def _in_language(parts: tuple[str, ...], tag: str) -> tuple[str, ...]:
    """A path with its language's folder changed, or with one in front."""
    for index, part in enumerate(parts[:-1]):
        if is_common(part):
            return (*parts[:index], part if find_tag(part) == tag else tag, *parts[index + 1 :])
    return (tag, *parts)


def _once(same: Sequence[Line]) -> Line:
    """One line of those that are listed under one key."""
    if len(same) == 1:
        return same[0]
    alike = len({(line.audio_file, line.text) for line in same}) == 1
    places = ", ".join(line.origin for line in same[:5])
    message = f"is listed {len(same)} times: at {places}"
    severity = Severity.WARNING if alike else Severity.ERROR
    twice = Finding(severity, "line-duplicate", message, action="Keep one of them.")
    return replace(same[0], findings=(*same[0].findings, twice))


def _shared(lines: Iterator[Line]) -> Iterator[Line]:
    """The lines; a warning for each whose recording another line has too."""
    kept = list(lines)
    owners: Mapping[str, list[Line]] = defaultdict(list)
    for line in kept:
        owners[line.audio_file].append(line)
    for line in kept:
        # Several characters may say one line together.
        same = owners[line.audio_file]
        others = [o for o in same if (o.language, o.id) != (line.language, line.id)]
        if others and line.audio.is_file():
            names = ", ".join(other.key for other in others[:3])
            message = f"has the recording of {names} too"
            found = Finding(
                Severity.WARNING,
                "recording-shared",
                message,
                place=line.origin,
                action="Give each line its own recording.",
            )
            line = replace(line, findings=(*line.findings, found))
        yield line
