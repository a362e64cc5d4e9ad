"""Check ``bilabials``."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any, ClassVar

from animeme.delivery import Code, Complaint, LimitSpec, Performance
from animeme.findings import Severity
from animeme_stages.check.delivery.openings import opening_limits, openings
from animeme_stages.check.delivery.signals import BILABIALS


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
    limits: ClassVar[Mapping[str, LimitSpec]] = opening_limits(
        LimitSpec(0.5, "largest opening that counts as closed, of that of the line")
    )

    def run(self, performance: Performance, limits: Mapping[str, Any]) -> Iterable[Complaint]:
        """Complain once, with the worst of them."""
        yield from openings(
            performance,
            limits,
            "bilabials-open",
            BILABIALS.__contains__,
            "bilabials do not close",
            wide=False,
        )
