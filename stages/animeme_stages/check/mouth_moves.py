"""Check ``mouth-moves``."""

from __future__ import annotations

from collections.abc import Iterable
from typing import ClassVar, Literal

import numpy as np

from animeme.contracts import LineSubject
from animeme.findings import Finding, Severity
from animeme.phones import SILENCE

# The range of a whispered syllable; less is a face that does not speak.
STILL_BELOW = 0.02


class MouthMoves:
    """Some driven shape moves while there is speech."""

    id: ClassVar[str] = "mouth-moves"
    subject: ClassVar[Literal["line", "asset"]] = "line"
    rationale: ClassVar[str] = (
        "A rig profile that drives nothing the model moves gives a still face over audible speech."
    )

    def run(self, subject: LineSubject) -> Iterable[Finding]:
        """Report an error if nothing moves."""
        spoken = any(phone.symbol != SILENCE for phone in subject.track.phones)
        moved = np.ptp(subject.shapes.weights, axis=0) if subject.shapes.names else np.zeros(1)
        if spoken and float(moved.max()) < STILL_BELOW:
            yield Finding(
                Severity.ERROR,
                "mouth-still",
                "nothing moves although there is speech",
                action="Check which controls the rig profile maps: `animeme rig ASSET`.",
            )
