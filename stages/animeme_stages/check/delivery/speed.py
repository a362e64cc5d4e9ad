"""Check ``speed``."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any, ClassVar

import numpy as np

from animeme.delivery import Code, Complaint, LimitSpec, Performance, Skip, complain
from animeme.findings import Severity


class Speed:
    """No shape moves faster than a face can."""

    id: ClassVar[str] = "speed"
    subject: ClassVar[str] = "performance"
    rationale: ClassVar[str] = "A mouth that moves faster than muscles can looks like a puppet."
    source: ClassVar[str] = (
        "Xu et al. 2013 limit curves by hand to 15 a second; muscles of rigs with gains reach 19"
    )
    codes: ClassVar[Mapping[str, Code]] = {
        "shape-too-fast": Code(
            Severity.WARNING,
            "A shape moves faster than a face can.",
            "Smooth the curve there.",
        ),
    }
    limits: ClassVar[Mapping[str, LimitSpec]] = {
        "most_per_s": LimitSpec(20.0, "largest change of a weight, per second"),
        "window_s": LimitSpec(
            0.0333, "over which it is measured, seconds: a frame of film or video"
        ),
    }

    def run(self, performance: Performance, limits: Mapping[str, Any]) -> Iterable[Complaint]:
        """Complain of each shape once, where it is fastest."""
        shapes, step_s = performance.shapes, limits["window_s"]
        at_s = np.arange(shapes.times_s[0], shapes.duration_s + step_s, step_s / 4)
        if len(at_s) < 6:
            raise Skip("the animation is too short")
        weights = shapes.sample(at_s)
        change = np.abs(weights[4:] - weights[:-4]) / step_s
        for column, name in enumerate(shapes.names):
            worst = int(np.argmax(change[:, column]))
            if change[worst, column] > limits["most_per_s"] * 1.02:
                text = f"{name} changes by {change[worst, column]:.1f} per second"
                yield complain("shape-too-fast", text, start_s=at_s[worst], end_s=at_s[worst + 4])
