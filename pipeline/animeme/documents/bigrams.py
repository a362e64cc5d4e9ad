"""The document of a set of bigrams."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field

from animeme.documents.base import Document, Number

Key = tuple[Annotated[Number, Field(ge=0, le=1)], Number]


class BigramEntry(Document):
    """The curves of one pair of phones."""

    curves: dict[str, Annotated[list[Key], Field(min_length=2)]] = Field(
        description="Pose → keys [time, weight] of its control polygon; 0 is where the first phone "
        "starts, 1 where the second ends. A pose that is not here rests."
    )
    note: str = Field("", description="For people.")


class ConflictEntry(Document):
    """Two poses that do not go together."""

    poses: tuple[str, str]
    limit: Number = Field(description="Largest sum of their weights; 2 where nothing is said.")


class BigramsDocument(Document):
    """Curves that an animator draws for pairs of phones, over poses of a face."""

    schema_: Literal["animeme.bigrams/1"] = Field(alias="schema")
    name: str = Field("", description="For people.")
    extends: str | None = Field(
        None,
        description="A set that this one changes: a file, relative to this one, or a shipped name.",
    )
    source: str = Field("", description="Where the curves come from.")
    licence: str = Field("", description="On what terms they may be used.")
    note: str = Field("", description="For people.")
    phones: dict[str, list[str]] = Field(
        default_factory=dict,
        description="Class → its phones in IPA. A phone that is named here leaves the class that "
        "it had. The 21 common classes if nothing is said; `_` is a pause.",
    )
    poses: dict[str, dict[str, Number]] = Field(
        default_factory=dict,
        description="Pose → controls and their weights at weight 1. A pose that is not here drives "
        "the control of its own name.",
    )
    conflicts: list[ConflictEntry] = Field(default_factory=list)
    priority: list[str] = Field(
        default_factory=list, description="Poses, the one that gives way most easily first."
    )
    window_s: Annotated[Number, Field(ge=0, le=1)] | None = Field(
        None, description="Maxima of a pose that are this near are joined; 0 if nothing is said."
    )
    speed: Annotated[Number, Field(gt=0)] | None = Field(
        None, description="Largest change of a weight per second; 15 if nothing is said."
    )
    hold_s: Annotated[Number, Field(gt=0)] | None = Field(
        None, description="Longer phones hold their middle; 0.4 if nothing is said."
    )
    pairs: dict[str, BigramEntry] = Field(
        default_factory=dict, description='"first|second" → what moves.'
    )
