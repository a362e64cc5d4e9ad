"""The lines that an argument of a command names."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path

from animeme.dialogue import Line, find_lines, find_lines_of
from animeme.errors import InputError
from animeme.job import read_job
from animeme.preflight import dialogue_of


def lines_of(path: Path, language: str | None = None) -> Iterable[Line]:
    """The lines of a dialogue folder or a job file.

    Args:
        path: the folder or file.
        language: only those of this language; of a folder without one for it, all that it holds.

    Raises:
        InputError: it is neither, or there is no line.
    """
    if path.is_dir():
        lines: Iterable[Line] = find_lines(path, ())
        if language is not None:
            in_it = [line for line in lines if line.language == language]
            lines = in_it or find_lines_of(path, language)
        if lines:
            return lines
        raise InputError(
            "dialogue-empty",
            "there is no line below this folder",
            place=str(path),
            action="It holds <language>/<line>.txt, each beside its recording.",
        )
    if path.suffix.lower() == ".toml":
        lines = dialogue_of(read_job(path))[0]
        return [line for line in lines if language in (None, line.language)]
    raise InputError(
        "dialogue-missing",
        "is neither a dialogue folder nor a job file",
        place=str(path),
        action="Name a folder that holds <language>/<line>.txt, or a job's .toml.",
    )
