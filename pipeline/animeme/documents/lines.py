"""Documents about lines: alignments, curves, models that make them, and lists of lines."""

from __future__ import annotations

from typing import Any, Literal

from pydantic import BaseModel, ConfigDict, Field

from animeme.documents.base import Document, Number, Seconds


class WordEntry(Document):
    """One spoken word."""

    text: str
    start_s: Seconds
    end_s: Seconds
    source: tuple[int, int] = Field(description="Character positions in the transcript.")


class PhoneEntry(Document):
    """One phone, or a pause with the symbol `sil`."""

    symbol: str
    start_s: Seconds
    end_s: Seconds
    score: Number | None = Field(None, description="Mean log score per 10 ms frame.")


class EventEntry(Document):
    """An inline tag of the transcript, at the moment that it stands for."""

    tag: str = Field(min_length=1, description="Without its brackets.")
    time_s: Seconds
    source: tuple[int, int] = Field(description="Character positions in the transcript.")


class AlignmentDocument(Document):
    """Phones and words of one recording, without gaps, and the tags among them."""

    schema_: Literal["animeme.alignment/1"] = Field(alias="schema")
    language: str = Field(description="BCP-47 tag.")
    inventory: Literal["arpabet", "ipa"]
    duration_s: Seconds
    words: list[WordEntry]
    phones: list[PhoneEntry]
    events: list[EventEntry] = Field([])


class CurvesDocument(Document):
    """Named curves over one time axis, linear between keys."""

    schema_: Literal["animeme.curves/1"] = Field(alias="schema")
    times_s: list[Number]
    curves: dict[str, list[Number]]


class ModelDocument(BaseModel):
    """A model: its name, parameters and whatever tables it learned."""

    model_config = ConfigDict(extra="allow", frozen=True, populate_by_name=True, defer_build=True)

    schema_: Literal["animeme.model/1"] = Field(alias="schema")
    model: str = Field(description="Name of the registered model that reads this document.")
    config: dict[str, Any] = Field(description="The model's parameters.")


class ListedLineEntry(Document):
    """One line in one language."""

    id: str = Field(description="Of the line, the same in every language; `/` separates folders.")
    audio: str = Field("", description="Its recording, relative to this document.")
    character: str = Field("", description="Who says it; empty for every character of the job.")
    language: str = Field("", description="BCP-47 tag; empty if the job or the path says it.")
    text: str | None = Field(
        None, description="What is said; null if a .txt beside the recording says it."
    )
    notes: str = Field("", description="For people.")


class ManifestDocument(Document):
    """A list of lines: what every sheet comes down to."""

    schema_: Literal["animeme.manifest/1"] = Field(alias="schema")
    lines: list[ListedLineEntry]
