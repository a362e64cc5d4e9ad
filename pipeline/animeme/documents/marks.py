"""The document of what a person thought of lines."""

from __future__ import annotations

from typing import Literal

from pydantic import Field

from animeme.documents.base import Document


class MarkEntry(Document):
    """What a person thought of one line."""

    line: str = Field(min_length=1, description="<language>/<line>.")
    character: str = Field("", description="Whose it is; empty for all.")
    mark: Literal["good", "fix"] = Field(description="Good as it is, or to be done again.")
    note: str = Field("", description="For people.")


class MarksDocument(Document):
    """Marks of a review; the page that `animeme review` writes exports it."""

    schema_: Literal["animeme.marks/1"] = Field(alias="schema")
    marks: list[MarkEntry]
