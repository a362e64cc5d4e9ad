"""A folder of ``<id>.<audio>``, ``<id>.txt``, ``<id>.csv`` and perhaps ``<id>.TextGrid``."""

from __future__ import annotations

from collections import Counter, defaultdict
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from fnmatch import fnmatchcase
from pathlib import Path

import numpy as np

from animeme import registry
from animeme.contracts import Alignment
from animeme.curves import Floats
from animeme.dataset import CapturedLine, Dataset, Listener, no_listener
from animeme.dialogue import AUDIO_SUFFIXES, TEXT_SUFFIXES, TIMING_SUFFIXES, shown
from animeme.errors import InputError
from animeme.executors import Executor
from animeme.executors.inline import InlineExecutor
from animeme.findings import Finding, Severity
from animeme.phones import SILENCE, PhoneTrack
from animeme_stages.dataset.motion import Motion, read_motion

# Longer than any line takes to align on a loaded machine.
_TIMEOUT_S = 300.0
# Motion that goes on for longer than this after its recording may belong to another one.
_OVERHANG_S = 0.5


@dataclass(frozen=True)
class _Item:
    """One line to read, for a worker."""

    id: str
    audio: Path | None
    transcript: Path | None
    timings: Path | None
    motion: Path | None
    doubled: str
    language: str
    aligner: str
    lexicon: Path | None
    rate_hz: float | None


@dataclass(frozen=True, eq=False)
class _Read:
    """What became of one line."""

    id: str
    track: PhoneTrack | None
    motion: Motion | None
    findings: tuple[Finding, ...]


def read_dataset(
    folder: Path,
    *,
    language: str = "en",
    aligner: str = "pocketsphinx",
    lexicon: Path | None = None,
    rate_hz: float | None = None,
    controls: Sequence[str] = (),
    executor: Executor | None = None,
    listener: Listener = no_listener,
) -> Dataset:
    """Read every line of a dataset; a line that cannot be used becomes a finding.

    Args:
        folder: holds the lines, in folders of its own too.
        language: BCP-47 tag of what is spoken.
        aligner: finds the phones where there is no TextGrid.
        lexicon: pronunciations that go before the aligner's own.
        rate_hz: frames per second of motion that counts frames.
        controls: names, or patterns such as ``mouth*``, of the controls to keep; () keeps all.
        executor: reads lines in parallel.
        listener: told of progress.

    Raises:
        InputError: there is no such folder, or not one line in it can be used.
    """
    items = _items(folder, language, aligner, lexicon, rate_hz)
    if executor is None:
        executor = InlineExecutor()
    read: dict[int, _Read] = {}
    function = f"{read_line.__module__}:{read_line.__qualname__}"
    for result in executor.run(function, items, timeout_s=_TIMEOUT_S, retries=1):
        item = items[result.index]
        read[result.index] = result.value or _Read(item.id, None, None, (_died(item, result),))
        listener("lines", len(read) / len(items))
    done = [read[index] for index in range(len(items))]
    return _dataset(folder, done, controls)


def _items(
    folder: Path, language: str, aligner: str, lexicon: Path | None, rate_hz: float | None
) -> list[_Item]:
    if not folder.is_dir():
        raise InputError(
            "dataset-missing", "there is no such folder", place=str(folder),
            action="Name a folder of <id>.wav, <id>.txt and <id>.csv.",
        )  # fmt: skip
    groups: dict[str, dict[str, list[Path]]] = defaultdict(lambda: defaultdict(list))
    kinds = {
        **dict.fromkeys(AUDIO_SUFFIXES, "audio"),
        **dict.fromkeys(TEXT_SUFFIXES, "text"),
        **dict.fromkeys(TIMING_SUFFIXES, "timings"),
        ".csv": "motion",
    }
    for file in sorted(folder.rglob("*")):
        relative = file.relative_to(folder)
        kind = kinds.get(file.suffix.lower())
        if kind and file.is_file() and not any(part.startswith(".") for part in relative.parts):
            groups[shown(relative.with_suffix("").as_posix())][kind].append(file)
    if not any("motion" in found for found in groups.values()):
        raise InputError(
            "dataset-empty", "holds no captured motion (<id>.csv)", place=str(folder),
            action="Put <id>.csv, with time_s and a column per control, beside each recording.",
        )  # fmt: skip
    items = []
    for name, found in sorted(groups.items()):
        first = {kind: files[0] for kind, files in found.items()}
        doubled = ", ".join(f.name for files in found.values() if len(files) > 1 for f in files)
        items.append(
            _Item(
                name, first.get("audio"), first.get("text"), first.get("timings"),
                first.get("motion"), doubled, language, aligner, lexicon, rate_hz,
            )
        )  # fmt: skip
    return items


def read_line(item: _Item) -> _Read:
    """Read and align one line; everything wrong with it becomes a finding."""
    findings = list(_missing(item))
    track, motion = None, None
    if not findings:
        assert item.motion is not None
        try:
            motion = read_motion(item.motion, rate_hz=item.rate_hz)
            alignment = _aligned(item)
            track = alignment.track
            # That timings were given is no news in a dataset.
            noted = [f for f in alignment.findings if f.severity > Severity.INFO]
            findings += [*motion.findings, *noted]
        except InputError as error:
            findings.append(Finding.from_error(error))
    return _Read(item.id, track, motion, tuple(replace(f, line=item.id) for f in findings))


def _missing(item: _Item) -> Iterator[Finding]:
    def found(code: str, message: str, action: str) -> Finding:
        return Finding(Severity.WARNING, code, message, action=action)

    if item.doubled:
        yield found("line-duplicate", f"has several files: {item.doubled}", "Keep one of each.")
    elif item.audio is None:
        yield found("dataset-no-audio", "there is no recording", "Add it, or drop the line.")
    elif item.motion is None:
        yield found("dataset-no-motion", "there is no captured motion", "Add <id>.csv.")
    elif item.transcript is None and item.timings is None:
        yield found("dataset-no-text", "there is no transcript", "Add <id>.txt or <id>.TextGrid.")


def _aligned(item: _Item) -> Alignment:
    assert item.audio is not None
    speech = registry.stage("read-speech")(item.audio)
    if item.timings is not None:
        alignment: Alignment = registry.stage("read-timings")(
            item.timings, speech, language=item.language
        )
        return alignment
    text: str = registry.stage("read-transcript")(item.transcript)
    return registry.aligner(item.aligner).align(
        speech, text, language=item.language, lexicon=item.lexicon
    )


def _died(item: _Item, result: object) -> Finding:
    return Finding(
        Severity.ERROR, "line-failed", f"reading it failed: {getattr(result, 'error', '')}"[:500],
        line=item.id, action="Please report it.", ours=True,
    )  # fmt: skip


def _dataset(folder: Path, read: Sequence[_Read], patterns: Sequence[str]) -> Dataset:
    """Lines with the same columns, in one order, and everything that was found."""
    findings = [finding for line in read for finding in line.findings]
    usable = [r for r in read if r.track is not None and r.motion is not None]
    counts: Counter[str] = Counter()
    for line in usable:
        assert line.motion is not None
        counts.update(name for name in line.motion.controls if _wanted(name, patterns))
    order = list(counts)
    if usable and not order:
        raise InputError(
            "dataset-controls", f"no control matches {', '.join(patterns)}", place=str(folder),
            action="Look at the header of one of its CSV files.",
        )  # fmt: skip
    lines = []
    for line in usable:
        captured, noted = _captured(line, order)
        findings += noted
        if captured is not None:
            lines.append(captured)
    if not lines:
        raise InputError(
            "dataset-empty",
            "not one line can be used"
            + (f"; the first: {findings[0].message}" if findings else ""),
            place=findings[0].place or str(folder) if findings else str(folder),
            action=findings[0].action if findings else "Add lines.",
        )
    findings += _partial(counts, len(usable))
    kept, still = _moving(lines, order)
    if still:
        findings.append(
            Finding(
                Severity.INFO, "dataset-control-still",
                f"controls that never move are left out: {', '.join(still)}",
            )
        )  # fmt: skip
    if not kept:
        raise InputError(
            "dataset-empty", "no control moves in any line", place=str(folder),
            action="Check what the CSV files hold.",
        )  # fmt: skip
    columns = [order.index(name) for name in kept]
    lines = [replace(line, values=line.values[:, columns]) for line in lines]
    return Dataset(tuple(kept), tuple(lines), tuple(findings))


def _wanted(name: str, patterns: Sequence[str]) -> bool:
    return not patterns or any(fnmatchcase(name, pattern) for pattern in patterns)


def _captured(line: _Read, order: Sequence[str]) -> tuple[CapturedLine | None, list[Finding]]:
    assert line.track is not None
    assert line.motion is not None
    motion, end_s = line.motion, line.track.duration_s
    inside = (motion.times_s >= 0) & (motion.times_s <= end_s)
    findings = []
    if motion.times_s[-1] > end_s + _OVERHANG_S or motion.times_s[0] > end_s:
        findings.append(
            Finding(
                Severity.WARNING, "motion-overhang",
                f"motion goes on to {motion.times_s[-1]:.2f} s, the recording to {end_s:.2f} s",
                line=line.id, action="Check that both are of the same take.",
            )
        )  # fmt: skip
    values = np.full((int(inside.sum()), len(order)), np.nan)
    for column, name in enumerate(order):
        if name in motion.controls:
            values[:, column] = motion.values[inside, motion.controls.index(name)]
    if inside.sum() < 2 or not np.isfinite(values).any():
        message = "less than two frames were captured during the recording"
        action = "Check that both are of the same take."
        findings.append(
            Finding(Severity.WARNING, "motion-outside", message, line=line.id, action=action)
        )
        return None, findings
    if all(phone.symbol == SILENCE for phone in line.track.phones):
        findings.append(
            Finding(Severity.INFO, "dataset-line-silent", "nothing is said in it", line=line.id)
        )
    return CapturedLine(line.id, line.track, motion.times_s[inside], values), findings


def _partial(counts: Counter[str], lines: int) -> Iterator[Finding]:
    """Controls that some lines lack: learned from the others, and said."""
    for name, count in counts.items():
        if count < lines:
            yield Finding(
                Severity.WARNING, "dataset-control-partial",
                f"'{name}' is missing in {lines - count} of {lines} lines",
                action="It is learned from the others; check its spelling.",
            )  # fmt: skip


def _moving(lines: Sequence[CapturedLine], order: Sequence[str]) -> tuple[list[str], list[str]]:
    values: Floats = np.concatenate([line.values for line in lines])
    moving: list[str] = []
    still: list[str] = []
    for column, name in enumerate(order):
        known = values[np.isfinite(values[:, column]), column]
        (moving if len(known) and np.ptp(known) > 0 else still).append(name)
    return moving, still
