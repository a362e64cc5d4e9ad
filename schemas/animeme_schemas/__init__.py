"""JSON Schemas of every document animeme reads or writes.

The files are generated from `animeme.documents` by ``make schemas``; a test keeps them true.
"""

from __future__ import annotations

import json
from importlib.resources import files
from typing import Any

_FOLDER = files(__name__)


def kinds() -> list[tuple[str, int]]:
    """Kind and version of every document, sorted."""
    names = (
        file.name.removesuffix(".schema.json")
        for file in _FOLDER.iterdir()
        if file.name.endswith(".schema.json")
    )
    return sorted((kind, int(number)) for kind, _, number in (n.rpartition(".") for n in names))


def text(kind: str, number: int | None = None) -> str:
    """The schema of ``animeme.<kind>/<number>`` as it is stored; the newest if no number is given.

    Raises:
        FileNotFoundError: there is no such document.
    """
    if number is None:
        number = max((n for name, n in kinds() if name == kind), default=1)
    return _FOLDER.joinpath(f"{kind}.{number}.schema.json").read_text(encoding="utf-8")


def load(kind: str, number: int | None = None) -> dict[str, Any]:
    """The same, parsed."""
    schema: dict[str, Any] = json.loads(text(kind, number))
    return schema
