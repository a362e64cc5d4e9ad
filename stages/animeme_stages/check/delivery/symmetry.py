"""Check ``symmetry``."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any, ClassVar

import numpy as np

from animeme.delivery import Code, Complaint, LimitSpec, Performance, complain
from animeme.findings import Severity
from animeme_stages.check.delivery.sides import mirrored

_TURNS = frozenset({"jawLeft", "jawRight", "mouthLeft", "mouthRight"})


class Symmetry:
    """Left and right move together."""

    id: ClassVar[str] = "symmetry"
    subject: ClassVar[str] = "performance"
    rationale: ClassVar[str] = (
        "A channel that was dropped, or bound to the wrong side, drags the mouth to one side "
        "through the whole line."
    )
    source: ClassVar[str] = (
        "chosen so that a side that stands still is found, and a crooked smile is not"
    )
    codes: ClassVar[Mapping[str, Code]] = {
        "sides-differ": Code(
            Severity.WARNING,
            "One side moves much more than the other.",
            "Check both sides' channels; exclude this for a lopsided character.",
        ),
    }
    limits: ClassVar[Mapping[str, LimitSpec]] = {
        "moved": LimitSpec(0.15, "least movement that is judged"),
        "difference": LimitSpec(
            0.6, "largest difference, as a share of the larger side's movement"
        ),
    }

    def run(self, performance: Performance, limits: Mapping[str, Any]) -> Iterable[Complaint]:
        """Complain of each pair of shapes whose sides differ."""
        shapes = performance.shapes
        for column, name in enumerate(shapes.names):
            other = mirrored(name)
            # What turns the whole jaw or mouth to a side has no twin that moves with it.
            if other <= name or other not in shapes.names or name in _TURNS:
                continue
            left, right = shapes.weights[:, column], shapes.curve(other)
            most = max(float(np.ptp(left)), float(np.ptp(right)))
            differ = float(np.abs(left - right).max())
            if most > limits["moved"] and differ > limits["difference"] * most:
                at = int(np.argmax(np.abs(left - right)))
                yield complain(
                    "sides-differ",
                    f"{name} and {other} differ by {differ:.2f}",
                    start_s=shapes.times_s[at],
                )
