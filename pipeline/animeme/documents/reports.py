"""Reports on what a run, an alignment or a look at the store came to."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field

from animeme.documents.base import Document, Number, Seconds


class FindingEntry(Document):
    """One remark."""

    severity: Literal["info", "warning", "error"]
    code: str = Field(description="Permanent code.")
    message: str
    place: str
    action: str
    line: str
    character: str
    ours: bool = Field(description="The fault is animeme's or a plug-in's, not the input's.")


class LineEntry(Document):
    """How one line of one character ended."""

    line: str = Field(description="<language>/<line>.")
    language: str
    character: str
    audio_s: Seconds
    status: Literal["ok", "review", "failed"]
    findings: list[FindingEntry]
    outputs: list[str] = Field(description="Files that hold it, relative to the output folder.")


class ReportDocument(Document):
    """The result of a run."""

    schema_: Literal["animeme.report/1"] = Field(alias="schema")
    animeme: str = Field(description="Version that ran.")
    job: str
    exit_code: int
    totals: dict[str, dict[str, int]] = Field(
        description="Character → how many of its lines are ok, review and failed."
    )
    languages: dict[str, dict[str, int]] = Field(
        default_factory=dict, description="Language → the same of its lines."
    )
    audio_s: Seconds
    findings: list[FindingEntry] = Field(description="Those that concern no single line.")
    lines: list[LineEntry]
    outputs: list[str] = Field(description="Delivered files, relative to the output folder.")


class AlignedLineEntry(Document):
    """How the alignment of one line ended."""

    id: str = Field(description="Path below the aligned folder, without suffix.")
    status: Literal["ok", "review", "failed"]
    codes: list[str] = Field(description="Codes of its findings, the worst first, each once.")
    score: Annotated[Number, Field(ge=0, le=1)] | None = Field(
        description="The aligner's confidence; null where it has none, or the line failed."
    )
    language: str = Field(description="BCP-47 tag.")
    audio_s: Seconds = Field(description="Length of the recording, 0 if it could not be read.")
    output: str | None = Field(
        description="File of its timings, relative to the output folder; null if none was written."
    )
    findings: list[FindingEntry]


class AlignTotals(Document):
    """Sums over all lines."""

    lines: int
    ok: int
    review: int
    failed: int
    audio_s: Seconds
    cpu_s: Seconds = Field(description="CPU time of the process and its workers.")


class AlignReportDocument(Document):
    """How the alignment of a folder of lines ended; the same bytes each time but for `cpu_s`."""

    schema_: Literal["animeme.align-report/1"] = Field(alias="schema")
    animeme: str = Field(description="Version that ran.")
    exit_code: int
    totals: AlignTotals
    lines: list[AlignedLineEntry] = Field(description="Sorted by id.")


class RehearsalTotals(Document):
    """How much a run would have to do."""

    lines: int
    stale: int = Field(description="Lines that would be worked on.")
    files: int
    unwritten: int = Field(description="Asset files that would be written.")


class StaleLineEntry(Document):
    """A line that would be worked on."""

    line: str = Field(description="<language>/<line>.")
    causes: list[str] = Field(description="What has changed of it, or `new`.")


class RehearsalDocument(Document):
    """What a run would do."""

    schema_: Literal["animeme.rehearsal/1"] = Field(alias="schema")
    animeme: str = Field(description="Version that would run.")
    job: str
    totals: RehearsalTotals
    causes: dict[str, int] = Field(description="Cause → how many lines it makes stale.")
    lines: list[StaleLineEntry]
    outdated: list[StaleLineEntry] = Field(
        default_factory=list,
        description="Lines that have changed, but would stay as they are: nobody asked for them.",
    )
    files: list[str] = Field(
        description="Asset files that would be written, relative to the output folder."
    )


class CacheDocument(Document):
    """A store, or what became of it."""

    schema_: Literal["animeme.cache/1"] = Field(alias="schema")
    store: str = Field(description="Its folder.")
    results: int | None = Field(None, description="How many results it has.")
    bytes: int | None = Field(None, description="Size of all that is left.")
    oldest: str | None = Field(None, description="When the longest unused was used, in UTC.")
    newest: str | None = Field(None, description="When the last one was used, in UTC.")
    index: str | None = Field(None, description="This machine's index of it.")
    index_bytes: int | None = None
    damaged: list[str] | None = Field(None, description="Keys of results that were removed.")
    removed: int | None = Field(None, description="How many results were removed.")
    freed_bytes: int | None = None


class DiffTotals(Document):
    """Counts."""

    compared: int = Field(description="Animations that both have.")
    beyond: int = Field(description="Those that are not the same within the tolerance.")
    only_a: int
    only_b: int
    unread: int


class DifferenceEntry(Document):
    """An animation that both have."""

    file: str = Field(description="Below the folders that were compared.")
    animation: str
    largest: Number = Field(description="Largest difference of a weight, in weight units.")
    mean: Number = Field(description="Mean over all shapes and all time, in weight units.")
    shape: str = Field(description="Whose difference is the largest; empty if there is none.")
    at_s: Number = Field(description="When.")
    ends_s: list[Number] = Field(description="Times of the last keys.", min_length=2, max_length=2)
    only_a: list[str] = Field(description="Shapes that only the character of A has.")
    only_b: list[str]
    beyond: bool


class AloneEntry(Document):
    """What only one side has."""

    side: Literal["a", "b"]
    file: str
    animation: str = Field(description="Empty for a whole file.")


class UnreadEntry(Document):
    """A file that cannot be read."""

    side: Literal["a", "b"]
    file: str
    problem: str


class DiffDocument(Document):
    """How the curves of two runs differ."""

    schema_: Literal["animeme.diff/1"] = Field(alias="schema")
    animeme: str = Field(description="Version that compared.")
    a: str
    b: str
    tolerance: Number = Field(description="In weight units.")
    exit_code: int
    totals: DiffTotals
    largest: Number = Field(description="Largest difference of all, in weight units.")
    animations: list[DifferenceEntry] = Field(description="The largest difference first.")
    alone: list[AloneEntry]
    unread: list[UnreadEntry]
