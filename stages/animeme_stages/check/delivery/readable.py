"""Check ``readable``."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import replace
from typing import Any, ClassVar

from animeme.delivery import Code, Complaint, Delivery, LimitSpec, complain
from animeme.findings import Severity


class Readable:
    """The file can be read, and has a face."""

    id: ClassVar[str] = "readable"
    subject: ClassVar[str] = "delivery"
    rationale: ClassVar[str] = (
        "A file that no program opens is no delivery; one without blendshapes cannot speak."
    )
    source: ClassVar[str] = (
        "glTF 2.0 specification, sections 3 and 4.4; OpenUSD, SdfFileFormat and UsdSkel"
    )
    codes: ClassVar[Mapping[str, Code]] = {
        "asset-unreadable": Code(
            Severity.ERROR,
            "The file is damaged, cut off or of another kind.",
            "Export it anew.",
        ),
        "asset-no-blendshapes": Code(
            Severity.ERROR,
            "No mesh has a blendshape that could be driven.",
            "Export the character with its morph targets.",
        ),
        "asset-unusable": Code(
            Severity.ERROR,
            "The file can be opened, but not animated.",
            "Export it anew.",
        ),
        "reader-failed": Code(
            Severity.WARNING,
            "Whatever reads such files failed by its own fault.",
            "Please report it; the file may be sound.",
        ),
    }
    limits: ClassVar[Mapping[str, LimitSpec]] = {}

    def run(self, delivery: Delivery, limits: Mapping[str, Any]) -> Iterable[Complaint]:
        """Complain if the file was not understood."""
        error = delivery.error
        if error is None:
            return
        if error.code in self.codes:
            found = complain(error.code, error.problem)
            # A reader that fails by its own fault says so; the file may be sound.
            yield replace(found, ours=error.code == "reader-failed")
        else:
            yield complain("asset-unusable", f"{error.problem} [{error.code}]")
