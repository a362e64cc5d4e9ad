"""Check ``length``."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any, ClassVar

from animeme.delivery import Code, Complaint, LimitSpec, Performance, complain
from animeme.findings import Severity
from animeme_stages.check.delivery.signals import speech_of


class Length:
    """The animation is as long as its recording."""

    id: ClassVar[str] = "length"
    subject: ClassVar[str] = "performance"
    rationale: ClassVar[str] = (
        "A face that freezes before its line ends, or goes on after it, is seen at once."
    )
    source: ClassVar[str] = "ITU-R BT.1359-1: 0.125 s is the least delay that viewers notice"
    codes: ClassVar[Mapping[str, Code]] = {
        "animation-short": Code(
            Severity.ERROR,
            "The animation ends before its recording.",
            "Export the whole line; check its frame rate.",
        ),
        "animation-long": Code(
            Severity.WARNING,
            "The animation goes on after its recording.",
            "Cut it, or check its frame rate.",
        ),
        "recording-changed": Code(
            Severity.ERROR,
            "The recording is not the one that the file was made from.",
            "Make the animation anew from the present recording.",
        ),
    }
    limits: ClassVar[Mapping[str, LimitSpec]] = {
        "short_s": LimitSpec(0.125, "how much earlier than the recording it may end, seconds"),
        "long_s": LimitSpec(0.5, "how much later, seconds"),
        "changed_s": LimitSpec(
            0.02, "difference of the recording's length from what the file notes, seconds"
        ),
    }

    def run(self, performance: Performance, limits: Mapping[str, Any]) -> Iterable[Complaint]:
        """Complain if the animation's end is not the recording's."""
        speech = speech_of(performance)
        end_s, audio_s = performance.shapes.duration_s, speech.duration_s
        due_s = performance.audio_start_s + audio_s
        noted_s = performance.noted_s
        if noted_s is not None and abs(noted_s - audio_s) > limits["changed_s"]:
            text = (
                f"was made for a recording of {noted_s:.2f} s; the present one has {audio_s:.2f} s"
            )
            yield complain("recording-changed", text)
        elif end_s < due_s - limits["short_s"]:
            text = f"ends at {end_s:.2f} s, its recording at {due_s:.2f} s"
            yield complain("animation-short", text, start_s=end_s, end_s=due_s)
        elif end_s > due_s + limits["long_s"]:
            text = f"ends at {end_s:.2f} s, its recording at {due_s:.2f} s"
            yield complain("animation-long", text, start_s=due_s, end_s=end_s)
