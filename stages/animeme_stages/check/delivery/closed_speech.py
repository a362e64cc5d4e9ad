"""Check ``closed-speech``."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any, ClassVar

import numpy as np

from animeme.delivery import Code, Complaint, LimitSpec, Performance, complain
from animeme.findings import Severity
from animeme_stages.check.delivery.signals import frames_s, opening_at, speech_of, stretches
from animeme_stages.check.delivery.sound import VOICED_DB, level_db


class ClosedSpeech:
    """The mouth is open while it speaks."""

    id: ClassVar[str] = "closed-speech"
    subject: ClassVar[str] = "performance"
    rationale: ClassVar[str] = (
        "Speech from closed lips is the fault that everybody sees, and the sign of a line "
        "that was cut short."
    )
    source: ClassVar[str] = "chosen: no closure of speech lasts half as long"
    codes: ClassVar[Mapping[str, Code]] = {
        "speech-mouth-closed": Code(
            Severity.WARNING,
            "There is speech while the mouth stays shut.",
            "Check that the animation has all of the line.",
        ),
    }
    limits: ClassVar[Mapping[str, LimitSpec]] = {
        "closed": LimitSpec(0.02, "opening that is shut"),
        "least_s": LimitSpec(0.6, "shortest stretch that is judged, seconds"),
    }

    def run(self, performance: Performance, limits: Mapping[str, Any]) -> Iterable[Complaint]:
        """Complain of each stretch of speech with a closed mouth."""
        speech = speech_of(performance)
        level = level_db(speech)
        at_s = frames_s(speech)[: len(level)]
        closed = opening_at(performance, at_s) < limits["closed"]
        loud = level[: len(at_s)] > VOICED_DB
        lead_s = performance.audio_start_s
        for start, end in stretches(closed):
            inside = np.flatnonzero(loud[start:end]) + start
            if len(inside) < 2:
                continue
            first_s, last_s = at_s[inside[0]] + lead_s, at_s[inside[-1]] + lead_s
            # A stretch with as much silence as speech is a pause with clicks.
            mostly = len(inside) > 0.5 * (inside[-1] - inside[0])
            if mostly and last_s - first_s > limits["least_s"]:
                text = f"the mouth is shut during {last_s - first_s:.2f} s of speech"
                yield complain("speech-mouth-closed", text, start_s=first_s, end_s=last_s)
