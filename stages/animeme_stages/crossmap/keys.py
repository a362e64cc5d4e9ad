"""Key lip shapes: a few frames of which all others are blends.

Chen et al. 2012, section VII, cross-map motion to a character in this way: key shapes are chosen
from the capture, each frame is a blend of them by non-negative least squares, and the character's
key shapes are blended alike.
"""

from __future__ import annotations

import csv
import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from animeme.curves import Floats
from animeme.errors import InputError
from animeme.files import unreadable
from animeme_stages.synthesize.modes import affinity_propagation

# Affinity propagation compares all with all; of more frames, every n-th competes.
_MOST = 500
# A key shape is looked for this far from the time that is given.
_NEAR_S = 0.1


@dataclass(frozen=True)
class GivenKeys:
    """Key shapes chosen by hand.

    Attributes:
        frames: take and time in seconds of each of K.
        controls: names of the controls that are set for them, () where none are.
        values: shape (K, len(controls)).
    """

    frames: tuple[tuple[str, float], ...]
    controls: tuple[str, ...]
    values: Floats


def find_keys(shapes: Floats) -> NDArray[np.int64]:
    """Frames that stand for all others, by affinity propagation.

    Args:
        shapes: shape (F, M), weighted displacements from rest.

    Returns:
        Indices of K frames, sorted.
    """
    few = np.arange(len(shapes))[:: math.ceil(len(shapes) / _MOST)]
    picked = shapes[few]
    squares = (picked**2).sum(axis=1)
    similarity = -np.maximum(squares[:, None] + squares[None] - 2.0 * picked @ picked.T, 0.0)
    off = similarity[~np.eye(len(few), dtype=bool)]
    preference = float(np.median(off)) if len(off) else 0.0
    return np.asarray(few[affinity_propagation(similarity, preference)])


def read_keys(path: Path, known: Sequence[str]) -> GivenKeys:
    """Key shapes from a CSV file: ``take``, ``time_s``, and perhaps a column per control.

    Args:
        path: the file.
        known: the controls of the character.

    Raises:
        InputError: it has no rows, another column, or a cell that is no number from 0 to 1.
    """

    def wrong(row: int, problem: str) -> InputError:
        return InputError(
            "keys-invalid", problem, place=f"{path}:{row}",
            action="Give take, time_s and, for all rows or none, controls from 0 to 1.",
        )  # fmt: skip

    try:
        with path.open(encoding="utf-8-sig", newline="") as stream:
            rows = [[c.strip() for c in row] for row in csv.reader(stream) if any(row)]
    except OSError as error:
        raise unreadable(path, "keys-invalid", error) from error
    except (UnicodeDecodeError, csv.Error) as error:
        raise wrong(1, f"is not CSV ({error})") from error
    header = rows[0] if rows else []
    if header[:2] != ["take", "time_s"] or len(rows) < 2:
        raise wrong(1, "has no rows under take, time_s")
    strangers = [name for name in header[2:] if name not in known]
    if strangers or len(set(header)) != len(header):
        raise wrong(1, f"the character has no control {', '.join(strangers) or 'twice'}")
    frames, values = [], []
    for number, row in enumerate(rows[1:], 2):
        try:
            numbers = [float(cell) for cell in row[1:]]
        except ValueError as error:
            raise wrong(number, str(error)) from error
        inside = all(0 <= value <= 1 for value in numbers[1:])
        if len(row) != len(header) or not inside or not math.isfinite(numbers[0]):
            raise wrong(number, "has a cell too many or too few, or a control beyond 0 to 1")
        frames.append((row[0], numbers[0]))
        values.append(numbers[1:])
    return GivenKeys(tuple(frames), tuple(header[2:]), np.array(values).reshape(len(frames), -1))


def locate(keys: GivenKeys, at: Sequence[tuple[str, float]], path: Path) -> NDArray[np.int64]:
    """The frames that given keys mean.

    Args:
        keys: by take and time.
        at: take and time of each usable frame.
        path: of the keys, for messages.

    Raises:
        InputError: no usable frame is near one of them.
    """
    takes = np.array([take for take, _ in at])
    times_s = np.array([time_s for _, time_s in at])
    found = []
    for take, time_s in keys.frames:
        off_s = np.where(takes == take, np.abs(times_s - time_s), np.inf)
        nearest = int(off_s.argmin())
        if off_s[nearest] > _NEAR_S:
            raise InputError(
                "keys-invalid", f"there is no usable frame near {time_s:g} s of '{take}'",
                place=str(path), action="Name frames in which all lip points were tracked.",
            )  # fmt: skip
        found.append(nearest)
    return np.array(found)
