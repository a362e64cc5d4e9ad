"""Check ``khronos``."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any, ClassVar

from animeme.delivery import Code, Complaint, Deliveries, LimitSpec, Skip
from animeme.findings import Severity
from animeme_stages.check.delivery.khronos_validator import errors_of
from animeme_stages.check.delivery.structure import complaints, is_gltf


class Khronos:
    """The Khronos glTF validator finds no error."""

    id: ClassVar[str] = "khronos"
    subject: ClassVar[str] = "deliveries"
    rationale: ClassVar[str] = (
        "It is the judge that every vendor of glTF accepts, and stores and engines ask it as well."
    )
    source: ClassVar[str] = (
        "Khronos glTF validator, ISSUES.md; needs Node and the npm package gltf-validator, which "
        "is looked for among global packages and on NODE_PATH, never beside what is judged"
    )
    codes: ClassVar[Mapping[str, Code]] = {
        "gltf-invalid": Code(
            Severity.ERROR,
            "The Khronos glTF validator finds an error that the source, if known, has not.",
            "Look the rule up in the validator's list of issues, and export the file anew.",
        ),
    }
    limits: ClassVar[Mapping[str, LimitSpec]] = {}

    def run(self, deliveries: Deliveries, limits: Mapping[str, Any]) -> Iterable[Complaint]:
        """Complain of each rule that is broken, once per file."""
        files = [f for f in deliveries.files if is_gltf(f.path) and f.error is None]
        if not files:
            raise Skip("there is no glTF among the files")
        sources = {
            f.path: f.source.source
            for f in files
            if f.source is not None and is_gltf(f.source.source)
        }
        found = errors_of(sorted({*(f.path for f in files), *sources.values()}))
        for file in files:
            before = found[sources[file.path]] if file.path in sources else []
            yield from complaints(
                "gltf-invalid", "Khronos validator", found[file.path], before, file.path
            )
