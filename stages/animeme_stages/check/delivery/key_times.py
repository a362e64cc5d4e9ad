"""Check ``key-times``."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any, ClassVar

import numpy as np

from animeme.delivery import Code, Complaint, Delivery, LimitSpec, complain
from animeme.findings import Severity


class KeyTimes:
    """Keys follow each other, from the animation's start."""

    id: ClassVar[str] = "key-times"
    subject: ClassVar[str] = "delivery"
    rationale: ClassVar[str] = (
        "Engines search keys by halving: times out of order play garbage, and a late first "
        "key holds a frozen face."
    )
    source: ClassVar[str] = (
        "glTF 2.0 specification, section 3.11: input times strictly increase and are not negative"
    )
    codes: ClassVar[Mapping[str, Code]] = {
        "times-not-increasing": Code(
            Severity.ERROR,
            "Key times go back, or stand still.",
            "Export the animation anew.",
        ),
        "times-negative": Code(
            Severity.ERROR,
            "Keys lie before the animation's start.",
            "Move the animation, so that it starts at 0.",
        ),
        "times-late": Code(
            Severity.WARNING,
            "The first key is late: the animation does not start at 0.",
            "Start the animation at frame 0.",
        ),
    }
    limits: ClassVar[Mapping[str, LimitSpec]] = {
        "late_s": LimitSpec(
            0.05, "latest first key, seconds; exporters that count frames from 1 have 0.04"
        ),
    }

    def run(self, delivery: Delivery, limits: Mapping[str, Any]) -> Iterable[Complaint]:
        """Complain of each track once."""
        for track in delivery.tracks:
            times_s = track.times_s
            if len(times_s) == 0:
                continue
            back = np.flatnonzero(~(np.diff(times_s) > 0))
            said = f"'{track.animation}': "
            if len(back) or not np.isfinite(times_s).all():
                at = int(back[0]) + 1 if len(back) else 0
                text = f"{said}key {at} is not after the one before it"
                yield complain("times-not-increasing", text, place=track.place)
            elif times_s[0] < -1e-6:
                text = f"{said}the first key is at {times_s[0]:.3f} s"
                yield complain("times-negative", text, place=track.place)
            elif times_s[0] > limits["late_s"] and len(times_s) > 1:
                text = f"{said}the first key is at {times_s[0]:.3f} s"
                yield complain("times-late", text, place=track.place)
