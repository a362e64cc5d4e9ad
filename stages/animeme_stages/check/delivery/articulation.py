"""Check ``articulation``."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any, ClassVar

import numpy as np

from animeme.delivery import Code, Complaint, LimitSpec, Performance, Skip, complain
from animeme.findings import Severity
from animeme_stages.check.delivery.expected import (
    opening_by_rule,
    opening_of_models,
    opening_of_phones,
)
from animeme_stages.check.delivery.signals import opening_at, spoken, track_of
from animeme_stages.check.delivery.sound import RATE_HZ, fit_of, without_posture

_LAG_S = 0.1


class Articulation:
    """The mouth's opening follows the phones."""

    id: ClassVar[str] = "articulation"
    subject: ClassVar[str] = "performance"
    rationale: ClassVar[str] = (
        "A jaw on a timer, noise or a slow ramp may be in time with the voice and still say "
        "nothing: lips are read from what closes and what opens."
    )
    source: ClassVar[str] = "99 % of captured lines are above the limit (tests/bench/sync.py)"
    codes: ClassVar[Mapping[str, Code]] = {
        "articulation-unrelated": Code(
            Severity.WARNING,
            "The mouth opens and closes with no regard to what is said.",
            "Check that the animation was made from this line's words.",
        ),
    }
    limits: ClassVar[Mapping[str, LimitSpec]] = {
        "likeness": LimitSpec(
            0.5, "least correlation of the opening with what lips do at the phones"
        ),
        "likeness_of_models": LimitSpec(0.5, "or with what models do at them"),
        "likeness_of_rules": LimitSpec(0.5, "or with what animators do at them"),
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
        size = len(at_s)
        likenesses = (
            (opening_of_phones(track, size), limits["likeness"]),
            (opening_of_models(track, size), limits["likeness_of_models"]),
            (opening_by_rule(track, size), limits["likeness_of_rules"]),
        )
        found = [
            (fit_of(moved, without_posture(wanted), _LAG_S).likeness, least)
            for wanted, least in likenesses
        ]
        likeness, least = max(found, key=lambda entry: entry[0] - entry[1])
        if likeness < least:
            yield complain(
                "articulation-unrelated",
                f"the opening and the phones have a likeness of {likeness:.2f}, where at least "
                f"{least:.2f} is usual",
            )
