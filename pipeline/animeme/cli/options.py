"""Options that several commands have, said once."""

from __future__ import annotations

from pathlib import Path

import click

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
executor = click.option(
    "--executor",
    type=click.Choice(["local", "inline"]),
    default="local",
    show_default=True,
    help="local: supervised processes; inline: in this one, for debugging.",
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
rehash = click.option(
    "--rehash", is_flag=True, help="Read every file, whether or not it looks as it did."
)
