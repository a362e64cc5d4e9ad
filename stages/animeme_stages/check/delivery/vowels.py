"""Check ``vowels``."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any, ClassVar

from animeme.delivery import Code, Complaint, LimitSpec, Performance
from animeme.findings import Severity
from animeme_stages.check.delivery.openings import opening_limits, openings
from animeme_stages.check.delivery.signals import is_open_vowel


class Vowels:
    """The mouth opens for open vowels."""

    id: ClassVar[str] = "vowels"
    subject: ClassVar[str] = "performance"
    rationale: ClassVar[str] = (
        "Loud open vowels from a shut mouth are what a jaw on a timer looks like."
    )
    source: ClassVar[str] = "thresholds: docs/checks.md"
    codes: ClassVar[Mapping[str, Code]] = {
        "vowels-closed": Code(
            Severity.WARNING,
            "The mouth hardly opens during most open vowels.",
            "Check that jawOpen follows the vowels.",
        ),
    }
    limits: ClassVar[Mapping[str, LimitSpec]] = opening_limits(
        LimitSpec(0.3, "least opening, of that of the line")
    )

    def run(self, performance: Performance, limits: Mapping[str, Any]) -> Iterable[Complaint]:
        """Complain once, with the worst of them."""
        yield from openings(
            performance,
            limits,
            "vowels-closed",
            is_open_vowel,
            "open vowels do not open",
            wide=True,
        )
