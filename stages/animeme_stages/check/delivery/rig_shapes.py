"""Check ``rig-shapes``."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any, ClassVar

from animeme.delivery import Code, Complaint, Delivery, LimitSpec, complain
from animeme.findings import Severity


class RigShapes:
    """The character has the shapes that it needs."""

    id: ClassVar[str] = "rig-shapes"
    subject: ClassVar[str] = "delivery"
    rationale: ClassVar[str] = (
        "A shape that is missing, or misspelt, is a movement that nobody sees; engines say "
        "nothing of it."
    )
    source: ClassVar[str] = "the rig profiles of animeme, which name their own sources"
    codes: ClassVar[Mapping[str, Code]] = {
        "rig-unknown": Code(
            Severity.WARNING,
            "The shapes are of no known family of rigs.",
            "Say which profile fits with --rig, or draft one: animeme rig ASSET --draft FILE.",
        ),
        "rig-incomplete": Code(
            Severity.WARNING,
            "Many of the shapes of its family are missing.",
            "Add them, or choose a profile that asks for less.",
        ),
        "shapes-missing": Code(
            Severity.ERROR,
            "A shape that the profile asks for is missing.",
            "Add the shape, or name it as the profile says.",
        ),
    }
    limits: ClassVar[Mapping[str, LimitSpec]] = {
        "coverage": LimitSpec(0.3, "least share of the family's shapes"),
        "required": LimitSpec((), "shapes that must be there, as the rig's family spells them"),
    }

    def run(self, delivery: Delivery, limits: Mapping[str, Any]) -> Iterable[Complaint]:
        """Complain of what is missing."""
        assert delivery.character is not None
        if delivery.rig is None:
            yield complain("rig-unknown", delivery.rig_error)
        elif delivery.rig.coverage < limits["coverage"]:
            few = ", ".join(delivery.rig.missing[:5])
            yield complain(
                "rig-incomplete",
                f"has {delivery.rig.coverage:.0%} of the shapes of '{delivery.rig.profile.name}'; "
                f"it lacks {few} and others",
            )
        mapped = delivery.rig.mapped if delivery.rig is not None else {}
        own = {*delivery.character.shapes, *delivery.character.expressions, *mapped}
        lacking = [name for name in limits["required"] if name not in own]
        if lacking:
            yield complain("shapes-missing", f"lacks {', '.join(lacking)}")
