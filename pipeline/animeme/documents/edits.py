"""The document of edits by hand: what can be done to a line's motion, and when."""

from __future__ import annotations

from itertools import pairwise
from typing import Annotated, Any, Literal, Self

from pydantic import Discriminator, Field, Tag, field_validator, model_validator

from animeme.documents.base import Document, Number, Seconds


class WordMoment(Document):
    """A moment of a word, or of a phone in it: it stays with the word when the line is re-timed."""

    word: Annotated[int, Field(ge=1)] | None = Field(
        None, description="Which word of the line; the first is 1."
    )
    text: str | None = Field(None, min_length=1, description="The word as the alignment has it.")
    phone: Annotated[int, Field(ge=1)] | None = Field(
        None, description="Which phone of the word, or of the line where no word is named."
    )
    symbol: str | None = Field(None, min_length=1, description="The phone's symbol.")
    edge: Literal["start", "end"] = Field("start", description="Which end of it.")
    plus_s: Number = Field(0.0, description="Seconds behind that end; negative is before it.")

    @model_validator(mode="after")
    def _checked(self) -> Self:
        if all(x is None for x in (self.word, self.text, self.phone, self.symbol)):
            raise ValueError("names neither a word nor a phone")
        return self


def _kind_of_moment(value: Any) -> str:
    return "word" if isinstance(value, (dict, WordMoment)) else "seconds"


Moment = Annotated[
    Annotated[Seconds, Tag("seconds")] | Annotated[WordMoment, Tag("word")],
    Discriminator(_kind_of_moment),
]


class AnyEdit(Document):
    """What all edits say: which curve, and from when to when."""

    control: str | None = Field(None, description="A control of the model or the rig; or")
    shape: str | None = Field(None, description="a blendshape of the character.")
    character: str | None = Field(None, description="Whose alone, if not everybody's.")
    from_: Moment | None = Field(
        None, alias="from", description="Seconds of the recording, or a word; its start if absent."
    )
    to: Moment | None = Field(None, description="As `from`; the recording's end if absent.")

    @model_validator(mode="after")
    def _checked(self) -> Self:
        if (self.control is None) == (self.shape is None):
            raise ValueError("names a control or a shape, one of the two")
        if isinstance(self.from_, float) and isinstance(self.to, float) and self.to <= self.from_:
            raise ValueError(f"ends at {self.to:g} s, before it starts at {self.from_:g} s")
        return self


class OffsetEdit(AnyEdit):
    """Add to a curve, between `from` and `to`."""

    do: Literal["offset"]
    by: Number = Field(description="Weight units to add.")
    ease_in_s: Seconds = Field(0.1, description="How long it takes to come, from `from` on.")
    ease_out_s: Seconds = Field(0.1, description="How long it takes to go, up to `to`.")


class MuteEdit(AnyEdit):
    """Hold a curve at rest, between `from` and `to`."""

    do: Literal["mute"]
    ease_in_s: Seconds = Field(0.1, description="How long it takes to come, from `from` on.")
    ease_out_s: Seconds = Field(0.1, description="How long it takes to go, up to `to`.")


class ReplaceEdit(AnyEdit):
    """Put keys in a curve's place, between `from` and `to`."""

    do: Literal["replace"]
    keys: list[tuple[Seconds, Number]] = Field(
        min_length=1, description="[seconds after `from`, weight], in order of time."
    )
    blend_s: Annotated[Number, Field(gt=0, le=10)] = Field(
        0.05, description="How long it takes to get from the old curve to the keys, and back."
    )

    @field_validator("keys")
    @classmethod
    def _ordered(cls, keys: list[tuple[float, float]]) -> list[tuple[float, float]]:
        for (before, _), (after, _) in pairwise(keys):
            if after <= before:
                raise ValueError(f"the key at {after:g} s comes after the one at {before:g} s")
        return keys

    @model_validator(mode="after")
    def _ends(self) -> Self:
        if self.to is None and self.keys[-1][0] == 0:
            raise ValueError("has one key and no end: say `to`")
        return self


Edit = OffsetEdit | MuteEdit | ReplaceEdit


class EditsDocument(Document):
    """Changes by hand to one line's motion, applied in this order each time it is made."""

    schema_: Literal["animeme.edits/1"] = Field(alias="schema")
    made_for_text: str | None = Field(
        None, description="The transcript that the edits were made for."
    )
    edit: list[Annotated[Edit, Field(discriminator="do")]] = Field([])
