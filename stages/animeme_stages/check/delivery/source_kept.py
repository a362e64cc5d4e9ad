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
    limits: ClassVar[Mapping[str, LimitSpec]] = {
        "most_shown": LimitSpec(5.0, "differences that are said one by one"),
    }

    def run(self, delivery: Delivery, limits: Mapping[str, Any]) -> Iterable[Complaint]:
        """Complain of the first differences, and of how many there are."""
        if delivery.source is None or delivery.format is None:
            raise Skip("no source is known: --against names it")
        problems = delivery.format.harm(delivery.source, delivery.path)
        most = int(limits["most_shown"])
        for problem in problems[:most]:
            yield complain("source-changed", problem.rstrip("."))
        if len(problems) > most:
            # Against a wrong source nothing is as it was.
            text = f"{len(problems) - most} other things differ from {delivery.source.source.name}"
            yield complain("source-changed", text)
