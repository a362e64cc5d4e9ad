"""Check ``conflicts``."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any, ClassVar

import numpy as np

from animeme.delivery import Code, Complaint, LimitSpec, Performance, Skip, complain
from animeme.findings import Severity

# Round the lips against spread them.
_AGAINST = tuple(
    (rounded, f"{spread}{side}")
    for rounded in ("mouthPucker", "mouthFunnel")
    for spread in ("mouthSmile", "mouthStretch")
    for side in ("Left", "Right")
)


class Conflicts:
    """Shapes that exclude each other do not act together."""

    id: ClassVar[str] = "conflicts"
    subject: ClassVar[str] = "performance"
    rationale: ClassVar[str] = (
        "Poses were sculpted alone: an open mouth and pressed lips together push the lips "
        "through each other."
    )
    source: ClassVar[str] = (
        "the rig profile's ceilings and totals; Xu et al. 2013 for sums of poses"
    )
    codes: ClassVar[Mapping[str, Code]] = {
        "shapes-conflict": Code(
            Severity.WARNING,
            "Two shapes that exclude each other act together.",
            "Lower the one that matters less at that moment.",
        ),
    }
    limits: ClassVar[Mapping[str, LimitSpec]] = {
        "slack": LimitSpec(0.05, "how far beyond the rig's own limits they may go"),
        "sum": LimitSpec(1.2, "largest sum of two shapes that pull the lips apart ways"),
    }

    def run(self, performance: Performance, limits: Mapping[str, Any]) -> Iterable[Complaint]:
        """Complain of each pair or group once."""
        if performance.rig is None:
            raise Skip("the rig is of no known family: --rig says which shapes exclude each other")
        profile, shapes = performance.rig.profile, performance.shapes
        over: list[tuple[str, Any]] = []
        for name, ceiling in profile.ceilings.items():
            if name in shapes.names and ceiling in shapes.names:
                over.append(
                    (f"{name} exceeds {ceiling}", shapes.curve(name) - shapes.curve(ceiling))
                )
        for total in profile.totals:
            own = [shapes.curve(name) for name in total.shapes if name in shapes.names]
            if own:
                over.append(
                    (f"{', '.join(total.shapes)} exceed {total.most:g}", sum(own) - total.most)
                )
        controls = {
            control: sum(shapes.curve(d.shape) for d in drives if d.shape in shapes.names)
            / max(1, len(drives))
            for control, drives in profile.drives.items()
        }
        for first, second in _AGAINST:
            if first in controls and second in controls:
                both = np.minimum(controls[first], controls[second])
                total_of = controls[first] + controls[second]
                excess = np.where(both > 0.25, total_of - limits["sum"], -1.0)
                over.append((f"{first} and {second} act together", excess))
        for said, excess in over:
            worst = int(np.argmax(excess))
            if excess[worst] > limits["slack"]:
                text = f"{said} by {excess[worst]:.2f}"
                yield complain("shapes-conflict", text, start_s=shapes.times_s[worst])
