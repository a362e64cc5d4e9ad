"""Options that several commands have, said once."""

from __future__ import annotations

from collections.abc import Callable
from functools import wraps
from pathlib import Path
from typing import Any

import click

from animeme.executors.choice import KINDS
from animeme.selection import Selection, read_changed

fail_on = click.option(
    "--fail-on",
    type=click.Choice(["info", "warning", "error"]),
    default="error",
    show_default=True,
    help="Severity of a finding that makes the exit code 1.",
)
workers = click.option(
    "--workers", type=click.IntRange(1), help="Processes; all processors by default."
)


def _scheduler(context: click.Context, _: click.Parameter, value: str | None) -> str | None:
    """The address, which goes with some of the options before it and not with others."""
    given = context.params
    if value is not None and given["executor"] != "dask":
        raise click.UsageError("--scheduler goes with --executor dask.")
    if value is not None and given["workers"] is not None:
        raise click.UsageError("A --scheduler has workers of its own: leave out --workers.")
    return value


def executor(command: Callable[..., Any]) -> Callable[..., Any]:
    """Add the options that say who does the work: --workers, --executor, --scheduler."""
    for option in reversed(_EXECUTOR):
        command = option(command)
    return command


_EXECUTOR = (
    click.option(
        "--workers",
        type=click.IntRange(1),
        is_eager=True,
        help="Processes; all processors by default.",
    ),
    click.option(
        "--executor",
        type=click.Choice(KINDS),
        default="local",
        show_default=True,
        is_eager=True,
        help="local: supervised processes; inline: in this one, for debugging; dask: on a cluster.",
    ),
    click.option(
        "--scheduler",
        metavar="ADDRESS",
        callback=_scheduler,
        help="Of the Dask cluster, tcp://HOST:8786; without it, one of this machine is started.",
    ),
)
aligner = click.option(
    "--aligner", default="pocketsphinx", show_default=True, help="A registered aligner."
)
lexicon = click.option(
    "--lexicon", type=click.Path(path_type=Path), help="Pronunciations that go before all others."
)
timing_format = click.option(
    "--format",
    "form",
    default="textgrid",
    show_default=True,
    help="textgrid, ctm, phone-ctm, rhubarb-tsv or alignment.",
)
cache = click.option(
    "--cache",
    type=click.Path(path_type=Path),
    help="Folder of results that runs share, in place of the job's.",
)
no_cache = click.option("--no-cache", is_flag=True, help="Do everything anew, and keep nothing.")
_SELECTION = (
    click.option(
        "--language",
        "languages",
        multiple=True,
        help="Only lines in this language, a tag or a name; may be repeated, as the next three.",
    ),
    click.option("--character", "characters", multiple=True, help="Only what this character says."),
    click.option(
        "--lines",
        "patterns",
        multiple=True,
        metavar="GLOB",
        help="Only lines whose key or id fits, as 'act1/*'.",
    ),
    click.option(
        "--changed",
        multiple=True,
        type=click.Path(path_type=Path, allow_dash=True),
        metavar="LIST",
        help="Only lines that this file names by key or file (as `git diff --name-only` does; - is "
        "standard input), or that the review page's marks say to fix (.json, .csv).",
    ),
)


def selection(command: Callable[..., Any]) -> Callable[..., Any]:
    """Add the options that say which lines are wanted; the command is given one `selection`.

    It raises InputError if a list of changes cannot be read.
    """

    @wraps(command)
    def selecting(
        *,
        languages: tuple[str, ...],
        characters: tuple[str, ...],
        patterns: tuple[str, ...],
        changed: tuple[Path, ...],
        **others: Any,
    ) -> Any:
        names = tuple(name for path in changed for name in read_changed(path))
        chosen = Selection(languages, characters, patterns, names if changed else None)
        return command(selection=chosen, **others)

    given: Callable[..., Any] = selecting
    for option in reversed(_SELECTION):
        given = option(given)
    return given


rehash = click.option(
    "--rehash", is_flag=True, help="Read every file, whether or not it looks as it did."
)
