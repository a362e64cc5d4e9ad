"""Speech with captured motion: what models are fitted to and judged by."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from animeme.curves import Floats
from animeme.findings import Finding
from animeme.phones import PhoneTrack

Listener = Callable[[str, float], None]
"""Told what is being done and which part of it is, 0 to 1."""


def no_listener(_: str, __: float) -> None:
    """Ignore progress."""


@dataclass(frozen=True, eq=False)
class CapturedLine:
    """One spoken line with its motion.

    Attributes:
        id: its file name without suffix.
        track: the phones, from 0 to the recording's end.
        times_s: when motion was captured, shape (F,), strictly increasing, within the track.
        values: shape (F, N), one column per control of the dataset; NaN where there is a gap.

    Raises:
        ValueError: an invariant does not hold.
    """

    id: str
    track: PhoneTrack
    times_s: Floats
    values: Floats

    def __post_init__(self) -> None:
        if self.times_s.ndim != 1 or len(self.times_s) == 0:
            raise ValueError(f"'{self.id}' has no frames")
        if not np.isfinite(self.times_s).all() or (np.diff(self.times_s) <= 0).any():
            raise ValueError(f"times of '{self.id}' must be finite and strictly increasing")
        if self.times_s[0] < 0 or self.times_s[-1] > self.track.duration_s:
            raise ValueError(f"frames of '{self.id}' lie outside its recording")
        if self.values.shape[:1] != self.times_s.shape or np.isinf(self.values).any():
            raise ValueError(f"values of '{self.id}' must have a finite row, or a gap, per frame")


@dataclass(frozen=True, eq=False)
class Dataset:
    """Lines with the same controls.

    Attributes:
        controls: N distinct names, one per column of every line.
        lines: sorted by id.
        findings: what could not be used, and why.

    Raises:
        ValueError: an invariant does not hold.
    """

    controls: tuple[str, ...]
    lines: tuple[CapturedLine, ...]
    findings: tuple[Finding, ...] = ()

    def __post_init__(self) -> None:
        if not self.controls or len(set(self.controls)) != len(self.controls):
            raise ValueError("a dataset needs controls with distinct names")
        for line in self.lines:
            if line.values.shape != (len(line.times_s), len(self.controls)):
                raise ValueError(f"'{line.id}' does not have a column per control")

    @property
    def frames(self) -> int:
        """Frames of all lines."""
        return sum(len(line.times_s) for line in self.lines)

    @property
    def duration_s(self) -> float:
        """Length of all recordings in seconds."""
        return sum(line.track.duration_s for line in self.lines)

    def subset(self, lines: Sequence[CapturedLine]) -> Dataset:
        """The same controls, with other lines."""
        return replace(self, lines=tuple(lines), findings=())


def folds(dataset: Dataset, count: int) -> list[list[int]]:
    """Indices of the lines of `count` folds, the same for the same ids whatever their order.

    Lines go round the folds in the order of a hash of their ids, so that neighbours in a recording
    session do not end up together.
    """
    order = sorted(range(len(dataset.lines)), key=lambda i: _scattered(dataset.lines[i].id))
    return [sorted(order[k::count]) for k in range(count)]


def holdout(dataset: Dataset, share: float) -> tuple[Dataset, Dataset]:
    """Split into lines to fit and lines to judge by; at least one of each where there are two.

    Args:
        dataset: all lines.
        share: part of the lines to hold out, more than 0 and less than 1.
    """
    order = sorted(range(len(dataset.lines)), key=lambda i: _scattered(dataset.lines[i].id))
    count = min(max(1, round(share * len(order))), max(1, len(order) - 1))
    held = set(order[:count])
    fitted = [line for i, line in enumerate(dataset.lines) if i not in held]
    judged = [line for i, line in enumerate(dataset.lines) if i in held]
    return dataset.subset(fitted), dataset.subset(judged)


def _scattered(name: str) -> tuple[int, str]:
    """A number that depends on `name` alone, whatever the process's hash seed."""
    value = 2166136261  # FNV-1a
    for byte in name.encode("utf-8", "surrogateescape"):
        value = (value ^ byte) * 16777619 % 2**32
    return value, name
