"""Landmark tracks in files: NumPy archives of many takes, and CSV files of one take each.

CSV: ``x_0, y_0, z_0 …``, or ``X_0, Y_0, Z_0 …`` as OpenFace writes its points in space, and times
in ``time_s``, ``timestamp`` or ``frame``. An empty cell, or NaN, is a point that was lost.
"""

from __future__ import annotations

import csv
import math
import re
import zipfile
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from animeme.curves import Floats
from animeme.errors import InputError
from animeme.files import unreadable
from animeme.findings import Finding

LARGEST_BYTES = 2**31
_SECONDS = ("time_s", "timestamp", "time", "seconds", "t")
_COLUMN = re.compile(r"([xyzXYZ])_(\d+)")


@dataclass(frozen=True, eq=False)
class Take:
    """The tracked points of one take.

    Attributes:
        id: its name.
        times_s: shape (F,), strictly increasing.
        ids: P distinct numbers of points.
        points: shape (F, P, 3) in any unit, NaN where a point was lost; z is 0 where only the
            picture's plane was tracked.
    """

    id: str
    times_s: Floats
    ids: tuple[int, ...]
    points: Floats

    def of(self, numbers: Sequence[int]) -> Floats:
        """Some of the points, shape (F, len(numbers), 3)."""
        return self.points[:, [self.ids.index(number) for number in numbers]]


def read_takes(
    path: Path, *, rate_hz: float | None = None
) -> tuple[tuple[Take, ...], list[Finding]]:
    """All takes of a file, or of a folder of CSV files, sorted by id.

    Args:
        path: an ``.npz``, a ``.csv``, or a folder.
        rate_hz: frames per second, where the file does not say.

    Returns:
        The takes, and what is wrong with those files of a folder that cannot be used.

    Raises:
        InputError: no landmarks can be read; says what is missing or where it breaks.
    """
    if path.is_dir():
        files = sorted(path.glob("*.csv"))
        if not files:
            raise _invalid(path, "holds no CSV file", "Name a folder of <id>.csv, or an .npz.")
        return _read_folder(files, rate_hz)
    if path.suffix.lower() not in (".npz", ".csv"):
        raise _invalid(path, "is neither .npz nor .csv", "Export the landmarks as one of them.")
    try:
        if path.stat().st_size > LARGEST_BYTES:
            raise _invalid(path, "is larger than 2 GB", "Cut it into several files.")
        if path.suffix.lower() == ".csv":
            return (_read_csv(path, rate_hz),), []
        return _read_npz(path, rate_hz), []
    except OSError as error:
        raise unreadable(path, "landmarks-unreadable", error) from error


def _read_folder(
    files: Sequence[Path], rate_hz: float | None
) -> tuple[tuple[Take, ...], list[Finding]]:
    takes: list[Take] = []
    errors: list[InputError] = []
    for file in files:
        try:
            take = _read_csv(file, rate_hz)
            if takes and take.ids != takes[0].ids:
                action = "Track all takes with the same points."
                raise _invalid(file, f"has other points than {takes[0].id}.csv", action)
            takes.append(take)
        except InputError as error:
            errors.append(error)
    if not takes:
        raise errors[0]
    return tuple(takes), [Finding.from_error(error) for error in errors]


def _invalid(path: Path | str, problem: str, action: str) -> InputError:
    return InputError("landmarks-invalid", problem, place=str(path), action=action)


def _read_npz(path: Path, rate_hz: float | None) -> tuple[Take, ...]:
    try:
        # No pickles: no code runs from a file.
        with path.open("rb") as stream, np.load(stream, allow_pickle=False) as archive:
            found = {name: archive[name] for name in archive.files}
    except (ValueError, EOFError, KeyError, AttributeError, zipfile.BadZipFile) as error:
        raise _invalid(
            path, f"is not a NumPy archive of numbers ({error})", "Save it with numpy.savez."
        ) from error
    name = next((n for n in ("landmarks_px", "landmarks") if n in found), None)
    lacking = [n for n in ("clip_ids", "landmark_ids") if n not in found]
    if name is None or lacking:
        raise _invalid(
            path, f"has no {', '.join(lacking) if name else 'landmarks'}",
            "Save landmarks (takes, frames, points, 2 or 3), clip_ids and landmark_ids.",
        )  # fmt: skip
    points, clips, ids = found[name], found["clip_ids"], found["landmark_ids"]
    shape = points.shape
    if points.ndim != 4 or shape[3] not in (2, 3) or points.dtype.kind not in "fiu":
        raise _invalid(
            path, f"{name} has shape {shape} of {points.dtype}",
            "It must be numbers of shape (takes, frames, points, 2 or 3).",
        )  # fmt: skip
    if clips.shape != shape[:1] or ids.shape != shape[2:3] or ids.dtype.kind not in "iu":
        raise _invalid(
            path, f"{name} has shape {shape}, clip_ids {clips.shape}, landmark_ids {ids.shape}",
            "Give one clip id per take, and one whole number per point.",
        )  # fmt: skip
    rate = float(found["rate_hz"]) if found.get("rate_hz", np.ones(2)).size == 1 else rate_hz
    if rate is None or not math.isfinite(rate) or rate <= 0:
        raise _invalid(path, "does not say its frames per second", "Say --motion-rate-hz.")
    times_s = np.arange(shape[1]) / rate
    names = [str(clip) for clip in clips]
    if len(set(names)) != len(names):
        raise _invalid(path, "has two takes of one name", "Give each a clip id of its own.")
    takes = [_take(path, n, times_s, ids, p) for n, p in zip(names, points, strict=True)]
    return tuple(sorted(takes, key=lambda take: take.id))


def _read_csv(path: Path, rate_hz: float | None) -> Take:
    try:
        with path.open(encoding="utf-8-sig", newline="") as stream:
            rows = [row for row in csv.reader(stream, strict=True) if any(c.strip() for c in row)]
    except OSError as error:
        raise unreadable(path, "landmarks-unreadable", error) from error
    except (UnicodeDecodeError, csv.Error) as error:
        raise _invalid(path, f"is not CSV ({error})", "Export the landmarks again.") from error
    header = [cell.strip() for cell in rows[0]] if rows else []
    lower = [name.lower() for name in header]
    time = next((lower.index(name) for name in _SECONDS if name in lower), None)
    unit = 1.0
    if time is None and "frame" in lower:
        if rate_hz is None:
            raise _invalid(path, "counts frames, and no rate is given", "Say --motion-rate-hz.")
        time, unit = lower.index("frame"), 1.0 / rate_hz
    if time is None:
        raise _invalid(path, "has no column of times", "Name the column of seconds time_s.")
    at = {m.groups(): i for i, name in enumerate(header) if (m := _COLUMN.fullmatch(name))}
    # OpenFace has both x_0 (pixels) and X_0 (millimetres in space); the latter have depth.
    axes = "XYZ" if any(axis == "Z" for axis, _ in at) else "xyz"
    ids = sorted({int(number) for axis, number in at if axis == axes[0]})
    flat = not any(axis == axes[2] for axis, _ in at)
    wanted = [(axis, str(number)) for number in ids for axis in (axes[:2] if flat else axes)]
    lacking = [f"{axis}_{number}" for axis, number in wanted if (axis, number) not in at]
    if not ids or lacking:
        raise _invalid(
            path, f"lacks column {lacking[0]}" if lacking else "has no columns x_<point>",
            "Give each point x_<number>, y_<number> and perhaps z_<number>.",
        )  # fmt: skip
    columns = [time, *(at[name] for name in wanted)]
    table = np.array([_cells(path, n, row, header, columns) for n, row in enumerate(rows[1:], 2)])
    if len(table) < 2:
        raise _invalid(path, "has less than two frames", "Motion needs at least two.")
    points = table[:, 1:].reshape(len(table), len(ids), 2 if flat else 3)
    return _take(path, path.stem, table[:, 0] * unit, np.array(ids), points)


def _cells(
    path: Path, number: int, row: list[str], header: list[str], columns: list[int]
) -> list[float]:
    if len(row) != len(header):
        problem = f"row {number} has {len(row)} cells, the header has {len(header)}"
        raise _invalid(f"{path}:{number}", problem, "Export the landmarks again.")
    try:
        return [float(row[column].strip() or "nan") for column in columns]
    except ValueError as error:
        raise _invalid(
            f"{path}:{number}", f"row {number}: {error}", "Export the landmarks again."
        ) from error


def _take(
    path: Path, name: str, times_s: Floats, ids: NDArray[np.int64], points: NDArray[np.float64]
) -> Take:
    """A checked take; frames at its end that hold nothing are padding."""
    numbers = tuple(int(number) for number in ids)
    if not name or set(name) & set('/\\:*?"<>|\0') or name.startswith("."):
        raise _invalid(path, f"has a take called {name!r}", "Name it like a file.")
    if len(set(numbers)) != len(numbers) or min(numbers, default=-1) < 0:
        raise _invalid(path, "has a point twice, or a negative number", "Give each one number.")
    values = np.zeros((*points.shape[:2], 3))
    values[..., : points.shape[2]] = points
    if np.isinf(values).any():
        raise _invalid(path, f"'{name}' holds infinite numbers", "Leave lost points empty.")
    known = np.flatnonzero(np.isfinite(values).any(axis=(1, 2)))
    if not np.isfinite(times_s).all() or (np.diff(times_s) <= 0).any():
        raise _invalid(path, f"times of '{name}' do not increase", "Sort the frames by time.")
    end = int(known[-1]) + 1 if len(known) else 0
    return Take(name, np.asarray(times_s[:end], np.float64), numbers, values[:end])
