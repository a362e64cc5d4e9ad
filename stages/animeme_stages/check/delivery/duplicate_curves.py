"""Check ``duplicate-curves``."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any, ClassVar

import numpy as np

from animeme.delivery import Code, Complaint, LimitSpec, Performance, complain
from animeme.findings import Severity
from animeme_stages.check.delivery.sides import mirrored


class DuplicateCurves:
    """No two shapes move alike by mistake."""

    id: ClassVar[str] = "duplicate-curves"
    subject: ClassVar[str] = "performance"
    rationale: ClassVar[str] = (
        "One curve on two shapes is what a slipped column or a wrong order of shapes looks like."
    )
    source: ClassVar[str] = (
        "chosen: sides and drives of one control move alike by design and are left out"
    )
    codes: ClassVar[Mapping[str, Code]] = {
        "curves-alike": Code(
            Severity.WARNING,
            "Two shapes of different meaning have the same curve.",
            "Check the order of shapes in the exporter.",
        ),
    }
    limits: ClassVar[Mapping[str, LimitSpec]] = {
        "moved": LimitSpec(0.1, "least movement that is compared"),
        "alike": LimitSpec(0.0005, "largest difference of curves that are the same"),
    }

    def run(self, performance: Performance, limits: Mapping[str, Any]) -> Iterable[Complaint]:
        """Complain of each pair of shapes that move alike and have no reason to."""
        shapes = performance.shapes
        related = _related(performance)
        moving = np.flatnonzero(np.ptp(shapes.weights, axis=0) > limits["moved"])
        for place, first in enumerate(moving):
            for second in moving[place + 1 :]:
                names = shapes.names[first], shapes.names[second]
                apart = np.abs(shapes.weights[:, first] - shapes.weights[:, second]).max()
                if apart > limits["alike"] or mirrored(names[0]) == names[1]:
                    continue
                if frozenset(names) not in related:
                    yield complain("curves-alike", f"{names[0]} and {names[1]} have the same curve")


def _related(performance: Performance) -> set[frozenset[str]]:
    """Pairs of shapes that one control drives, or that make one expression."""
    if performance.rig is None:
        return set()
    groups = [*performance.rig.profile.drives.values(), *performance.rig.binds.values()]
    named = [[drive.shape for drive in group] for group in groups]
    return {frozenset((a, b)) for group in named for a in group for b in group if a != b}
