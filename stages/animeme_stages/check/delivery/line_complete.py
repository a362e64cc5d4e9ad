"""Check ``line-complete``."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any, ClassVar

from animeme.delivery import Code, Complaint, Deliveries, LimitSpec, Skip, complain
from animeme.findings import Severity


class LineComplete:
    """The delivery has the lines of the dialogue, and no others."""

    id: ClassVar[str] = "line-complete"
    subject: ClassVar[str] = "deliveries"
    rationale: ClassVar[str] = "A missing line is a face that stands still while a voice is heard."
    source: ClassVar[str] = "the dialogue folder is the list of what was ordered"
    codes: ClassVar[Mapping[str, Code]] = {
        "line-missing": Code(
            Severity.ERROR,
            "A line of the dialogue has no animation.",
            "Deliver it, or map its name in the profile's [lines].",
        ),
        "line-surplus": Code(
            Severity.WARNING,
            "An animation belongs to no line of the dialogue.",
            "Remove it, or map its name in the profile's [lines].",
        ),
    }
    limits: ClassVar[Mapping[str, LimitSpec]] = {}

    def run(self, deliveries: Deliveries, limits: Mapping[str, Any]) -> Iterable[Complaint]:
        """Complain of lines that are missing, and of animations that are no lines."""
        if not deliveries.takes:
            raise Skip("no dialogue is known: --dialogue names its folder")
        performances = [p for file in deliveries.files for p in file.performances]
        languages = {p.language for p in performances if p.language}
        # What is delivered as glTF and as USD has every line in both.
        kinds = sorted({file.path.suffix.lower() for file in deliveries.files})
        heard = {(id(p.take), p.path.suffix.lower()) for p in performances if p.take is not None}
        for key, take in deliveries.takes.items():
            lacking = [kind for kind in kinds if (id(take), kind) not in heard]
            # One language may be delivered before another.
            if lacking and (take.line.language in languages or not languages):
                which = "no file" if lacking == kinds else f"no {' or '.join(lacking)} file"
                yield complain("line-missing", f"{which} has an animation of this line", line=key)
        for p in performances:
            if p.take is None:
                text = f"'{p.name}' is no line of the dialogue"
                yield complain("line-surplus", text, file=p.path, line=p.line, place=p.place)
