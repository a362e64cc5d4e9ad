"""Check ``popping``."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any, ClassVar

import numpy as np

from animeme.delivery import Code, Complaint, LimitSpec, Performance, Skip, complain
from animeme.findings import Severity


class Popping:
    """Nothing pops."""

    id: ClassVar[str] = "popping"
    subject: ClassVar[str] = "performance"
    rationale: ClassVar[str] = (
        "A single frame that sticks out is seen as a twitch, however small its reason."
    )
    source: ClassVar[str] = (
        "Xu et al. 2013: 15 a second is 0.5 in a frame of 1/30 s; 0.35 there and back is a twitch"
    )
    codes: ClassVar[Mapping[str, Code]] = {
        "shape-pops": Code(
            Severity.WARNING,
            "A shape jumps away and back within two frames.",
            "Remove the key that sticks out.",
        ),
    }
    limits: ClassVar[Mapping[str, LimitSpec]] = {
        "most": LimitSpec(0.35, "how far a frame may stick out of its neighbours, weight units"),
        "frame_s": LimitSpec(0.0333, "length of a frame, seconds"),
    }

    def run(self, performance: Performance, limits: Mapping[str, Any]) -> Iterable[Complaint]:
        """Complain of each shape once, where it pops most."""
        shapes, step_s = performance.shapes, limits["frame_s"]
        at_s = np.arange(shapes.times_s[0], shapes.duration_s + step_s, step_s / 4)
        if len(at_s) < 10:
            raise Skip("the animation is too short")
        weights = shapes.sample(at_s)
        # Both neighbours are left behind, on the same side.
        out = np.minimum(
            np.abs(weights[4:-4] - weights[:-8]), np.abs(weights[4:-4] - weights[8:])
        ) * (np.sign(weights[4:-4] - weights[:-8]) == np.sign(weights[4:-4] - weights[8:]))
        for column, name in enumerate(shapes.names):
            worst = int(np.argmax(out[:, column]))
            if out[worst, column] > limits["most"]:
                text = f"{name} jumps by {out[worst, column]:.2f} and back"
                yield complain("shape-pops", text, start_s=at_s[worst], end_s=at_s[worst + 8])
