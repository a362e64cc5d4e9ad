"""What a kind of damage is, and what it is done to."""

from __future__ import annotations

import random
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

from animeme import registry
from animeme.contracts import LineAnimation
from animeme.files import anywhere


class Unsuitable(Exception):  # noqa: N818  no error: another kind is taken
    """A file has nothing that could be damaged in this way."""


@dataclass(frozen=True)
class Output:
    """A file that animeme delivered.

    Attributes:
        path: the file.
        source: what it was made from.
        layout: of its character.
        others: files of the same character and language with other lines.
        languages: folders of the delivery.
    """

    path: Path
    source: Path
    layout: str
    others: Sequence[Path]
    languages: Sequence[str]


@dataclass(frozen=True)
class Kind:
    """A kind of damage.

    Attributes:
        codes: any of them says what is wrong.
        apply: puts the damaged file at the path that it is given, or elsewhere, or nowhere.
    """

    codes: frozenset[str]
    apply: Callable[[Output, Path, random.Random], None]


def kind(codes: str, apply: Callable[[Output, Path, random.Random], None]) -> Kind:
    """A kind of damage, its codes in one text."""
    return Kind(frozenset(codes.split()), apply)


def lines_of(output: Output) -> list[LineAnimation]:
    """The lines of a file that animeme delivered."""
    form = registry.format_of(output.path)
    notes = {
        t.animation: t.note
        for t in form.stored(form.load(output.path, within=anywhere(output.path)))
        if t.note
    }  # type: ignore[attr-defined]
    return [
        LineAnimation(
            str(notes[name]["line"]), str(notes[name]["language"]), curves,
            float(notes[name]["duration_s"]),
        )
        for name, curves in form.read_animations(output.path).items()
        if name in notes
    ]  # fmt: skip


def rewritten(output: Output, target: Path, lines: Sequence[LineAnimation]) -> None:
    """The source with `lines`, in the output's layout."""
    form = registry.format_of(output.source)
    character = form.load(output.source)
    form.for_layout(output.layout, character).write(character, lines, target)
