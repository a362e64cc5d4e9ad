"""The kinds of documents: the type of each, its version, and how older ones become it."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from pydantic import BaseModel

from animeme.documents.bigrams import BigramsDocument
from animeme.documents.edits import EditsDocument
from animeme.documents.job import JobDocument
from animeme.documents.lines import (
    AlignmentDocument,
    CurvesDocument,
    ManifestDocument,
    ModelDocument,
)
from animeme.documents.marks import MarksDocument
from animeme.documents.reports import (
    AlignReportDocument,
    CacheDocument,
    DiffDocument,
    RehearsalDocument,
    ReportDocument,
)
from animeme.documents.rig import RigDocument
from animeme.documents.validation import CheckProfileDocument, ValidationDocument

KINDS: dict[str, type[BaseModel]] = {
    "align-report": AlignReportDocument,
    "alignment": AlignmentDocument,
    "bigrams": BigramsDocument,
    "cache": CacheDocument,
    "check-profile": CheckProfileDocument,
    "curves": CurvesDocument,
    "diff": DiffDocument,
    "edits": EditsDocument,
    "job": JobDocument,
    "manifest": ManifestDocument,
    "marks": MarksDocument,
    "model": ModelDocument,
    "rehearsal": RehearsalDocument,
    "report": ReportDocument,
    "rig": RigDocument,
    "validation": ValidationDocument,
}
VERSIONS = {**dict.fromkeys(KINDS, 1), "rig": 2}
"""The version of each kind that is written now."""
# (kind, version) → what makes a document of it one of the next version.
UPGRADES: dict[tuple[str, int], Callable[[dict[str, Any]], dict[str, Any]]] = {
    ("rig", 1): lambda data: data,  # version 2 only added members
}
