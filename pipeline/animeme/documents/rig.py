"""The rig document: which control drives which shapes."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field

from animeme.documents.base import Document, Number


class DriveEntry(Document):
    """One shape that a control moves."""

    shape: str = Field(description="Shape name, as in the asset or in the rig's usual spelling.")
    gain: Number = Field(1.0, description="Shape weight per unit of the control.")


class CorrectiveEntry(Document):
    """A shape that follows others."""

    of: list[str] = Field(description="The shapes it follows; none: it is not moved.")
    rule: Literal["product", "minimum"] = Field(
        "product", description="Its weight is their product, or the least of them."
    )


class TotalEntry(Document):
    """Shapes that exclude each other."""

    shapes: Annotated[list[str], Field(min_length=2)]
    most: Annotated[Number, Field(ge=0)] = Field(
        1.0, description="What they weigh together at most; beyond it, all shrink alike."
    )


class RigDocument(Document):
    """A rig profile: what drives which shapes. A `*` in a name stands for Left and for Right."""

    schema_: Literal["animeme.rig/2"] = Field(alias="schema")
    name: str = Field(description="The profile's name.")
    family: str = Field("", description="For people: the rig family or character it describes.")
    extends: str | None = Field(
        None,
        description="A shipped profile, or a rig document beside this one: entries here replace "
        "its entries of the same name, an empty one removes it.",
    )
    detect_at: Annotated[int, Field(ge=1, strict=True)] | None = Field(
        None,
        description="How many of the shapes that speech moves make a rig one of this family.",
    )
    marks: list[str] = Field(
        default_factory=list,
        description="Shapes that nothing moves, but that tell rigs of this family from others.",
    )
    controls: dict[str, list[DriveEntry]] = Field(
        default_factory=dict, description="Control → the shapes it drives; weights add up."
    )
    poses: dict[str, dict[str, Number]] = Field(
        default_factory=dict,
        description="Shape → what the face shows at weight 1, in ARKit's controls (without Left or "
        "Right: both). The weights are the mixture that comes nearest to the model's controls.",
    )
    rest: str | None = Field(None, description="The pose that takes what the others leave of 1.")
    limits: dict[str, tuple[Number, Number]] = Field(
        default_factory=dict, description="Shape → [lowest, highest] weight; [0, 1] if absent."
    )
    totals: list[TotalEntry] = Field(default_factory=list)
    ceilings: dict[str, str] = Field(
        default_factory=dict, description="Shape → the shape whose weight it may not exceed."
    )
    correctives: dict[str, CorrectiveEntry] = Field(default_factory=dict)
    fallbacks: dict[str, list[DriveEntry]] = Field(
        default_factory=dict,
        description="Shape → those that stand in for it; the first that the rig has is taken.",
    )
    aliases: dict[str, list[str]] = Field(
        default_factory=dict, description="Shape → other names that rigs give it."
    )
