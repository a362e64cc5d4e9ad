"""Check ``key-density``."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any, ClassVar

import numpy as np

from animeme.delivery import Code, Complaint, LimitSpec, Performance, complain
from animeme.findings import Severity


class KeyDensity:
    """There are as many keys as motion needs."""

    id: ClassVar[str] = "key-density"
    subject: ClassVar[str] = "performance"
    rationale: ClassVar[str] = (
        "A key per sample of a capture costs memory in every copy of the game, and nobody "
        "sees the difference."
    )
    source: ClassVar[str] = (
        "displays show 60 frames a second; 120 leave room for cubic splines and slow motion"
    )
    codes: ClassVar[Mapping[str, Code]] = {
        "keys-dense": Code(
            Severity.WARNING,
            "There are more keys than frames can show.",
            "Reduce the keys: [curves] max_error, or your exporter's own reduction.",
        ),
    }
    limits: ClassVar[Mapping[str, LimitSpec]] = {
        "most_per_s": LimitSpec(120.0, "most keys a second, on average"),
    }

    def run(self, performance: Performance, limits: Mapping[str, Any]) -> Iterable[Complaint]:
        """Complain of tracks with more keys than anybody sees."""
        for track in performance.tracks:
            if not track.sound or len(track.times_s) < 10:
                continue
            per_s = (len(track.times_s) - 1) / max(float(np.ptp(track.times_s)), 1e-3)
            if per_s > limits["most_per_s"] * 1.01:
                text = f"has {per_s:.0f} keys a second; {limits['most_per_s']:g} are enough"
                yield complain("keys-dense", text, place=track.place)
                return
