"""Check ``finite-weights``."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any, ClassVar

import numpy as np

from animeme.delivery import Code, Complaint, Delivery, LimitSpec, complain
from animeme.findings import Severity


class FiniteWeights:
    """Every weight is a number."""

    id: ClassVar[str] = "finite-weights"
    subject: ClassVar[str] = "delivery"
    rationale: ClassVar[str] = (
        "One weight that is not a number makes the whole mesh vanish in most engines."
    )
    source: ClassVar[str] = (
        "glTF 2.0 specification, section 3.6.2.2: NaN and infinities are not allowed in accessors"
    )
    codes: ClassVar[Mapping[str, Code]] = {
        "weights-not-finite": Code(
            Severity.ERROR,
            "A weight is NaN or infinite.",
            "Export the animation anew; look for a division by zero in its rig.",
        ),
    }
    limits: ClassVar[Mapping[str, LimitSpec]] = {}

    def run(self, delivery: Delivery, limits: Mapping[str, Any]) -> Iterable[Complaint]:
        """Complain of each track once."""
        for track in delivery.tracks:
            wrong = np.argwhere(~np.isfinite(track.weights))
            if len(wrong):
                key, shape = wrong[0]
                yield complain(
                    "weights-not-finite",
                    f"'{track.animation}': {len(wrong)} weights are no numbers, the first of "
                    f"{track.shapes[shape]}",
                    place=track.place,
                    start_s=track.times_s[key] if np.isfinite(track.times_s[key]) else None,
                )
