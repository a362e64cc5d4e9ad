"""Check ``closed-speech``."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from contextlib import suppress
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from animeme.delivery import Code, Complaint, LimitSpec, Performance, complain
from animeme.errors import InputError
from animeme.findings import Severity
from animeme_stages.check.delivery.signals import (
    during_phones,
    frames_s,
    opening_at,
    speech_of,
    stretches,
    track_of,
)
from animeme_stages.check.delivery.sound import RATE_HZ, VOICED_DB, level_db


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
        if not any(_spoken(closed, loud, limits["least_s"])):
            return
        # Doors and coughs are loud too: phones know better, and cost an alignment.
        with suppress(InputError):
            loud &= during_phones(track_of(performance), at_s)
        for first, last in _spoken(closed, loud, limits["least_s"]):
            text = f"the mouth is shut during {at_s[last] - at_s[first]:.2f} s of speech"
            lead_s = performance.audio_start_s
            start_s, end_s = at_s[first] + lead_s, at_s[last] + lead_s
            yield complain("speech-mouth-closed", text, start_s=start_s, end_s=end_s)


def _spoken(
    closed: NDArray[np.bool_], loud: NDArray[np.bool_], least_s: float
) -> Iterator[tuple[int, int]]:
    """First and last frame of speech in each stretch with a closed mouth."""
    for start, end in stretches(closed):
        inside = np.flatnonzero(loud[start:end]) + start
        if len(inside) < 2:
            continue
        length = int(inside[-1] - inside[0])
        # A stretch with as much silence as speech is a pause with clicks.
        if len(inside) > 0.5 * length and length / RATE_HZ > least_s:
            yield int(inside[0]), int(inside[-1])
