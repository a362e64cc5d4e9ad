"""Check ``sync``."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from contextlib import suppress
from typing import Any, ClassVar

import numpy as np

from animeme.delivery import Code, Complaint, LimitSpec, Performance, Skip, complain
from animeme.errors import InputError
from animeme.findings import Severity
from animeme_stages.check.delivery.signals import (
    frames_s,
    opening_at,
    opening_of_phones,
    speech_of,
    track_of,
)
from animeme_stages.check.delivery.sound import (
    VOICED_DB,
    expected_opening,
    lag_of,
    level_db,
    without_posture,
)


class Sync:
    """The mouth opens when the sound says so."""

    id: ClassVar[str] = "sync"
    subject: ClassVar[str] = "performance"
    rationale: ClassVar[str] = (
        "Viewers notice sound that is 45 ms early or 125 ms late, and mind it at 90 and 185 ms; "
        "a line with another line's audio they notice at once."
    )
    source: ClassVar[str] = (
        "ITU-R BT.1359-1, figure 2; the lag and likeness of captured lips: tests/bench/sync.py"
    )
    codes: ClassVar[Mapping[str, Code]] = {
        "sync-lag": Code(
            Severity.WARNING,
            "The mouth moves too early or too late for its sound.",
            "Shift the animation by this much, or check where its recording starts.",
        ),
        "sync-unrelated": Code(
            Severity.WARNING,
            "The mouth does not move as the sound says.",
            "Check that this is the animation of this recording, and of its present take.",
        ),
    }
    limits: ClassVar[Mapping[str, LimitSpec]] = {
        "lag_s": LimitSpec(
            0.06, "largest lag, either way, seconds; 98 % of captured lines have less"
        ),
        "likeness": LimitSpec(
            0.45, "least correlation of opening and sound; 99 % of captured lines have more"
        ),
        "most_s": LimitSpec(0.4, "largest lag that is looked for, seconds"),
        "least_s": LimitSpec(0.8, "least speech that can be judged, seconds"),
    }

    def run(self, performance: Performance, limits: Mapping[str, Any]) -> Iterable[Complaint]:
        """Complain of a lag or, if nothing fits, of that."""
        speech = speech_of(performance)
        loud_s = float((level_db(speech) > VOICED_DB).sum()) / 100
        if loud_s < limits["least_s"]:
            raise Skip(f"{loud_s:.1f} s of speech are too little to tell")
        expected = expected_opening(speech)
        at_s = frames_s(speech)[: len(expected)]
        moved = opening_at(performance, at_s)
        if np.ptp(moved) < 1e-3:
            raise Skip("the mouth does not move")
        moved = without_posture(moved)

        def doubted(found: tuple[float, float]) -> bool:
            lag_s, likeness = found
            return bool(likeness < limits["likeness"] or abs(lag_s) > limits["lag_s"] + 1e-9)

        found = lag_of(moved, without_posture(expected[: len(at_s)]), limits["most_s"])
        if doubted(found):
            # The guess from sound knows no voice but the one that it was fitted to; phones do, and
            # are asked only now, as they cost an alignment.
            with suppress(InputError):
                phones = without_posture(opening_of_phones(track_of(performance), at_s))
                found = max(found, lag_of(moved, phones, limits["most_s"]), key=lambda e: e[1])
        if not doubted(found):
            return
        lag_s, likeness = found
        if likeness < limits["likeness"]:
            yield complain(
                "sync-unrelated",
                f"the mouth's opening and the sound have a likeness of {likeness:.2f}, where at "
                f"least {limits['likeness']:.2f} is usual",
            )
        else:
            when = "late" if lag_s > 0 else "early"
            yield complain(
                "sync-lag",
                f"the mouth is {abs(lag_s) * 1000:.0f} ms {when} (likeness {likeness:.2f})",
            )
