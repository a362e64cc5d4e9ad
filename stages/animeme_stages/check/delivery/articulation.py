"""Check ``articulation``."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any, ClassVar

import numpy as np

from animeme.delivery import Code, Complaint, LimitSpec, Performance, Skip, complain
from animeme.findings import Severity
from animeme_stages.check.delivery.signals import (
    opening_at,
    opening_of_phones,
    spoken,
    track_of,
)
from animeme_stages.check.delivery.sound import RATE_HZ, lag_of, without_posture

_LAG_S = 0.1


class Articulation:
    """The mouth's opening follows the phones."""

    id: ClassVar[str] = "articulation"
    subject: ClassVar[str] = "performance"
    rationale: ClassVar[str] = (
        "A jaw on a timer, noise or a slow ramp may be in time with the voice and still say "
        "nothing: lips are read from what closes and what opens."
    )
    source: ClassVar[str] = "chosen on captured lips; figures in docs/checks.md"
    codes: ClassVar[Mapping[str, Code]] = {
        "articulation-unrelated": Code(
            Severity.WARNING,
            "The mouth opens and closes with no regard to what is said.",
            "Check that the animation was made from this line's words.",
        ),
    }
    limits: ClassVar[Mapping[str, LimitSpec]] = {
        "likeness": LimitSpec(0.2, "least correlation of the opening with that of the phones"),
        "least_phones": LimitSpec(8.0, "fewest phones that are judged"),
    }

    def run(self, performance: Performance, limits: Mapping[str, Any]) -> Iterable[Complaint]:
        """Complain if the opening has too little to do with the phones."""
        track = track_of(performance)
        count = len(spoken(track))
        if count < limits["least_phones"]:
            raise Skip(f"{count} phones are too few to tell")
        at_s = np.arange(int(track.duration_s * RATE_HZ)) / RATE_HZ
        moved = without_posture(opening_at(performance, at_s))
        if np.ptp(moved) < 1e-3:
            raise Skip("the mouth does not move")
        _, likeness = lag_of(moved, without_posture(opening_of_phones(track, at_s)), _LAG_S)
        if likeness < limits["likeness"]:
            yield complain(
                "articulation-unrelated",
                f"the opening and the phones have a likeness of {likeness:.2f}, where at least "
                f"{limits['likeness']:.2f} is usual",
            )
