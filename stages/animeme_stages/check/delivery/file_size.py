"""Check ``file-size``."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any, ClassVar

from animeme.delivery import Code, Complaint, Delivery, LimitSpec, complain
from animeme.findings import Severity


class FileSize:
    """The file is no larger than its budget."""

    id: ClassVar[str] = "file-size"
    subject: ClassVar[str] = "delivery"
    rationale: ClassVar[str] = (
        "Large files slow every check-out and every load; hosts refuse them beyond their limit."
    )
    source: ClassVar[str] = (
        "GitHub documentation, About large files on GitHub: files above 100 MiB are refused"
    )
    codes: ClassVar[Mapping[str, Code]] = {
        "file-too-large": Code(
            Severity.WARNING,
            "The file is larger than the budget.",
            "Reduce keys, or put lines into files of their own.",
        ),
    }
    limits: ClassVar[Mapping[str, LimitSpec]] = {
        "most_mib": LimitSpec(100.0, "budget of one file, MiB"),
    }

    def run(self, delivery: Delivery, limits: Mapping[str, Any]) -> Iterable[Complaint]:
        """Complain of a file above its budget."""
        size = delivery.size_bytes / 2**20
        if size > limits["most_mib"]:
            text = f"has {size:.1f} MiB; the budget is {limits['most_mib']:g}"
            yield complain("file-too-large", text)
