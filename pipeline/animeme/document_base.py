"""What all documents are made of."""

from __future__ import annotations

from typing import Annotated

from pydantic import BaseModel, ConfigDict, Field

Seconds = Annotated[float, Field(ge=0, allow_inf_nan=False, strict=True)]
Number = Annotated[float, Field(allow_inf_nan=False, strict=True)]


class Document(BaseModel):
    """Base of all documents: frozen, and strangers among the members are errors."""

    model_config = ConfigDict(extra="forbid", frozen=True, populate_by_name=True)
