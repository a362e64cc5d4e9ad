"""Check ``weight-range``."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any, ClassVar

import numpy as np

from animeme.delivery import Code, Complaint, LimitSpec, Performance, complain
from animeme.findings import Severity


class WeightRange:
    """Weights stay where the rig was sculpted."""

    id: ClassVar[str] = "weight-range"
    subject: ClassVar[str] = "performance"
    rationale: ClassVar[str] = (
        "Beyond its limits a shape is extrapolated: lips go through teeth, and engines that "
        "clamp show something else."
    )
    source: ClassVar[str] = (
        "glTF 2.0 specification, section 3.7.2.2; the rig profile's limits, [0, 1] without"
    )
    codes: ClassVar[Mapping[str, Code]] = {
        "weight-out-of-range": Code(
            Severity.WARNING,
            "A weight leaves the range of its shape.",
            "Clamp the curve, or say the shape's limits in a rig profile.",
        ),
    }
    limits: ClassVar[Mapping[str, LimitSpec]] = {
        "slack": LimitSpec(0.02, "how far beyond its limits a weight may go"),
    }

    def run(self, performance: Performance, limits: Mapping[str, Any]) -> Iterable[Complaint]:
        """Complain of each shape once."""
        profile = performance.rig.profile if performance.rig is not None else None
        shapes = performance.shapes
        for column, name in enumerate(shapes.names):
            low, high = (profile.limits if profile else {}).get(name, (0.0, 1.0))
            weights = shapes.weights[:, column]
            beyond = np.maximum(low - weights, weights - high)
            worst = int(np.argmax(beyond))
            if beyond[worst] > limits["slack"]:
                yield complain(
                    "weight-out-of-range",
                    f"{name} goes to {weights[worst]:.2f}; its range is {low:g} to {high:g}",
                    start_s=shapes.times_s[worst],
                )
