"""Phone bigrams: import, coverage, seeding and tracing of sets; import the functions from here.

A set is an ``animeme.bigrams`` document: curves that an animator draws for pairs of phones. A job
takes one as its ``[model] file``.
"""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from animeme import registry
from animeme.dataset import Listener, no_listener
from animeme.dialogue import Line
from animeme.files import write_text
from animeme.findings import Finding
from animeme.phones import PhoneTrack
from animeme.training import load_model

DEFAULT_SET = "facefx"
OWN_CONTROLS = "controls"
"""In place of a set of poses: each control of the model is a pose."""


@dataclass(frozen=True)
class MissingPair:
    """A pair of phones that a dialogue has and a set lacks.

    Attributes:
        pair: "first|second", classes of the set.
        count: how often it is said.
        lines: keys of the lines that it is in, each once, in order.
        like: the entry that moves for it, "" if nothing does.
        example: a word, or two with a blank, in which it is first said; "" next to a pause.
    """

    pair: str
    count: int
    lines: tuple[str, ...]
    like: str
    example: str


@dataclass(frozen=True)
class Coverage:
    """What a dialogue asks of a set.

    Attributes:
        lines: how many were read.
        pairs: how many pairs they have, those with the pauses at their ends among them.
        different: how many different ones.
        covered: how many of `pairs` the set has.
        missing: the most frequent first.
        findings: transcripts and words that could not be read.
    """

    lines: int
    pairs: int
    different: int
    covered: int
    missing: tuple[MissingPair, ...]
    findings: tuple[Finding, ...]

    @property
    def share(self) -> float:
        """Part of the pairs, as often as they are said, that the set has; 1 if there are none."""
        return self.covered / self.pairs if self.pairs else 1.0

    def to_document(self) -> dict[str, Any]:
        """For programs."""
        return {
            "lines": self.lines,
            "pairs": self.pairs,
            "different": self.different,
            "covered": self.covered,
            "share": round(self.share, 6),
            "missing": [
                {
                    "pair": entry.pair,
                    "count": entry.count,
                    "share": round(entry.count / self.pairs, 6),
                    "like": entry.like,
                    "example": entry.example,
                    "lines": list(entry.lines),
                }
                for entry in self.missing
            ],
            "findings": [finding.to_json() for finding in self.findings],
        }


@dataclass(frozen=True)
class Seeded:
    """A new set, and how near it comes to its model.

    Attributes:
        document: an ``animeme.bigrams`` document.
        rmse: control → root of the mean squared difference from the model.
        correlation: control → with the model; None where one of the two does not move.
        findings: poses that the model cannot fill.
    """

    document: dict[str, Any]
    rmse: dict[str, float]
    correlation: dict[str, float | None]
    findings: tuple[Finding, ...]


def import_bigrams(
    file: str | Path,
    *,
    phones: Mapping[str, str] | None = None,
    poses: str | None = None,
    source: str = "",
    licence: str = "",
) -> tuple[dict[str, Any], tuple[Finding, ...]]:
    """A published curve set as an ``animeme.bigrams`` document.

    Args:
        file: JSON with ``{"diphones": {"l|ow": {"open": [[t, weight], …]}}}``.
        phones: name in the file → common class, for names that say nothing.
        poses: set that gives the poses their controls; a shipped one is found if None.
        source, licence: of the curves, kept in the document.

    Returns:
        The document, and findings about what could not be taken over.

    Raises:
        InputError: the file is no such set, or nothing in it can be used.
    """
    found: tuple[dict[str, Any], tuple[Finding, ...]] = registry.stage("import-bigrams")(
        Path(file), phones=phones or {}, poses=poses, source=source, licence=licence
    )
    return found


def cover_bigrams(
    lines: Sequence[Line], bigrams: str = DEFAULT_SET, *, lexicon: str | Path | None = None
) -> Coverage:
    """Pairs of phones that the transcripts of `lines` have and a set lacks.

    No recording is touched: phones are those of each word's first pronunciation, words follow each
    other without a pause, and a pause is before and after each line.

    Args:
        lines: whose transcripts.
        bigrams: shipped name or file of the set.
        lexicon: pronunciations that go before all others.

    Raises:
        InputError: the set or the lexicon is broken.
    """
    own = Path(lexicon) if lexicon is not None else None
    found: Coverage = registry.stage("cover-bigrams")(lines, bigrams, own)
    return found


def seed_bigrams(
    model: str | Path,
    *,
    poses: str = "facefx-poses",
    output: str | Path | None = None,
    listener: Listener = no_listener,
) -> Seeded:
    """A set of every pair of phones that moves like a model, for animators to start from.

    Args:
        model: a registered name or a document.
        poses: shipped name or file of the set that gives poses, phone classes and conflicts, or
            "controls" for the model's own controls.
        output: file to write.
        listener: told of progress.

    Raises:
        InputError: the model or the poses cannot be used, or the file cannot be written.
    """
    base: str | None = None if poses == OWN_CONTROLS else poses
    if base is not None and output is not None and Path(base).suffix:
        # Relative to the document that extends it.
        base = os.path.relpath(Path(base).resolve(), Path(output).resolve().parent)
        base = Path(base).as_posix()
    found: Seeded = registry.stage("seed-bigrams")(
        load_model(model), None if poses == OWN_CONTROLS else poses, base, listener
    )
    if output is not None:
        save_bigrams(found.document, output)
    return found


def trace_bigrams(track: PhoneTrack, bigrams: str = DEFAULT_SET) -> dict[str, Any]:
    """The keys of every pose in a line, each with the bigram that it comes from.

    Args:
        track: the line's phones.
        bigrams: shipped name or file of the set.

    Raises:
        InputError: the set is broken.
    """
    found: dict[str, Any] = registry.stage("trace-bigrams")(bigrams, track)
    return found


def save_bigrams(document: Mapping[str, Any], path: str | Path) -> None:
    """Write an ``animeme.bigrams`` document, a line for each pose of a pair.

    Raises:
        InputError: the file cannot be written.
    """
    write_text(Path(path), registry.stage("bigrams-text")(document))
