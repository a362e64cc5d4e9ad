"""Check ``bilabials``."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any, ClassVar

from animeme.delivery import Code, Complaint, LimitSpec, Performance, Skip, complain
from animeme.findings import Severity
from animeme_stages.check.delivery.signals import BILABIALS, extreme, range_of, spoken, track_of


class Bilabials:
    """Lips meet for /p b m/."""

    id: ClassVar[str] = "bilabials"
    subject: ClassVar[str] = "performance"
    rationale: ClassVar[str] = (
        "Viewers notice an open mouth during p, b or m at once (Albrecht et al. 2002, section 3.2)."
    )
    source: ClassVar[str] = "Albrecht et al. 2002, section 3.2; thresholds: docs/checks.md"
    codes: ClassVar[Mapping[str, Code]] = {
        "bilabials-open": Code(
            Severity.WARNING,
            "The lips stay apart during most of /p b m/.",
            "Check mouthClose and jawOpen at these phones.",
        ),
    }
    limits: ClassVar[Mapping[str, LimitSpec]] = {
        "opening": LimitSpec(0.5, "largest opening that counts as closed, of that of the line"),
        "share": LimitSpec(0.5, "largest share of these phones that may fail"),
        "least_phones": LimitSpec(2.0, "fewest of these phones that are judged"),
        "slack_s": LimitSpec(0.03, "how early or late it may happen, seconds"),
    }

    def run(self, performance: Performance, limits: Mapping[str, Any]) -> Iterable[Complaint]:
        """Complain once, with the worst of them."""
        track = track_of(performance)
        phones = [(p, ipa) for p, ipa in spoken(track) if ipa in BILABIALS]
        if len(phones) < limits["least_phones"]:
            raise Skip(f"{len(phones)} such phones are too few to tell")
        range_ = range_of(performance, track)
        if range_ < 0.02:
            raise Skip("the mouth hardly opens; see 'flat'")
        found = [
            (extreme(performance, p, limits["slack_s"], least=True) / range_, p, ipa)
            for p, ipa in phones
        ]
        failed = [entry for entry in found if entry[0] > limits["opening"]]
        if len(failed) > limits["share"] * len(found):
            part, phone, ipa = max(failed, key=lambda entry: entry[0])
            lead_s = performance.audio_start_s
            yield complain(
                "bilabials-open",
                f"{len(failed)} of {len(found)} bilabials do not close, most of all /{ipa}/: "
                f"the mouth is {part:.0%} as open as in the line's loud parts",
                start_s=phone.start_s + lead_s,
                end_s=phone.end_s + lead_s,
            )
