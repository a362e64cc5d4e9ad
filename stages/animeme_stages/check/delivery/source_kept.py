"""Check ``source-kept``."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any, ClassVar

from animeme.delivery import Code, Complaint, Delivery, LimitSpec, Skip, complain
from animeme.findings import Severity


class SourceKept:
    """Nothing of the source is lost or changed."""

    id: ClassVar[str] = "source-kept"
    subject: ClassVar[str] = "delivery"
    rationale: ClassVar[str] = (
        "Whoever delivers animation has no business in the mesh, and an edit there is found "
        "months later."
    )
    source: ClassVar[str] = (
        "the promise of animeme: the source's bytes and values are in the output as they were"
    )
    codes: ClassVar[Mapping[str, Code]] = {
        "source-changed": Code(
            Severity.ERROR,
            "Something of the source was lost or changed.",
            "Deliver the animation on the source as it was handed out.",
        ),
    }
    limits: ClassVar[Mapping[str, LimitSpec]] = {}

    def run(self, delivery: Delivery, limits: Mapping[str, Any]) -> Iterable[Complaint]:
        """Complain of each difference."""
        if delivery.source is None or delivery.format is None:
            raise Skip("no source is known: --against names it")
        for problem in delivery.format.harm(delivery.source, delivery.path):
            yield complain("source-changed", problem.rstrip("."))
