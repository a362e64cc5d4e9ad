"""Check ``animation-names``."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any, ClassVar

from animeme.delivery import Code, Complaint, Delivery, LimitSpec, complain
from animeme.findings import Severity


class AnimationNames:
    """Each animation has a name of its own."""

    id: ClassVar[str] = "animation-names"
    subject: ClassVar[str] = "delivery"
    rationale: ClassVar[str] = (
        "Engines find lines by name: of two with one name, one is never heard."
    )
    source: ClassVar[str] = "glTF 2.0 specification, section 3.11: names need not be unique"
    codes: ClassVar[Mapping[str, Code]] = {
        "animation-name-twice": Code(
            Severity.ERROR,
            "Two animations of one file have the same name.",
            "Rename one of them.",
        ),
    }
    limits: ClassVar[Mapping[str, LimitSpec]] = {}

    def run(self, delivery: Delivery, limits: Mapping[str, Any]) -> Iterable[Complaint]:
        """Complain of each name once."""
        places: dict[str, list[str]] = {}
        for track in delivery.tracks:
            owner = track.place.partition("/channels/")[0]
            same = places.setdefault(track.animation, [])
            # Each skeleton of a USD character has a part of every line of ours.
            if owner not in same and not (
                track.note and delivery.path.suffix.lower().startswith(".usd")
            ):
                same.append(owner)
        for name, owners in places.items():
            if len(owners) > 1:
                text = f"'{name}' is the name of {len(owners)} animations"
                yield complain("animation-name-twice", text, place=owners[1])
