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
        "Xu et al. 2013 limit curves to 15 a second, 0.25 in 1/60 s: nothing turns round at that "
        "speed within a frame"
    )
    codes: ClassVar[Mapping[str, Code]] = {
        "shape-pops": Code(
            Severity.WARNING,
            "A shape jumps away and back at once.",
            "Remove the key that sticks out.",
        ),
    }
    limits: ClassVar[Mapping[str, LimitSpec]] = {
        "most": LimitSpec(0.25, "how far a frame may stick out of its neighbours, weight units"),
        "frame_s": LimitSpec(0.0167, "length of a frame, seconds"),
    }

    def run(self, performance: Performance, limits: Mapping[str, Any]) -> Iterable[Complaint]:
        """Complain of each shape once, where it pops most."""
        shapes, frame_s = performance.shapes, limits["frame_s"]
        inside = (shapes.times_s >= shapes.times_s[0] + frame_s) & (
            shapes.times_s <= shapes.duration_s - frame_s
        )
        at_s = shapes.times_s[inside]
        if not len(at_s):
            raise Skip("the animation is too short")
        # Between keys nothing turns round. Both neighbours are left behind, on the same side.
        here = shapes.sample(at_s)
        rise, fall = here - shapes.sample(at_s - frame_s), here - shapes.sample(at_s + frame_s)
        out = np.minimum(np.abs(rise), np.abs(fall)) * (np.sign(rise) == np.sign(fall))
        for column, name in enumerate(shapes.names):
            worst = int(np.argmax(out[:, column]))
            if out[worst, column] > limits["most"]:
                text = f"{name} jumps by {out[worst, column]:.2f} and back"
                start_s, end_s = at_s[worst] - frame_s, at_s[worst] + frame_s
                yield complain("shape-pops", text, start_s=start_s, end_s=end_s)
