"""Check ``frame-rate``."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any, ClassVar

import numpy as np

from animeme.delivery import Code, Complaint, LimitSpec, Performance, Skip, complain
from animeme.findings import Severity
from animeme.timing import FrameRate as Rate


class FrameRate:
    """Keys lie on frames."""

    id: ClassVar[str] = "frame-rate"
    subject: ClassVar[str] = "performance"
    rationale: ClassVar[str] = "Sequencers round keys to their frames: motion between them jitters."
    source: ClassVar[str] = (
        "SMPTE ST 12-1; the rate is the project's own, so no check is made before a profile says it"
    )
    codes: ClassVar[Mapping[str, Code]] = {
        "keys-off-frames": Code(
            Severity.WARNING,
            "Keys lie between the frames of the project's rate.",
            "Export at the project's frame rate.",
        ),
    }
    limits: ClassVar[Mapping[str, LimitSpec]] = {
        "rate": LimitSpec("", "the project's frame rate, 30 or 29.97df, as text; none: not judged"),
        "slack_s": LimitSpec(0.002, "how far from a frame a key may lie, seconds"),
    }

    def run(self, performance: Performance, limits: Mapping[str, Any]) -> Iterable[Complaint]:
        """Complain of tracks with keys between frames."""
        if not limits["rate"]:
            raise Skip("the profile gives no frame rate")
        try:
            rate = float(Rate.parse(limits["rate"]).per_s)
        except ValueError as error:
            raise Skip(str(error)) from None
        for track in performance.tracks:
            if not track.sound:
                continue
            off_s = np.abs(track.times_s * rate - np.round(track.times_s * rate)) / rate
            off_s[-1] = 0.0  # a line may end between frames
            wrong = np.flatnonzero(off_s > limits["slack_s"])
            if len(wrong):
                text = f"{len(wrong)} of {len(off_s)} keys lie between frames of {limits['rate']}"
                at_s = track.times_s[wrong[0]]
                yield complain("keys-off-frames", text, place=track.place, start_s=at_s)
