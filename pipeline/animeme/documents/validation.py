"""Documents of `animeme validate`: profiles of checks, and what they found."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field

from animeme.documents.base import Document, Number
from animeme.documents.reports import FindingEntry

LimitValue = Number | str | list[str]
Reason = Annotated[str, Field(min_length=8)]


class CheckProfileDocument(Document):
    """What delivered files are judged by; see docs/checks.md for names of checks and codes."""

    schema_: Literal["animeme.check-profile/1"] = Field(alias="schema")
    title: str = Field("", description="What it is for.")
    extends: str = Field(
        "", description="A profile, or a file beside this one, that it builds upon."
    )
    exclude: dict[str, Reason] = Field(
        default_factory=dict, description="Check or code → why it is left out."
    )
    severities: dict[str, Literal["info", "warning", "error"]] = Field(
        default_factory=dict, description="Code → severity, in place of the check's own."
    )
    limits: dict[str, dict[str, LimitValue]] = Field(
        default_factory=dict, description="Check → limit → value, in place of the check's own."
    )
    lines: dict[str, str] = Field(
        default_factory=dict, description="Name of an animation → its line, <language>/<line>."
    )


class ComplaintEntry(FindingEntry):
    """One remark about a delivered file."""

    check: str = Field(description="Id of the check that made it.")
    file: str
    start_s: Number | None = Field(description="On the animation's time axis; null: no time.")
    end_s: Number | None


class SkippedEntry(Document):
    """A check that could not judge something."""

    check: str
    file: str
    line: str
    reason: str


class JudgedLineEntry(Document):
    """An animation that was judged."""

    animation: str
    line: str = Field(description="<language>/<line>; the animation's name if that is not known.")


class JudgedFileEntry(Document):
    """How one file was judged."""

    file: str
    status: Literal["ok", "review", "failed"]
    lines: list[JudgedLineEntry]
    findings: list[ComplaintEntry]


class ValidationTotals(Document):
    """Counts."""

    files: int
    lines: int
    errors: int
    warnings: int
    infos: int
    skipped: int
    accepted: int


class ValidationDocument(Document):
    """How delivered files were judged."""

    schema_: Literal["animeme.validation/1"] = Field(alias="schema")
    animeme: str = Field(description="Version that ran.")
    profile: str
    exit_code: int
    totals: ValidationTotals
    checks: list[str] = Field(description="Ids of the checks that were asked.")
    excluded: dict[str, str] = Field(description="Check or code → why it was left out.")
    findings: list[ComplaintEntry] = Field(description="Those that concern no single file.")
    files: list[JudgedFileEntry]
    skipped: list[SkippedEntry]
    accepted: list[ComplaintEntry] = Field(description="Those that the baseline knows.")
