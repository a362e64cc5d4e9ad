"""Check ``file-kind``."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any, ClassVar

from animeme.delivery import Code, Complaint, Delivery, LimitSpec, complain
from animeme.findings import Severity


class FileKind:
    """The file is of a kind that its receiver takes."""

    id: ClassVar[str] = "file-kind"
    subject: ClassVar[str] = "delivery"
    rationale: ClassVar[str] = (
        "An importer that meets a strange suffix skips the file, and its lines are missing in "
        "the build."
    )
    source: ClassVar[str] = "manuals of Unreal Engine 5 and of Unity glTFast; the VRM specification"
    codes: ClassVar[Mapping[str, Code]] = {
        "file-kind-refused": Code(
            Severity.ERROR,
            "The file is of a kind that is not asked for.",
            "Deliver it as one of the kinds that the profile takes.",
        ),
    }
    limits: ClassVar[Mapping[str, LimitSpec]] = {
        "suffixes": LimitSpec((), "suffixes that are taken; none: all"),
    }

    def run(self, delivery: Delivery, limits: Mapping[str, Any]) -> Iterable[Complaint]:
        """Complain of a suffix that is not taken."""
        taken = limits["suffixes"]
        if taken and delivery.path.suffix.lower() not in taken:
            text = f"is a {delivery.path.suffix} file; taken are {', '.join(taken)}"
            yield complain("file-kind-refused", text)
