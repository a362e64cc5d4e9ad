"""Documents and their schemas."""

from __future__ import annotations

from typing import Any

import jsonschema

import animeme_schemas


def validate(kind: str, document: dict[str, Any]) -> None:
    """Assert that a document keeps to its schema."""
    jsonschema.Draft202012Validator(animeme_schemas.load(kind)).validate(document)
