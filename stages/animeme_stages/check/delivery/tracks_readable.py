"""Check ``tracks-readable``."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any, ClassVar

from animeme.delivery import Code, Complaint, Delivery, LimitSpec, complain
from animeme.findings import Severity


class TracksReadable:
    """Every weights track can be followed."""

    id: ClassVar[str] = "tracks-readable"
    subject: ClassVar[str] = "delivery"
    rationale: ClassVar[str] = (
        "Players drop an animation whose data they cannot follow, or crash on it."
    )
    source: ClassVar[str] = "glTF 2.0 specification, section 3.11; OpenUSD, UsdSkelAnimation"
    codes: ClassVar[Mapping[str, Code]] = {
        "weights-count": Code(
            Severity.ERROR,
            "The number of weights is not that of keys and shapes.",
            "Export the animation anew.",
        ),
        "animation-broken": Code(
            Severity.ERROR,
            "A track points at something that is not there.",
            "Export the animation anew.",
        ),
        "animation-compressed": Code(
            Severity.INFO,
            "A track is compressed, and nothing is said of it.",
            "Validate the file before it is compressed.",
        ),
    }
    limits: ClassVar[Mapping[str, LimitSpec]] = {}

    def run(self, delivery: Delivery, limits: Mapping[str, Any]) -> Iterable[Complaint]:
        """Complain of every track that cannot be played."""
        for track in delivery.tracks:
            code, said = track.fault
            if code:
                yield complain(code, f"'{track.animation}': {said}", place=track.place)
