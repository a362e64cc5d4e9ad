"""Check ``flat``."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any, ClassVar

import numpy as np

from animeme.delivery import Code, Complaint, LimitSpec, Performance, Skip, complain
from animeme.findings import Severity
from animeme_stages.check.delivery.signals import frames_s, opening_at, speech_of
from animeme_stages.check.delivery.sound import VOICED_DB, level_db


class Flat:
    """The mouth opens and closes in speech."""

    id: ClassVar[str] = "flat"
    subject: ClassVar[str] = "performance"
    rationale: ClassVar[str] = (
        "A mouth that hardly moves reads as a ventriloquist, and is what wrong gains and "
        "units look like."
    )
    source: ClassVar[str] = (
        "chosen: jawOpen 0.05 parts the lips of the ICT head by 1 mm (check bilabials-close)"
    )
    codes: ClassVar[Mapping[str, Code]] = {
        "delivery-flat": Code(
            Severity.WARNING,
            "The mouth hardly opens in the whole line.",
            "Check the gain of the shapes that open the mouth.",
        ),
    }
    limits: ClassVar[Mapping[str, LimitSpec]] = {
        "least": LimitSpec(
            0.04, "least range of the opening, 5th to 95th percentile of its speech"
        ),
    }

    def run(self, performance: Performance, limits: Mapping[str, Any]) -> Iterable[Complaint]:
        """Complain of a line whose opening hardly changes."""
        speech = speech_of(performance)
        level = level_db(speech)
        at_s = frames_s(speech)[: len(level)]
        opened = opening_at(performance, at_s)[level[: len(at_s)] > VOICED_DB - 12]
        if len(opened) < 20:
            raise Skip("there is too little speech to tell")
        span = float(np.percentile(opened, 95) - np.percentile(opened, 5))
        if span < limits["least"]:
            yield complain("delivery-flat", f"the mouth's opening changes by {span:.3f} of jawOpen")
