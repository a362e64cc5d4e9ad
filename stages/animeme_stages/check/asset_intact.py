"""Check ``asset-intact``."""

from __future__ import annotations

from collections.abc import Iterable
from typing import ClassVar, Literal

from animeme.contracts import AssetSubject
from animeme.findings import Finding, Severity


class AssetIntact:
    """Nothing that was in the asset is lost or changed."""

    id: ClassVar[str] = "asset-intact"
    subject: ClassVar[Literal["line", "asset"]] = "asset"
    rationale: ClassVar[str] = (
        "We add, we never alter: a tool that harms one asset is not run again."
    )

    def run(self, subject: AssetSubject) -> Iterable[Finding]:
        """Report an error for each value or byte of the source that the output lacks."""
        for problem in subject.format.harm(subject.character, subject.output):
            yield Finding(
                Severity.ERROR,
                "asset-harmed",
                problem,
                place=str(subject.output),
                action="Do not use this file; please report it.",
                ours=True,
            )
