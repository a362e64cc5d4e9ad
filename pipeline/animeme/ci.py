"""What continuous integration is told: cases and rules, in whatever form it takes them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from animeme.findings import Finding, Severity


@dataclass(frozen=True)
class Case:
    """One thing that was judged.

    Attributes:
        suite: what it is part of: a file, or a character.
        name: what it is called there: a line, or a check.
        findings: what was found of it, the worst first.
        skipped: why it could not be judged, "" if it was.
    """

    suite: str
    name: str
    findings: Sequence[Finding] = ()
    skipped: str = ""


@dataclass(frozen=True)
class Rule:
    """What a code means.

    Attributes:
        meaning: one sentence.
        rationale: why it matters.
        action: what to do about it.
        severity: as shipped.
    """

    meaning: str
    rationale: str
    action: str
    severity: Severity
