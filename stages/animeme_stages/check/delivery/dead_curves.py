"""Check ``dead-curves``."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any, ClassVar

import numpy as np

from animeme.delivery import Code, Complaint, LimitSpec, Performance, Skip, complain
from animeme.findings import Severity


class DeadCurves:
    """Something moves, and nothing is stuck."""

    id: ClassVar[str] = "dead-curves"
    subject: ClassVar[str] = "performance"
    rationale: ClassVar[str] = (
        "Exporters drop channels without a word: the animation is there, and the face is not."
    )
    source: ClassVar[str] = "check mouth-moves: less than 0.02 is a face that does not speak"
    codes: ClassVar[Mapping[str, Code]] = {
        "animation-still": Code(
            Severity.ERROR,
            "Nothing moves in the whole animation.",
            "Export the animation with its shape keys.",
        ),
        "curve-stuck": Code(
            Severity.WARNING,
            "A shape is held away from its rest all the time.",
            "Remove the curve, or make it the rest pose.",
        ),
    }
    limits: ClassVar[Mapping[str, LimitSpec]] = {
        "still": LimitSpec(0.02, "largest movement that is none"),
        "stuck": LimitSpec(0.1, "distance from rest that is held on purpose"),
    }

    def run(self, performance: Performance, limits: Mapping[str, Any]) -> Iterable[Complaint]:
        """Complain if nothing moves, or of each shape that is stuck."""
        shapes = performance.shapes
        moved = np.ptp(shapes.weights, axis=0)
        if float(moved.max(initial=0.0)) < limits["still"]:
            if performance.noted_s is None and performance.take is None:
                # Exporters put weights that stay at rest into every clip of a body.
                raise Skip("nothing moves, and nothing says that it is a line")
            text = f"nothing moves: the largest change of any shape is {moved.max(initial=0.0):.3f}"
            yield complain("animation-still", text)
            return
        for column, name in enumerate(shapes.names):
            away = abs(float(shapes.weights[0, column]) - performance.rest.get(name, 0.0))
            if moved[column] < 1e-6 and away > limits["stuck"]:
                text = f"{name} is {shapes.weights[0, column]:.2f} from start to end"
                yield complain("curve-stuck", text)
