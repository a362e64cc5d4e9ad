"""``animeme lexicon``."""

from __future__ import annotations

import json
from collections.abc import Iterable
from pathlib import Path

import click
from rich.console import Console
from rich.markup import escape
from rich.table import Table

from animeme import registry
from animeme.dialogue import Line, find_lines
from animeme.errors import InputError
from animeme.files import write_text
from animeme.findings import Severity, exit_code_of
from animeme.job import read_job
from animeme.preflight import dialogue_of
from animeme.vocabulary import Survey

# More words than this are not shown on a terminal; --json and --output have all.
SHOWN_WORDS = 40


@click.command(
    "lexicon", epilog="Example: animeme lexicon sample_assets/dialogue --output names.lex"
)
@click.argument("paths", nargs=-1, required=True, type=click.Path(path_type=Path))
@click.option(
    "--lexicon",
    type=click.Path(path_type=Path),
    help="Your lexicon: words in it are known.",
)
@click.option(
    "--output",
    type=click.Path(path_type=Path),
    help="Write the words with proposed pronunciations to this new file, to review.",
)
@click.option("--json", "as_json", is_flag=True, help="Print the result as JSON on stdout.")
def command(
    paths: tuple[Path, ...], lexicon: Path | None, output: Path | None, as_json: bool
) -> int:
    """List words that no lexicon and no dictionary has, before any recording is touched.

    Each PATH is a dialogue folder (<language>/[character/]<line>.txt) or a job file. Exit code 1 if
    a transcript cannot be read or a word cannot be pronounced.
    """
    if output is not None and output.exists():
        raise InputError(
            "output-exists",
            "is there already",
            place=str(output),
            action="Choose another name: a reviewed lexicon would be lost.",
        )
    lines = [line for path in paths for line in _lines(path)]
    survey: Survey = registry.stage("survey-words")(lines, lexicon)
    if output is not None:
        write_text(output, survey.to_lexicon())
    for finding in survey.findings:
        click.echo(str(finding), err=True)
    if as_json:
        click.echo(json.dumps(survey.to_document(), ensure_ascii=False, indent=1))
    else:
        _show(survey)
    if output is not None:
        click.echo(f"Wrote {output}: check every line of it.", err=True)
    return exit_code_of(survey.findings, Severity.ERROR)


def _lines(path: Path) -> Iterable[Line]:
    if path.is_dir():
        lines = find_lines(path, ())
        if lines:
            return lines
        raise InputError(
            "dialogue-empty",
            "there is no line below this folder",
            place=str(path),
            action="It holds <language>/<line>.txt, each beside its recording.",
        )
    if path.suffix.lower() == ".toml":
        return dialogue_of(read_job(path))[0]
    raise InputError(
        "dialogue-missing",
        "is neither a dialogue folder nor a job file",
        place=str(path),
        action="Name a folder that holds <language>/<line>.txt, or a job's .toml.",
    )


def _show(survey: Survey) -> None:
    console = Console()
    console.print(
        f"{survey.lines} lines, {survey.words} words, {survey.vocabulary} different, "
        f"{len(survey.unknown)} in no lexicon or dictionary",
        highlight=False,
    )
    if not survey.unknown:
        return
    table = Table("language", "word", "count", "pronunciation", "lines")
    for word in survey.unknown[:SHOWN_WORDS]:
        table.add_row(
            word.language,
            escape(word.word),
            str(word.count),
            escape(" | ".join(word.pronunciations)) or "[red]unknown[/red]",
            escape(", ".join(word.lines[:2])) + (" …" if len(word.lines) > 2 else ""),
        )
    console.print(table)
    rest = len(survey.unknown) - SHOWN_WORDS
    if rest > 0:
        console.print(f"and {rest} more: --json and --output have them all", highlight=False)
