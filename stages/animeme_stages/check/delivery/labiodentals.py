"""Check ``labiodentals``."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any, ClassVar

from animeme.delivery import Code, Complaint, LimitSpec, Performance
from animeme.findings import Severity
from animeme_stages.check.delivery.openings import opening_limits, openings
from animeme_stages.check.delivery.signals import LABIODENTALS


class Labiodentals:
    """The lower lip nears the teeth for /f v/."""

    id: ClassVar[str] = "labiodentals"
    subject: ClassVar[str] = "performance"
    rationale: ClassVar[str] = (
        "After bilabials, f and v are what viewers read from lips (Fisher 1968): a wide-open "
        "mouth contradicts them."
    )
    source: ClassVar[str] = (
        "Fisher 1968, Confusions among visually perceived consonants; thresholds: docs/checks.md"
    )
    codes: ClassVar[Mapping[str, Code]] = {
        "labiodentals-open": Code(
            Severity.WARNING,
            "The mouth is wide open during most of /f v/.",
            "Check the opening at these phones.",
        ),
    }
    limits: ClassVar[Mapping[str, LimitSpec]] = opening_limits(
        LimitSpec(0.85, "largest opening that lets the lip touch the teeth, of that of the line")
    )

    def run(self, performance: Performance, limits: Mapping[str, Any]) -> Iterable[Complaint]:
        """Complain once, with the worst of them."""
        yield from openings(
            performance,
            limits,
            "labiodentals-open",
            LABIODENTALS.__contains__,
            "labiodentals have no contact",
            wide=False,
        )
