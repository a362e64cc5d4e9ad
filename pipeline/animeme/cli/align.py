"""``animeme align``."""

from __future__ import annotations

import json
from pathlib import Path

import click
from rich.console import Console
from rich.markup import escape
from rich.table import Table

from animeme import api, registry
from animeme.contracts import Alignment


@click.command(
    "align", epilog='Example: animeme align hello.wav hello.txt · animeme align hello.wav "Hello"'
)
@click.argument("audio", type=click.Path(path_type=Path))
@click.argument("text")
@click.option("--language", default="en", show_default=True, help="BCP-47 tag.")
@click.option("--aligner", default="pocketsphinx", show_default=True, help="A registered aligner.")
@click.option(
    "--lexicon", type=click.Path(path_type=Path), help="Pronunciations that go before all others."
)
@click.option(
    "--output",
    type=click.Path(path_type=Path),
    help="Write the alignment to this file as well, in the --format.",
)
@click.option(
    "--format",
    "form",
    default="textgrid",
    show_default=True,
    help="textgrid, ctm, phone-ctm, rhubarb-tsv or alignment.",
)
@click.option("--json", "as_json", is_flag=True, help="Print the alignment document on stdout.")
def command(
    audio: Path,
    text: str,
    language: str,
    aligner: str,
    lexicon: Path | None,
    output: Path | None,
    form: str,
    as_json: bool,
) -> int:
    """Find when each word and phone of TEXT is spoken in AUDIO.

    TEXT is the transcript's file, or the words themselves.
    """
    transcript = Path(text)
    if transcript.suffix.lower() in (".txt", ".lab"):
        text = registry.stage("read-transcript")(transcript)
    alignment = api.align(audio, text, language=language, aligner=aligner, lexicon=lexicon)
    if output is not None:
        registry.stage("write-timings")(alignment.track, output, form)
    for finding in alignment.findings:
        click.echo(str(finding), err=True)
    if as_json:
        click.echo(json.dumps(alignment.track.to_document(), ensure_ascii=False, indent=1))
    else:
        Console().print(_table(alignment))
    return 0


def _table(alignment: Alignment) -> Table:
    """A row per word, with its phones."""
    track = alignment.track
    table = Table("start", "end", "word", "phones")
    for word in track.words:
        inside = [p for p in track.phones if word.start_s <= p.start_s < word.end_s]
        phones = " ".join(f"{escape(p.symbol)}[dim]{p.start_s:.2f}[/dim]" for p in inside)
        table.add_row(f"{word.start_s:.3f}", f"{word.end_s:.3f}", escape(word.text), phones)
    return table
