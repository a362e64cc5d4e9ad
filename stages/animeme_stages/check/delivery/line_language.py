"""Check ``line-language``."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any, ClassVar

from animeme.delivery import Code, Complaint, Deliveries, LimitSpec, Skip, complain
from animeme.findings import Severity


class LineLanguage:
    """Lines are in the folder of their language."""

    id: ClassVar[str] = "line-language"
    subject: ClassVar[str] = "deliveries"
    rationale: ClassVar[str] = (
        "A line in the wrong language passes every other check and shames the studio."
    )
    source: ClassVar[str] = "the layout <language>/<file> of dialogue and delivery"
    codes: ClassVar[Mapping[str, Code]] = {
        "language-wrong": Code(
            Severity.ERROR,
            "A line lies in the folder of another language.",
            "Move it, or deliver the right one.",
        ),
    }
    limits: ClassVar[Mapping[str, LimitSpec]] = {}

    def run(self, deliveries: Deliveries, limits: Mapping[str, Any]) -> Iterable[Complaint]:
        """Complain of each animation whose language is not its folder's."""
        known = {take.line.language for take in deliveries.takes.values()}
        performances = [p for file in deliveries.files for p in file.performances]
        known |= {p.language for p in performances if p.language}
        if len(known) < 2:
            raise Skip("there is one language at most")
        for p in performances:
            folders = [part for part in p.path.parts[:-1] if part in known]
            if p.language and folders and folders[-1] != p.language:
                text = f"is in '{p.language}', and in the folder '{folders[-1]}'"
                yield complain("language-wrong", text, file=p.path, line=p.line, place=p.place)
