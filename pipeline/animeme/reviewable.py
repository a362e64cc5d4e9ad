"""What `animeme.reviewing` shows: a run's output folder, or delivered files."""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping, Sequence
from contextlib import suppress
from functools import lru_cache
from pathlib import Path
from typing import Any

from animeme import documents, registry
from animeme.deliveries import seen
from animeme.delivery import StoredReader, StoredTrack
from animeme.dialogue import Line, find_lines, transcript_of
from animeme.errors import AnimemeError, InputError
from animeme.files import anywhere
from animeme.findings import Finding, Severity
from animeme.gathering import gather
from animeme.job import CharacterJob, Job, read_job
from animeme.phones import PhoneTrack
from animeme.review_delivery import DeliveryReview
from animeme.reviewing import (
    DEFAULT_FRAME_HZ,
    Detail,
    Listener,
    Performed,
    Reviewable,
    ReviewedLine,
    WrittenReview,
    moving,
    scores_of,
    write_review,
)
from animeme.validation import DEFAULT_PROFILE

REPORT = "report.json"
# Files of one character in one language that are kept open between lines.
_OPEN_FILES = 4


def open_reviewable(
    path: Path,
    *,
    dialogue: Path | None = None,
    language: str | None = None,
    aligner: str = "pocketsphinx",
    lexicon: Path | None = None,
    rig: str = "auto",
    profile: str = DEFAULT_PROFILE,
) -> Reviewable:
    """A run if `path` is a run's output folder, else the delivered files there.

    Args:
        path: folder or file.
        dialogue: folder of the recordings; a run knows its own.
        language, aligner, lexicon, rig, profile: as for `animeme.validation.validate`; of no
            concern to a run.

    Raises:
        InputError: it is neither.
    """
    if (path / REPORT).is_file():
        return RunReview(path, dialogue)
    return DeliveryReview(
        path, dialogue=dialogue, language=language, aligner=aligner, lexicon=lexicon, rig=rig,
        profile=profile,
    )  # fmt: skip


def review(
    shown: str | Path,
    output: str | Path,
    *,
    lines: Sequence[str] = (),
    worst: int | None = None,
    against: str | Path | None = None,
    dialogue: str | Path | None = None,
    language: str | None = None,
    aligner: str = "pocketsphinx",
    lexicon: str | Path | None = None,
    rig: str = "auto",
    single_file: bool = False,
    listener: Listener = lambda done, total: None,
) -> WrittenReview:
    """Write pages on which a person sees and hears lines, from disk, in any browser.

    Args:
        shown: a run's output folder, an animated file, or a folder of such.
        output: folder to write to.
        lines: globs over ``<language>/<line>`` or ``<line>``: these get a page; all if none.
        worst: only so many of them, the worst.
        against: another run or file, to see and hear beside it.
        dialogue: folder of the recordings; a run knows its own.
        language, aligner, lexicon, rig: as for `open_reviewable`.
        single_file: one page that holds everything.
        listener: told how many pages are done, of how many.

    Raises:
        InputError: there is nothing to be shown, or `output` cannot be written.

    Example:
        >>> import animeme
        >>> animeme.review("out/sample", "review").index  # doctest: +SKIP
        PosixPath('review/index.html')
    """

    def opened(path: str | Path) -> Reviewable:
        return open_reviewable(
            Path(path),
            dialogue=None if dialogue is None else Path(dialogue),
            language=language,
            aligner=aligner,
            lexicon=None if lexicon is None else Path(lexicon),
            rig=rig,
        )

    other = None if against is None else opened(against)
    return write_review(
        opened(shown), Path(output), lines=lines, worst=worst, other=other,
        single_file=single_file, listener=listener,
    )  # fmt: skip


class RunReview:
    """What a run wrote.

    Args:
        folder: its output folder.
        dialogue: folder of the recordings, if not those that the run was given.
    """

    def __init__(self, folder: Path, dialogue: Path | None = None) -> None:
        self._folder = folder
        report = documents.read("report", folder / REPORT)
        self.title = str(report["job"])
        self.findings = tuple(_finding(entry) for entry in report["findings"])
        self._job, self._why = _job_of(folder)
        rate = self._job.curves.frame_rate if self._job else None
        self.frame_hz = float(rate.per_s) if rate is not None else DEFAULT_FRAME_HZ
        names = sorted({entry["character"] for entry in report["lines"]})
        self._recorded = self._lines(dialogue, names)
        self._outputs = {
            (entry["line"], entry["character"]): tuple(entry["outputs"])
            for entry in report["lines"]
        }
        known: dict[str, tuple[float | None, str]] = {}
        lines = []
        for entry in report["lines"]:
            key = entry["line"]
            if key not in known:
                known[key] = _heard_in(self._alignment(key))
            score, words = known[key]
            lines.append(
                ReviewedLine(
                    key,
                    entry["character"],
                    entry["language"],
                    entry["status"],
                    entry["audio_s"],
                    tuple(_finding(found) for found in entry["findings"]),
                    score,
                    words,
                )
            )
        self.lines = tuple(lines)
        self._animations = lru_cache(_OPEN_FILES)(self._read_file)

    def details(self, lines: Sequence[ReviewedLine]) -> Iterator[Detail]:
        """See `animeme.reviewing.Reviewable`."""
        wanted: dict[str, set[str]] = {}
        for line in lines:
            for file in self._outputs[line.key, line.character]:
                wanted.setdefault(file, set()).add(_id_of(line))
        self._animations.cache_clear()
        self._wanted = wanted
        yield from map(self._detail, lines)

    def _detail(self, line: ReviewedLine) -> Detail:
        remarks: list[str] = []
        performed = []
        for file in self._outputs[line.key, line.character]:
            try:
                animations = self._animations(line.character, file)
            except InputError as error:
                remarks.append(f"{file} cannot be shown: {error.problem}.")
                continue
            except Exception as error:  # noqa: BLE001  one bad file costs its own lines the head
                remarks.append(f"{file} cannot be shown: its reader failed ({error}).")
                continue
            if _id_of(line) in animations:
                performed.append(animations[_id_of(line)])
            else:
                remarks.append(f"The head is not shown: {file} does not hold the line any more.")
        recorded = self._recorded.get(line.key)
        audio = self._audio(line.key, recorded)
        if audio is None:
            remarks.append(self._why or "Its recording is not there any more.")
        track = _track_in(self._alignment(line.key))
        text = ""
        if recorded is not None:
            with suppress(InputError):  # the run has said so already
                text = transcript_of(recorded)
        return Detail(text or line.words, audio, track, tuple(performed), tuple(remarks))

    def _lines(self, dialogue: Path | None, names: Sequence[str]) -> dict[str, Line]:
        if dialogue is not None:
            if not dialogue.is_dir():
                raise InputError(
                    "dialogue-missing", "there is no such folder", place=str(dialogue),
                    action="Name the folder of recordings: <language>/<line>.wav with .txt beside.",
                )  # fmt: skip
            self._why = ""
            return {line.key: line for line in find_lines(dialogue, names)}
        if self._job is None:
            return {}
        try:
            found = gather(self._job.dialogue, names, without=self._job.output)
        except (AnimemeError, OSError) as error:
            self._why = f"The run's dialogue cannot be read ({error}): name it with --dialogue."
            return {}
        return {line.key: line for line in found.lines}

    def _audio(self, key: str, line: Line | None) -> Path | None:
        spoken = self._folder / "speech" / f"{key}.wav"
        if line is not None and line.audio.is_file():
            return line.audio
        return spoken if spoken.is_file() else None

    def _alignment(self, key: str) -> Path:
        return self._folder / "alignments" / f"{key}.json"

    def _read_file(self, character: str, file: str) -> Mapping[str, Performed]:
        path = self._folder / file
        own = self._character(character)
        if own is not None and own.layout in ("animation-only", "vrma"):
            return self._read_clip(own, path, file)
        return _performed_in(path, file, self._wanted[file])

    def _character(self, name: str) -> CharacterJob | None:
        characters = self._job.characters if self._job else ()
        return next((character for character in characters if character.name == name), None)

    def _read_clip(self, own: CharacterJob, path: Path, file: str) -> Mapping[str, Performed]:
        """A file of animation alone is shown on the asset that it was made for."""
        found = {}
        for asset in own.assets:
            form = registry.format_of(asset)
            try:
                character = form.load(asset, within=anywhere(asset))
                clip = form.for_layout(own.layout, character)
            except InputError:
                continue
            if clip.output_suffix(asset) != path.suffix:
                continue
            lead_s = self._job.curves.preroll_s if self._job else 0.0
            for name, curves in clip.read_animations(path).items():
                shapes = moving(curves, character.rest_weights())
                found[name] = Performed(file, path, name, asset, shapes, lead_s)
            break
        return found


def _job_of(folder: Path) -> tuple[Job | None, str]:
    """The job of a run, or why it is not known."""
    log = folder / "run.jsonl"
    try:
        with log.open(encoding="utf-8") as stream:
            started = json.loads(stream.readline())
        return read_job(Path(started["file"]), check=False), ""
    except (OSError, ValueError, KeyError):
        return None, "The run does not say where its recordings are: name them with --dialogue."
    except AnimemeError as error:
        return None, f"The run's job cannot be read ({error}): name recordings with --dialogue."


def _performed_in(path: Path, file: str, names: set[str]) -> Mapping[str, Performed]:
    """What a file plays under some names."""
    form = registry.format_of(path)
    character = form.load(path, within=anywhere(path))
    rest = character.rest_weights()
    if not isinstance(form, StoredReader):
        return {
            name: Performed(file, path, name, path, moving(curves, rest))
            for name, curves in form.read_animations(path).items()
        }
    tracks: dict[str, list[StoredTrack]] = {}
    for track in form.stored(character, names):
        if track.sound:
            name = str(track.note.get("line", track.animation))
            tracks.setdefault(name, []).append(track)
    found = {}
    for name, own in tracks.items():
        lead_s = float(own[0].note.get("audio_start_s", 0.0))
        shapes = moving(seen(own, rest), rest)
        found[name] = Performed(file, path, own[0].animation, path, shapes, lead_s)
    return found


def _id_of(line: ReviewedLine) -> str:
    """The id of a run's line, which is its animation's name."""
    bare = line.key.removeprefix(f"{line.language}/")
    return bare.removeprefix(f"{line.character}/")


def _finding(entry: Mapping[str, Any]) -> Finding:
    return Finding(**{**entry, "severity": Severity.parse(entry["severity"])})


def _heard_in(path: Path) -> tuple[float | None, str]:
    """Score of the worst phone of an alignment, and its words; read raw, for there are many."""
    try:
        data = json.loads(path.read_bytes())
        scores = scores_of((phone["symbol"], phone.get("score")) for phone in data["phones"])
        return min(scores, default=None), " ".join(word["text"] for word in data["words"])
    except (OSError, ValueError, KeyError, TypeError):
        return None, ""


def _track_in(path: Path) -> PhoneTrack | None:
    try:
        return PhoneTrack.from_document(documents.read("alignment", path))
    except (InputError, ValueError):
        return None
