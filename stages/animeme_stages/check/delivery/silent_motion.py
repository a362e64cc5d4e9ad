"""Check ``silent-motion``."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any, ClassVar

import numpy as np

from animeme.delivery import Code, Complaint, LimitSpec, Performance, complain
from animeme.findings import Severity
from animeme_stages.check.delivery.signals import frames_s, opening_at, speech_of, stretches
from animeme_stages.check.delivery.sound import SILENT_DB, level_db


class SilentMotion:
    """The mouth rests in silence."""

    id: ClassVar[str] = "silent-motion"
    subject: ClassVar[str] = "performance"
    rationale: ClassVar[str] = (
        "A mouth that talks on without sound belongs to another take, or to another line."
    )
    source: ClassVar[str] = (
        "Chandrasekaran et al. 2009: mouths move 0.1 to 0.3 s before they are heard"
    )
    codes: ClassVar[Mapping[str, Code]] = {
        "silence-moving": Code(
            Severity.WARNING,
            "The mouth moves while nothing is heard.",
            "Check that this is the animation of this recording.",
        ),
    }
    limits: ClassVar[Mapping[str, LimitSpec]] = {
        "moved": LimitSpec(0.2, "movement that is more than a breath, of jawOpen"),
        "margin_s": LimitSpec(
            0.3, "time before and after speech in which a mouth may move, seconds"
        ),
        "least_s": LimitSpec(
            0.3, "shortest stretch of silence that is judged, seconds, margins apart"
        ),
    }

    def run(self, performance: Performance, limits: Mapping[str, Any]) -> Iterable[Complaint]:
        """Complain of each silence in which the mouth goes both ways."""
        speech = speech_of(performance)
        level = level_db(speech)
        at_s = frames_s(speech)[: len(level)]
        opened = opening_at(performance, at_s)
        margin = int(limits["margin_s"] * 100)
        for start, end in stretches(level[: len(at_s)] < SILENT_DB):
            first = start + (margin if start else 0)
            last = end - (margin if end < len(at_s) else 0)
            if (last - first) / 100 < limits["least_s"]:
                continue
            steps = np.diff(opened[first:last])
            both_ways = min(steps[steps > 0].sum(), -steps[steps < 0].sum())
            if both_ways > limits["moved"]:
                from_s = at_s[first] + performance.audio_start_s
                to_s = at_s[last - 1] + performance.audio_start_s
                text = f"the mouth opens and closes by {both_ways:.2f} in silence"
                yield complain(
                    "silence-moving",
                    text,
                    start_s=from_s,
                    end_s=to_s,
                )
