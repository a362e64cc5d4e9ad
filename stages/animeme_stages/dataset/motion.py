"""Captured or animated curves in CSV files.

Ours (``time_s`` and a column per control), Live Link Face's (``Timecode``, ``BlendShapeCount``, the
ARKit names), and what Maya, Blender and trackers export (``time`` in seconds, or ``frame`` with a
known rate). An empty cell is a gap.
"""

from __future__ import annotations

import csv
import io
import math
import re
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path

import numpy as np

from animeme.curves import Floats
from animeme.errors import InputError
from animeme.files import unreadable
from animeme.findings import Finding, Severity
from animeme.timing import RATES, FrameRate

LARGEST_BYTES = 256 * 2**20
_SECONDS = ("time_s", "time", "seconds", "t")
_FRAMES = ("frame", "frames")
# Live Link Face writes 60 frames per second whatever the take's own rate; others write as many as
# there are in the last second that they count to its end.
_LIVE_LINK = RATES["60"]
_COUNTED = {rate.nominal: rate for rate in map(RATES.get, ("24", "25", "30", "48", "50")) if rate}
_TIMECODE = re.compile(r"(\d+:\d{2}:\d{2})([:;])(\d+)(?:\.\d+)?")
_DAY_S = 24 * 3600.0
# Live Link Face also has the eyes, brows and head; they do not follow the phones.
_SPOKEN = ("jaw", "mouth", "tongue", "cheek", "nose")
_FACE = (*_SPOKEN, "brow", "eye")


@dataclass(frozen=True, eq=False)
class Motion:
    """The curves of one file.

    Attributes:
        times_s: shape (F,), strictly increasing.
        controls: N distinct names.
        values: shape (F, N), NaN where there is a gap.
        findings: what a person should know.
    """

    times_s: Floats
    controls: tuple[str, ...]
    values: Floats
    findings: tuple[Finding, ...] = ()


def read_motion(
    path: Path,
    *,
    rate_hz: float | None = None,
    frame_rate: FrameRate | None = None,
    all_shapes: bool = False,
) -> Motion:
    """Read captured curves.

    Args:
        path: a CSV file with a header; commas, semicolons or tabs between cells.
        rate_hz: frames per second, for files that count frames.
        frame_rate: the same, exactly, and the rate of time codes; None to tell these by themselves.
        all_shapes: of Live Link Face, eyes and brows too.

    Raises:
        InputError: it has no time column, its times go back, a cell is no number, or it has less
            than two frames; says which row.
    """
    rows = _rows(path)
    header = [cell.strip() for cell in rows[0]]
    lower = [name.lower() for name in header]
    live_link = "timecode" in lower
    if frame_rate is not None:
        rate_hz = float(frame_rate.per_s)
    column, unit = _time_column(path, lower, rate_hz)
    parts = (_FACE if all_shapes else _SPOKEN) if live_link else ()
    chosen = [i for i, name in enumerate(header) if i != column and _is_control(name, parts)]
    controls = tuple(_arkit(header[i]) if live_link else header[i] for i in chosen)
    _require_names(path, controls)
    numbers = list(enumerate(rows[1:], start=2))
    decimal_comma = any("," in cell for _, row in numbers[:50] for cell in row)
    clock = _clock(numbers, column, frame_rate) if live_link else None
    times, values, nans = [], [], 0
    for number, row in numbers:
        if len(row) != len(header):
            raise _broken(path, number, f"has {len(row)} cells, the header has {len(header)}")
        cells = [cell.strip().replace(",", ".") if decimal_comma else cell.strip() for cell in row]
        times.append(_time(path, number, cells[column], clock or unit))
        found = [_value(path, number, header[i], cells[i]) for i in chosen]
        nans += sum(cells[i].lower() == "nan" for i in chosen)
        values.append(found)
    times_s = _unwrapped(np.array(times)) if live_link else np.array(times)
    _require_order(path, times_s)
    findings = []
    if nans:
        findings.append(
            Finding(
                Severity.INFO,
                "motion-nan",
                f"{nans} cells are NaN and count as gaps",
                place=str(path),
            )
        )
    table = np.array(values, dtype=np.float64).reshape(len(times_s), len(controls))
    return Motion(times_s, controls, table, tuple(findings))


def _rows(path: Path) -> list[list[str]]:
    """The cells of all rows that are not blank; the header first."""
    try:
        if path.stat().st_size > LARGEST_BYTES:
            raise InputError(
                "motion-large", f"is larger than {LARGEST_BYTES >> 20} MB", place=str(path),
                action="Cut it into lines; each has a recording of its own.",
            )  # fmt: skip
        data = path.read_bytes()
    except OSError as error:
        raise unreadable(path, "motion-unreadable", error) from error
    utf16 = data.startswith((b"\xff\xfe", b"\xfe\xff"))
    try:
        text = data.decode("utf-16" if utf16 else "utf-8-sig")
    except UnicodeDecodeError as error:
        raise InputError(
            "motion-unreadable", f"is not text (byte {error.start})", place=str(path),
            action="Export the curves as CSV.",
        ) from error  # fmt: skip
    first = text.lstrip("\r\n").split("\n", 1)[0]
    delimiter = max(",;\t", key=first.count)
    try:
        found = list(csv.reader(io.StringIO(text, newline=""), delimiter=delimiter, strict=True))
    except csv.Error as error:
        raise InputError(
            "motion-unreadable", f"is not CSV: {error}", place=str(path),
            action="Export the curves again.",
        ) from error  # fmt: skip
    rows = [row for row in found if any(cell.strip() for cell in row)]
    if not rows:
        raise InputError(
            "motion-empty", "the file is empty", place=str(path), action="Export the curves again."
        )
    return rows


def _time_column(path: Path, lower: list[str], rate_hz: float | None) -> tuple[int, str | float]:
    """Where times are, and "timecode" or the seconds that one unit of them lasts."""
    if "timecode" in lower:
        return lower.index("timecode"), "timecode"
    for name in _SECONDS:
        if name in lower:
            return lower.index(name), 1.0
    for name in _FRAMES:
        if name in lower:
            if rate_hz is None:
                raise InputError(
                    "motion-rate", f"counts time in '{name}', and no rate is given",
                    place=str(path), action="Say --motion-rate-hz, for example 24.",
                )  # fmt: skip
            return lower.index(name), 1.0 / rate_hz
    raise InputError(
        "motion-no-time",
        f"has no time column (its columns are {', '.join(lower[:5])} …)",
        place=f"{path}:1",
        action="Name the column of seconds time_s, or that of frame numbers frame.",
    )


def _is_control(name: str, parts: tuple[str, ...]) -> bool:
    """Whether a column is no time; of Live Link Face, whether it is a shape of these `parts`."""
    if not parts:
        return name.lower() not in (*_SECONDS, *_FRAMES)
    # LeftEyeYaw is an angle, and begins with none of them.
    return name.lower().startswith(parts)


def _arkit(name: str) -> str:
    """Live Link Face's ``JawOpen`` is ARKit's ``jawOpen``."""
    return name[:1].lower() + name[1:]


def _require_names(path: Path, controls: Sequence[str]) -> None:
    problem = ""
    if not controls:
        problem = "has no control beside its times"
    elif "" in controls:
        problem = "has a column without a name"
    elif len(set(controls)) != len(controls):
        twice = sorted({name for name in controls if controls.count(name) > 1})
        problem = f"has two columns called {', '.join(twice)}"
    if problem:
        raise InputError(
            "motion-columns", problem, place=f"{path}:1", action="Give each control one column."
        )


def _broken(path: Path, row: int, problem: str) -> InputError:
    return InputError(
        "motion-broken", f"row {row} {problem}", place=f"{path}:{row}",
        action="Export the curves again, or mend the row.",
    )  # fmt: skip


def _clock(
    rows: Sequence[tuple[int, list[str]]], column: int, frame_rate: FrameRate | None
) -> FrameRate:
    """The rate that a take's time codes count in."""
    if frame_rate is not None:
        return frame_rate
    found = [_TIMECODE.fullmatch(row[column].strip()) for _, row in rows if column < len(row)]
    labels = [(match[1], match[2], int(match[3])) for match in found if match]
    if any(mark == ";" for _, mark, _ in labels):
        return RATES["59.94df" if any(frame >= 30 for *_, frame in labels) else "29.97df"]
    ends = {a for (s, _, a), (t, _, b) in pairwise(labels) if s != t and b == 0}
    counted = _COUNTED.get(ends.pop() + 1) if len(ends) == 1 else None
    return counted or _LIVE_LINK


def _time(path: Path, row: int, cell: str, unit: str | float | FrameRate) -> float:
    if isinstance(unit, FrameRate):
        try:
            return float(unit.frame_of(cell) / unit.per_s)
        except ValueError as error:
            raise _broken(path, row, f"has the timecode {cell!r}: {error}") from None
    try:
        time_s = float(cell) * float(unit)
    except ValueError:
        raise _broken(path, row, f"has the time {cell!r}, which is no number") from None
    if not math.isfinite(time_s):
        raise _broken(path, row, f"has the time {cell!r}")
    return time_s


def _value(path: Path, row: int, name: str, cell: str) -> float:
    if not cell:
        return math.nan
    try:
        value = float(cell)
    except ValueError:
        raise _broken(path, row, f"has {cell!r} for '{name}', which is no number") from None
    if math.isinf(value):
        raise _broken(path, row, f"has {cell!r} for '{name}'")
    return value


def _unwrapped(times_s: Floats) -> Floats:
    """Timecodes from the take's start, over midnight too."""
    days = np.concatenate([[0], np.cumsum(np.diff(times_s) < -_DAY_S / 2)])
    since: Floats = times_s + days * _DAY_S
    return since - since[0] if len(since) else since


def _require_order(path: Path, times_s: Floats) -> None:
    if len(times_s) < 2:
        raise InputError(
            "motion-short", f"has {len(times_s)} frame{'s' * (len(times_s) != 1)}",
            place=str(path), action="Motion needs at least two frames.",
        )  # fmt: skip
    wrong = np.flatnonzero(np.diff(times_s) <= 0)
    if len(wrong):
        row = int(wrong[0]) + 3
        back = "goes back to" if times_s[wrong[0] + 1] < times_s[wrong[0]] else "stays at"
        raise InputError(
            "motion-time-order", f"in row {row} time {back} {times_s[wrong[0] + 1]:g} s",
            place=f"{path}:{row}", action="Sort the rows by time, and keep each time once.",
        )  # fmt: skip
