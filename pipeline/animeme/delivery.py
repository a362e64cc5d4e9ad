"""Delivered files, as the checks of ``animeme validate`` see them, ours and everybody's.

A check of a delivery is a `Check` like any other, with one of three subjects: "delivery" (one
file), "performance" (one animation in it) or "deliveries" (all files of one call).
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import Any, ClassVar, Literal, Protocol, runtime_checkable

import numpy as np

from animeme.contracts import Alignment, Format, Speech
from animeme.curves import CurveSet, Floats
from animeme.dialogue import Line
from animeme.errors import InputError
from animeme.findings import Complaint as Complaint
from animeme.findings import Severity
from animeme.phones import PhoneTrack
from animeme.rig import BoundRig, Character

Subject = Literal["delivery", "performance", "deliveries"]


@dataclass(frozen=True, eq=False)
class StoredTrack:
    """Weights that an animation holds for one mesh, broken or not.

    Attributes:
        animation: its name in the file.
        place: JSON pointer or prim path.
        shapes: canonical names of the N shapes that it ought to move.
        times_s: key times, shape (T,), as they are stored.
        weights: shape (T, N), as they are stored; (0, N) where `fault` says why there are none.
        fault: code and sentence of what keeps a player from reading it, ("", "") if nothing does.
        played: times and weights of what is seen, where that is not linear between keys.
        note: what we left in an animation of ours: line, language, duration_s, audio_start_s.
    """

    animation: str
    place: str
    shapes: tuple[str, ...]
    times_s: Floats
    weights: Floats
    fault: tuple[str, str] = ("", "")
    played: tuple[Floats, Floats] | None = None
    note: Mapping[str, Any] = field(default_factory=dict)

    @property
    def sound(self) -> bool:
        """Whether it can be played."""
        times_s = self.times_s
        return (
            not self.fault[0]
            and len(times_s) > 0
            and bool(np.isfinite(times_s).all() and (np.diff(times_s) > 0).all())
            and bool(np.isfinite(self.weights).all())
        )


@runtime_checkable
class StoredReader(Protocol):
    """What a format may offer: its weight animations as they are stored, broken or not."""

    def stored(
        self, character: Character, names: Collection[str] | None = None
    ) -> Sequence[StoredTrack]:
        """Every weights track in the character's file, in file order.

        Args:
            character: read from the file.
            names: of the lines, else of the animations, that are wanted; all if None.
        """
        ...


class Take:
    """A line of the dialogue; recording and phones are read when first asked for.

    Args:
        line: the line.
        align: finds its phones.
        read: reads its recording.
    """

    def __init__(
        self,
        line: Line,
        read: Callable[[Path], Speech],
        align: Callable[[Line, Speech], Alignment],
    ) -> None:
        self.line = line
        self._read, self._align = read, align

    @cached_property
    def _speech(self) -> Speech | InputError:
        try:
            return self._read(self.line.audio)
        except InputError as error:
            return error

    @cached_property
    def _track(self) -> PhoneTrack | InputError:
        if isinstance(self._speech, InputError):
            return self._speech
        try:
            return self._align(self.line, self._speech).track
        except InputError as error:
            return error

    @property
    def speech(self) -> Speech:
        """The recording.

        Raises:
            InputError: it cannot be read.
        """
        if isinstance(self._speech, InputError):
            raise self._speech
        return self._speech

    @property
    def track(self) -> PhoneTrack:
        """Its phones.

        Raises:
            InputError: it cannot be read or aligned.
        """
        if isinstance(self._track, InputError):
            raise self._track
        return self._track


@dataclass(frozen=True, eq=False)
class Performance:
    """One animation of a delivered file, and the recording that it belongs to.

    Attributes:
        path: the file.
        name: of the animation.
        line: ``<language>/<line>`` where it is known, else the animation's name.
        language: BCP-47 tag, "" if nothing tells.
        place: JSON pointer or prim path of its first track.
        shapes: what is seen, over all canonical shapes of the character; those that it says
            nothing about rest.
        tracks: as they are stored.
        rig: the bound rig, None if it is of no known family.
        take: its line of the dialogue, None if it has none.
        audio_start_s: when the recording starts.
        noted_s: length of the recording as the file notes it, None if it does not.
    """

    path: Path
    name: str
    line: str
    language: str
    place: str
    shapes: CurveSet
    tracks: tuple[StoredTrack, ...]
    rig: BoundRig | None
    rest: Mapping[str, float]
    take: Take | None = None
    audio_start_s: float = 0.0
    noted_s: float | None = None


@dataclass(frozen=True, eq=False)
class Delivery:
    """One delivered file.

    Attributes:
        path: the file.
        size_bytes: its size.
        format: which reads it.
        character: what is in it, None if `error` says why it cannot be read.
        rig: the bound rig, None if it is of no known family.
        rig_error: why it is not.
        tracks: every weights track, broken or not.
        performances: the animations that can be played.
        source: what it was made from, None if that is not known.
        error: why it cannot be read.
    """

    path: Path
    size_bytes: int
    format: Format | None
    character: Character | None = None
    rig: BoundRig | None = None
    rig_error: str = ""
    tracks: tuple[StoredTrack, ...] = ()
    performances: tuple[Performance, ...] = ()
    source: Character | None = None
    error: InputError | None = None


@dataclass(frozen=True, eq=False)
class Deliveries:
    """All files of one call, and the dialogue that they should hold.

    Attributes:
        files: sorted by path.
        takes: ``<language>/<line>`` → line; empty if no dialogue was given.
    """

    files: tuple[Delivery, ...]
    takes: Mapping[str, Take]


@dataclass(frozen=True)
class Code:
    """One thing that a check may find.

    Attributes:
        severity: as shipped; a profile may change it.
        meaning: one sentence for the catalogue.
        action: what to do about it.
    """

    severity: Severity
    meaning: str
    action: str


Limit = float | str | tuple[str, ...]


@dataclass(frozen=True)
class LimitSpec:
    """A threshold that a profile may change.

    Attributes:
        value: as shipped.
        meaning: what it is, with its unit.
    """

    value: Limit
    meaning: str


class Skip(Exception):  # noqa: N818  no error: a check that has nothing to look at says so
    """A check cannot judge its subject; its argument says why."""


class DeliveryCheck(Protocol):
    """Judges a delivered file, one of its animations, or all files.

    Attributes:
        id: permanent and unique, the name of its entry point.
        subject: what `run` is given.
        rationale: why it matters, for the person who reads the finding.
        source: where its thresholds come from: a paper, a standard or a measurement.
        codes: what it may find.
        limits: its thresholds.
    """

    id: ClassVar[str]
    subject: ClassVar[Subject]
    rationale: ClassVar[str]
    source: ClassVar[str]
    codes: ClassVar[Mapping[str, Code]]
    limits: ClassVar[Mapping[str, LimitSpec]]

    def run(self, subject: Any, limits: Mapping[str, Any]) -> Iterable[Complaint]:
        """Complaints about `subject`; whoever calls fills in check, severity, file and line.

        Args:
            subject: a `Delivery`, `Performance` or `Deliveries`.
            limits: every name of `limits` with its value.

        Raises:
            Skip: there is nothing to judge; says why.
            InputError: the recording that it needs cannot be used.
        """
        ...


def complain(
    code: str,
    message: str,
    *,
    place: str = "",
    start_s: float | None = None,
    end_s: float | None = None,
    file: Path | None = None,
    line: str = "",
) -> Complaint:
    """What a check yields; all else is known to whoever runs it."""
    return Complaint(
        Severity.ERROR,
        code,
        message,
        place=place,
        line=line,
        file="" if file is None else str(file),
        start_s=None if start_s is None else round(float(start_s), 3),
        end_s=None if end_s is None else round(float(end_s), 3),
    )
