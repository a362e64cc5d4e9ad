"""From the paths on a command line to what checks see of the files there."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from animeme import registry
from animeme.aligning import lines_below
from animeme.contracts import Alignment, Format, Speech
from animeme.curves import CurveSet, interpolate
from animeme.delivery import (
    Deliveries,
    Delivery,
    Performance,
    StoredReader,
    StoredTrack,
    Take,
)
from animeme.dialogue import Line, find_lines
from animeme.errors import InputError
from animeme.files import anywhere
from animeme.rig import BoundRig, Character
from animeme.steps import Means, align_speech

# A character whose file has no face is no delivery of ours to judge; a file that was named is.
NO_FACE = "asset-no-blendshapes"
READER_FAILED = "reader-failed"


def read_deliveries(
    paths: Sequence[Path],
    *,
    against: Path | None,
    dialogue: Path | None,
    names: Mapping[str, str],
    rig: str,
    language: str | None,
    aligner: str,
    lexicon: Path | None,
) -> tuple[Deliveries, list[tuple[Path, str]]]:
    """Everything that is to be judged, and the files of folders that have no face, with why.

    Arguments and errors are those of `animeme.validation.validate`; `names` maps animations to
    ``<language>/<line>``.
    """
    files = find_files(paths)
    sources = [] if against is None else [file for file, _ in find_files([against])]
    delivered = {file.resolve() for file, _ in files}
    sources = [file for file in sources if file.resolve() not in delivered]
    stems = {file.stem for file, _ in files}
    takes = {}
    if dialogue is not None:
        takes = read_takes(dialogue, stems, language, aligner, lexicon)
    found, unread = [], []
    for file, named in files:
        delivery = _delivery(file, _source_of(file, sources), rig)
        if delivery.error is not None and delivery.error.code == NO_FACE and not named:
            unread.append((file, delivery.error.problem))
            continue
        performances = _performances(delivery, takes, names)
        found.append(replace(delivery, performances=tuple(performances)))
    return Deliveries(tuple(found), takes), unread


def find_files(paths: Iterable[Path]) -> list[tuple[Path, bool]]:
    """Every file of a known format, sorted, and whether it was named itself.

    Raises:
        InputError: a path does not exist, or a folder holds no such file.
    """
    suffixes = {
        suffix
        for name in registry.plugins(registry.FORMATS)
        for suffix in registry.format_named(name).suffixes
    }
    found: dict[Path, bool] = {}
    for path in paths:
        if not path.exists():
            raise InputError(
                "asset-missing", "does not exist", place=str(path), action="Check the path."
            )
        if not path.is_dir():
            found[path] = True
            continue
        inside = [
            file
            for file in sorted(path.rglob("*"))
            if file.suffix.lower() in suffixes
            and not any(part.startswith(".") for part in file.relative_to(path).parts)
            and file.is_file()
        ]
        if not inside:
            raise InputError(
                "delivery-empty",
                "has no asset in it",
                place=str(path),
                action=f"Looked for {', '.join(sorted(suffixes))}.",
            )
        for file in inside:
            found.setdefault(file, False)
    return sorted(found.items())


def _source_of(file: Path, sources: Sequence[Path]) -> Path | None:
    """The source that a file was made from: the only one, or that of the same name."""
    same = [s for s in sources if s.stem == file.stem]
    exact = [s for s in same if s.suffix.lower() == file.suffix.lower()]
    if exact or same:
        return (exact or same)[0]
    return sources[0] if len(sources) == 1 else None


def read_takes(
    dialogue: Path,
    stems: Iterable[str],
    language: str | None,
    aligner: str = "pocketsphinx",
    lexicon: Path | None = None,
) -> dict[str, Take]:
    """The lines of a dialogue folder by key.

    Args:
        dialogue: ``<language>/[character/]<line>.<audio>``, or any folder in one `language`.
        stems: names of the characters' files, which are those of their folders.
        language: BCP-47 tag of the whole folder; None for that of each folder.
        aligner: a registered aligner.
        lexicon: pronunciations that go before the aligner's own.

    Raises:
        InputError: there are no lines, or their language is not clear or not known.
    """
    if not dialogue.is_dir():
        raise InputError(
            "dialogue-missing", "there is no such folder", place=str(dialogue),
            action="Name the folder of recordings: <language>/<line>.wav with .txt beside.",
        )  # fmt: skip
    lines = lines_below(dialogue, language, aligner)
    if language is None and all(key == line.key for key, line in lines.items()):
        lines = {line.key: line for line in find_lines(dialogue, sorted(stems))}
    read = registry.stage("read-speech")
    align = partial(_align, Means(aligner, lexicon, None))
    return {line.key: Take(line, read, align) for line in lines.values()}


def _align(means: Means, line: Line, speech: Speech) -> Alignment:
    def text() -> str:
        said: str = registry.stage("read-transcript")(line.transcript)
        return said

    words = None if line.timings is not None and not line.transcript.is_file() else text
    return align_speech(speech, words, line.timings, language=line.language, means=means)


def _delivery(path: Path, source: Path | None, rig: str) -> Delivery:
    size = path.stat().st_size
    form: Format | None = None
    try:
        form = registry.format_of(path)
        character = form.load(path, within=anywhere(path))
        tracks = tracks_of(form, character) if isinstance(form, StoredReader) else ()
        original = (
            None
            if source is None
            else registry.format_of(source).load(source, within=anywhere(source))
        )
    except InputError as error:
        return Delivery(path, size, form, error=error)
    except Exception as error:  # noqa: BLE001  a reader's fault must not end the others' judging
        said = f"its reader failed: {type(error).__name__}: {error}"
        failed = InputError(READER_FAILED, said, place=str(path), action="Please report it.")
        return Delivery(path, size, form, error=failed)
    bound, why = _bound(rig, character)
    if not isinstance(form, StoredReader):
        tracks = tracks_of(form, character)
    return Delivery(path, size, form, character, bound, why, tracks, source=original)


def tracks_of(form: Format, character: Character) -> tuple[StoredTrack, ...]:
    """The weight animations of a character's file, in file order.

    Raises:
        InputError: they cannot be read.
    """
    if isinstance(form, StoredReader):
        return tuple(form.stored(character))
    return tuple(
        StoredTrack(name, name, curves.names, curves.times_s, curves.weights)
        for name, curves in form.read_animations(character.source).items()
    )


def _bound(rig: str, character: Character) -> tuple[BoundRig | None, str]:
    try:
        bound: BoundRig = registry.stage("bind-rig")(rig, character, Path())
    except InputError as error:
        if error.code != "rig-unknown":
            raise
        return None, error.problem
    return bound, ""


def _performances(
    delivery: Delivery, takes: Mapping[str, Take], names: Mapping[str, str]
) -> Iterator[Performance]:
    """The animations of a file that can be played, but those that its source came with."""
    if delivery.character is None:
        return
    theirs = delivery.source.animations if delivery.source is not None else ()
    by_name: dict[str, list[StoredTrack]] = {}
    for track in delivery.tracks:
        if track.note or track.animation not in theirs:
            by_name.setdefault(track.animation, []).append(track)
    rest = delivery.character.rest_weights()
    for name, tracks in by_name.items():
        sound = [track for track in tracks if track.sound]
        if not sound:
            continue
        note = next((track.note for track in tracks if track.note), {})
        line, language, take = _line_of(name, note, delivery.path, takes, names)
        yield Performance(
            delivery.path,
            name,
            line,
            language,
            _owner(tracks[0].place),
            seen(sound, rest),
            tuple(tracks),
            delivery.rig,
            rest,
            take,
            _seconds(note.get("audio_start_s")) or 0.0,
            _seconds(note.get("duration_s")),
        )


def _owner(place: str) -> str:
    """The animation that a channel belongs to."""
    return place.partition("/channels/")[0]


def _seconds(value: Any) -> float | None:
    number = isinstance(value, int | float) and not isinstance(value, bool)
    return float(value) if number and np.isfinite(value) else None


def _line_of(
    name: str,
    note: Mapping[str, Any],
    path: Path,
    takes: Mapping[str, Take],
    names: Mapping[str, str],
) -> tuple[str, str, Take | None]:
    """Line, language and take of an animation: by mapping, by our note, by its name."""
    if name in names:
        key = names[name]
        return key, key.split("/")[0], takes.get(key)
    if "line" in note and "language" in note:
        language, line = str(note["language"]), str(note["line"])
        own = takes.get(f"{language}/{path.stem}/{line}")
        key = f"{language}/{line}"
        return key, language, own or takes.get(key)
    languages = {take.line.language for take in takes.values()}
    folders = [part for part in path.parts[:-1] if part in languages]
    matching = [
        (key, take)
        for key, take in takes.items()
        if _is_called(name, take.line)
        and take.line.character in ("", path.stem)
        and (not folders or take.line.language == folders[-1])
    ]
    own_first = sorted(matching, key=lambda entry: entry[1].line.character == "")
    if len({take.line.language for _, take in matching}) == 1:
        key, take = own_first[0]
        return key, take.line.language, take
    return name, folders[-1] if folders else "", None


def _is_called(name: str, line: Line) -> bool:
    """Whether an animation has a line's name, as exporters spell it."""
    flat = line.id.replace("/", "_")
    last = line.id.rpartition("/")[2]
    said = {line.id, flat, last}
    said |= {f"{entry}_{line.language}" for entry in said}
    said |= {f"{line.language}_{entry}" for entry in (flat, last)} | {line.key}
    return name.casefold() in {entry.casefold() for entry in said}


def seen(tracks: Sequence[StoredTrack], rest: Mapping[str, float]) -> CurveSet:
    """What is seen of all shapes; the first track that has a shape decides.

    Args:
        tracks: at least one, all of them sound.
        rest: canonical shape → weight when nothing drives it; other shapes are left out.
    """
    played = [track.played or (track.times_s, track.weights) for track in tracks]
    times_s = np.unique(np.concatenate([entry[0] for entry in played]))
    weights = {name: np.full(len(times_s), weight) for name, weight in rest.items()}
    done: set[str] = set()
    for track, (keys_s, values) in zip(tracks, played, strict=True):
        sampled = interpolate(keys_s, values, times_s)
        for column, shape in enumerate(track.shapes):
            if shape in rest and shape not in done:
                weights[shape] = sampled[:, column]
                done.add(shape)
    return CurveSet(times_s, tuple(weights), np.stack(list(weights.values()), axis=1))
