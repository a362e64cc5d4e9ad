"""Writing curves for other tools."""

from __future__ import annotations

import csv
import json
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from animeme.curves import CurveSet
from animeme.errors import InputError
from animeme.files import atomic_path, write_text
from animeme.findings import Finding, Severity
from animeme.rig import BoundRig
from animeme.timing import FrameRate
from animeme_stages.curve_files import live_link

SUFFIXES = {"csv": ".csv", "json": ".json", "livelink-csv": ".livelink.csv", "npz": ".npz"}


def curve_files() -> dict[str, str]:
    """Kinds of curve files, each with the suffix that it gets."""
    return dict(SUFFIXES)


def write_curves(
    curves: CurveSet,
    path: Path,
    kind: str,
    *,
    rig: BoundRig | None = None,
    frame_rate: FrameRate | None = None,
) -> tuple[Finding, ...]:
    """Write curves to `path`, atomically.

    Args:
        curves: over a character's shapes.
        path: the file.
        kind: "csv", "json", "livelink-csv" or "npz".
        rig: tells which of the shapes is which of ARKit's, for Live Link.
        frame_rate: frames of Live Link; 60 a second if None. The others keep the keys they get.

    Returns:
        What a person should know.

    Raises:
        InputError: the file cannot be written, or no curve is one of ARKit's.
        ValueError: there is no such kind.
    """
    match kind:
        case "csv":
            _write_csv(path, _plain_rows(curves))
        case "json":
            document = json.dumps(curves.to_document(), ensure_ascii=False, indent=1)
            write_text(path, document + "\n")
        case "npz":
            _write_npz(path, curves)
        case "livelink-csv":
            return _write_live_link(path, curves, rig, frame_rate or live_link.APP_RATE)
        case _:
            raise ValueError(f"there is no kind of curve file {kind!r}")
    return ()


def _plain_rows(curves: CurveSet) -> list[list[str]]:
    rows = [["time_s", *curves.names]]
    for time_s, weights in zip(curves.times_s, curves.weights, strict=True):
        rows.append([repr(float(time_s)), *map(live_link.number, weights)])
    return rows


def _write_csv(path: Path, rows: Sequence[Sequence[str]]) -> None:
    with atomic_path(path) as scratch, scratch.open("w", encoding="utf-8", newline="") as stream:
        csv.writer(stream, lineterminator="\n").writerows(rows)


def _write_npz(path: Path, curves: CurveSet) -> None:
    with atomic_path(path) as scratch, scratch.open("wb") as stream:
        np.savez(
            stream, times_s=curves.times_s, names=np.array(curves.names, str),
            weights=curves.weights,
        )  # fmt: skip


def _write_live_link(
    path: Path, curves: CurveSet, rig: BoundRig | None, rate: FrameRate
) -> tuple[Finding, ...]:
    columns = live_link.columns_of(curves, rig)
    moving = [name for i, name in enumerate(curves.names) if curves.weights[:, i].any()]
    if not columns and moving:
        raise InputError(
            "curves-not-arkit",
            "not one of its shapes is ARKit's, and Live Link Face has no others",
            place=str(path),
            action='Export "csv", "json" or "npz" for this character.',
        )
    _write_csv(path, live_link.rows(curves, columns, rate))
    left_out = [name for name in moving if name not in columns]
    if not left_out:
        return ()
    return (
        Finding(
            Severity.INFO,
            "curves-left-out",
            f"Live Link Face has no column for {', '.join(left_out)}",
            place=str(path),
        ),
    )
