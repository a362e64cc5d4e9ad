"""Reading curves that somebody drew, recorded or changed."""

from __future__ import annotations

import zipfile
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from animeme import documents
from animeme.curves import CurveSet, Floats
from animeme.errors import InputError
from animeme.files import unreadable
from animeme.findings import Finding, Severity
from animeme.timing import FrameRate
from animeme_stages.dataset.motion import LARGEST_BYTES, read_motion

_ACTION = "Export the curves again."
# What NumPy says to a file that is cut, forged, or made of pickles.
_DAMAGE = (AttributeError, EOFError, MemoryError, TypeError, ValueError, zipfile.BadZipFile)


def read_curves(
    path: Path, *, frame_rate: FrameRate | None = None
) -> tuple[CurveSet, tuple[Finding, ...]]:
    """Read a curve file: CSV (plain or Live Link Face's), ``animeme.curves/1`` JSON, or NPZ.

    A cell without a value means that this curve has no key there: it goes on in a straight line.

    Args:
        path: the file; its suffix tells what it is.
        frame_rate: of time codes, and of files that count frames.

    Returns:
        The curves in the file's own time, and what a person should know.

    Raises:
        InputError: the file is damaged, its times are missing or out of order, or a value is no
            number.
    """
    suffix = path.suffix.lower()
    if suffix == ".json":
        return _document(path), ()
    if suffix == ".npz":
        return _arrays(path), ()
    try:
        motion = read_motion(path, all_shapes=True, frame_rate=frame_rate)
    except InputError as error:
        if error.code != "motion-rate":
            raise
        action = "Say it in the job: [curves] frame_rate = 24, for example."
        raise InputError(error.code, error.problem, place=error.place, action=action) from None
    filled = [_without_gaps(motion.times_s, column) for column in motion.values.T]
    kept = [i for i, column in enumerate(filled) if column is not None]
    empty = [name for i, name in enumerate(motion.controls) if i not in kept]
    if not kept:
        raise InputError(
            "curves-empty", "has no value in any of its columns", place=str(path), action=_ACTION
        )
    curves = CurveSet(
        motion.times_s,
        tuple(motion.controls[i] for i in kept),
        np.array([filled[i] for i in kept]).T,
    )
    return curves, tuple(_remarks(path, [f.message for f in motion.findings], empty))


def _remarks(path: Path, noted: list[str], empty: list[str]) -> Iterator[Finding]:
    for message in noted:  # NaN in a capture is a gap; in curves by hand it is a mistake
        yield Finding(
            Severity.WARNING, "curves-nan", f"{message}: bridged in a straight line",
            place=str(path), action="Leave a cell empty where there is no key.",
        )  # fmt: skip
    if empty:
        yield Finding(
            Severity.WARNING, "curves-column-empty",
            f"columns without a single value: {', '.join(empty)}",
            place=str(path), action="Fill them, or take them out.",
        )  # fmt: skip


def _without_gaps(times_s: Floats, column: Floats) -> Floats | None:
    there = np.isfinite(column)
    if not there.any():
        return None
    filled: Floats = np.interp(times_s, times_s[there], column[there])
    return filled


def _document(path: Path) -> CurveSet:
    document = documents.read("curves", path)
    try:
        return CurveSet.from_document(document)
    except ValueError as error:
        raise _broken(path, str(error)) from error


def _arrays(path: Path) -> CurveSet:
    """Arrays ``times_s`` (T,), ``names`` (N,) and ``weights`` (T, N)."""
    try:
        if path.stat().st_size > LARGEST_BYTES:
            raise _broken(path, f"is larger than {LARGEST_BYTES >> 20} MB")
        with path.open("rb") as stream, np.load(stream, allow_pickle=False) as data:
            missing = {"times_s", "names", "weights"} - set(data.files)
            if missing:
                raise _broken(path, f"has no array {', '.join(sorted(missing))}")
            names = tuple(str(name) for name in data["names"].reshape(-1))
            return CurveSet(data["times_s"], names, data["weights"])
    except OSError as error:
        if error.errno is None:  # not the disk's: numpy's word for a file of another kind
            raise _broken(path, "is no NPZ file") from error
        raise unreadable(path, "curves-unreadable", error) from error
    except (
        AttributeError,
        EOFError,
        MemoryError,
        TypeError,
        ValueError,
        zipfile.BadZipFile,
    ) as error:
        raise _broken(path, str(error)) from error


def _broken(path: Path, problem: str) -> InputError:
    problem = problem.splitlines()[0].rstrip(".") if problem else "is damaged"
    return InputError("curves-broken", problem, place=str(path), action=_ACTION)
