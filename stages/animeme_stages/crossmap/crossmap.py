"""Landmarks in, a dataset of a character's controls out."""

from __future__ import annotations

import os
import shutil
from collections import defaultdict
from collections.abc import Iterator, Sequence
from pathlib import Path

import numpy as np

from animeme.crossmapping import CrossMapping
from animeme.curves import Floats
from animeme.dialogue import AUDIO_SUFFIXES, TEXT_SUFFIXES, TIMING_SUFFIXES
from animeme.errors import InputError
from animeme.files import unwritable, write_text
from animeme.findings import Finding, Severity
from animeme_stages.crossmap.head import read_head
from animeme_stages.crossmap.mapping import Mapped, Settings, map_takes
from animeme_stages.crossmap.tracks import Take, read_takes

_BESIDE = (*AUDIO_SUFFIXES, *TEXT_SUFFIXES, *TIMING_SUFFIXES)
_WORST = 10


def crossmap(
    landmarks: Path,
    character: Path,
    output: Path,
    *,
    lines: Path | None,
    rate_hz: float | None,
    keys: str,
    symmetric: bool,
    depth: float,
    ridge: float,
) -> CrossMapping:
    """See `animeme.crossmapping.crossmap`."""
    source = landmarks if landmarks.is_dir() else landmarks.parent
    _require_own(output, [source] if landmarks.suffix.lower() != ".npz" else [], lines)
    takes, findings = read_takes(landmarks, rate_hz=rate_hz)
    settings = Settings(depth=depth, ridge=ridge, symmetric=symmetric, keys=keys)
    mapped = map_takes(takes, read_head(character), settings, str(landmarks))
    ends = np.cumsum([len(take.times_s) for take in takes])
    files, residuals = {}, {}
    for take, end in zip(takes, ends, strict=True):
        part = slice(int(end) - len(take.times_s), int(end))
        if np.isfinite(mapped.residual[part]).sum() < 2:
            findings.append(
                Finding(
                    Severity.WARNING, "landmarks-lost",
                    "has less than two frames with all points of lips and head", line=take.id,
                    action="Track it again, or drop it.",
                )
            )  # fmt: skip
            continue
        files[take.id] = output / f"{take.id}.csv"
        write_text(files[take.id], _table(take, mapped, mapped.values[part]))
        residuals[take.id] = float(np.nanmean(mapped.residual[part]))
    if lines is not None:
        findings += _link(lines, output, sorted(files))
    worst = sorted(residuals, key=lambda name: (-residuals[name], name))[:_WORST]
    return CrossMapping(
        mapped.controls, files, len(mapped.values), int(np.isnan(mapped.residual).sum()),
        mapped.keys, float(np.nanmean(mapped.key_residual)), float(np.nanmean(mapped.residual)),
        {name: residuals[name] for name in worst}, tuple(findings),
    )  # fmt: skip


def _require_own(output: Path, sources: Sequence[Path], lines: Path | None) -> None:
    """Raise InputError if writing to `output` could replace what was captured."""
    if lines is not None and not lines.is_dir():
        raise InputError(
            "lines-missing", "there is no such folder", place=str(lines),
            action="Name the folder of recordings and transcripts.",
        )  # fmt: skip
    for folder in (*sources, *([lines] if lines is not None else [])):
        if output.exists() and folder.exists() and output.samefile(folder):
            raise InputError(
                "output-unwritable", "is where landmarks or recordings are", place=str(output),
                action="Name a folder of its own: <id>.csv could replace theirs.",
            )  # fmt: skip
    if output.exists() and not output.is_dir():
        raise InputError(
            "output-unwritable", "is a file", place=str(output), action="Name a folder."
        )


def _table(take: Take, mapped: Mapped, values: Floats) -> str:
    """The CSV of one take; a frame in which points were lost is a gap."""
    rows = [",".join(("time_s", *mapped.controls))]
    for time_s, weights in zip(take.times_s, values, strict=True):
        cells = ("" if np.isnan(weight) else f"{weight:.4f}" for weight in weights)
        rows.append(",".join((f"{time_s:.6f}".rstrip("0").rstrip("."), *cells)))
    return "\n".join(rows) + "\n"


def _link(lines: Path, output: Path, names: Sequence[str]) -> Iterator[Finding]:
    """Recordings, transcripts and timings beside the curves: links, or copies where none go."""
    found: dict[str, list[Path]] = defaultdict(list)
    for file in sorted(lines.rglob("*")):
        if file.suffix.lower() in _BESIDE and file.is_file():
            found[file.stem].append(file)
    for name in names:
        suffixes = [file.suffix.lower() for file in found[name]]
        if not any(suffix in AUDIO_SUFFIXES for suffix in suffixes):
            yield Finding(
                Severity.WARNING, "dataset-no-audio", "there is no recording to link", line=name,
                action="Add it, or drop the line.",
            )  # fmt: skip
        for file in found[name]:
            target = output / file.name
            try:
                if target.is_symlink():
                    target.unlink()
                if target.exists():
                    continue
                try:
                    target.symlink_to(os.path.relpath(file.resolve(), output.resolve()))
                except OSError:  # a file system without links
                    shutil.copyfile(file, target)
            except OSError as error:
                raise unwritable(target, error) from error
