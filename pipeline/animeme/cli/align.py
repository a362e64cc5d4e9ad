"""``animeme align``."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import click
from rich.console import Console
from rich.markup import escape
from rich.table import Table

from animeme import registry
from animeme.aligning import DEFAULT_LANGUAGE, AlignReport
from animeme.cli import options as shared
from animeme.cli.progress import progress
from animeme.contracts import Alignment
from animeme.dialogue import TEXT_SUFFIXES, kind_of, voice_path
from animeme.errors import InputError
from animeme.executors.choice import Kind
from animeme.executors.inline import InlineExecutor
from animeme.findings import LineStatus, Severity, exit_code_of
from animeme.speech import align, align_folder
from animeme.work import cpu_s

# More lines than this are not shown on a terminal; --json has all.
SHOWN_LINES = 20
STATUSES: tuple[LineStatus, ...] = ("ok", "review", "failed")


@click.command(
    "align",
    epilog='Example: animeme align hello.wav hello.txt · animeme align hello.wav "Hello" · '
    "animeme align dialogue --output timings --json",
)
@click.argument("audio", type=click.Path(path_type=Path))
@click.argument("text", required=False)
@click.option(
    "--language",
    help="BCP-47 tag. By default each language's own in a dialogue folder, and en elsewhere.",
)
@shared.aligner
@shared.lexicon
@click.option(
    "--voices",
    type=click.Path(path_type=Path),
    help="What `animeme voice` learned: a folder of voices, or one voice for all lines.",
)
@click.option(
    "--output",
    type=click.Path(path_type=Path),
    help="Write the alignment to this file as well, in the --format; of a folder, to this folder.",
)
@shared.timing_format
@click.option(
    "--plot",
    type=click.Path(path_type=Path, file_okay=False),
    metavar="FOLDER",
    help="Draw waveform, words, phones and findings of each line: FOLDER/<line>.png.",
)
@shared.executor
@shared.fail_on
@click.option(
    "--json",
    "as_json",
    is_flag=True,
    help="Print the alignment, or a folder's report, as JSON on stdout.",
)
def command(
    audio: Path,
    text: str | None,
    language: str | None,
    aligner: str,
    lexicon: Path | None,
    voices: Path | None,
    output: Path | None,
    form: str,
    plot: Path | None,
    workers: int | None,
    executor: Kind,
    scheduler: str | None,
    fail_on: str,
    as_json: bool,
) -> int:
    """Find when each word and phone of TEXT is spoken in AUDIO.

    TEXT is a file of its transcript or timings, or the words themselves. If AUDIO is a folder,
    every recording below it is aligned with the transcript or the timings beside it.
    """
    if not audio.is_dir():
        if text is None and not audio.exists():
            raise InputError(
                "audio-missing",
                "there is no such recording or folder",
                place=str(audio),
                action="Check its name.",
            )
        if text is None:
            raise click.UsageError("Give the TEXT that is spoken in AUDIO, or its file.")
        return _one(
            audio,
            text,
            language=DEFAULT_LANGUAGE if language is None else language,
            aligner=aligner,
            lexicon=lexicon,
            voices=voices,
            output=output,
            form=form,
            plot=plot,
            fail_on=fail_on,
            as_json=as_json,
        )
    if text is not None:
        raise click.UsageError("A folder's lines have their texts beside them: leave out TEXT.")
    with progress() as listener:
        report = align_folder(
            audio,
            output=output,
            format=form,
            language=language,
            aligner=aligner,
            lexicon=lexicon,
            voices=voices,
            plot=plot,
            executor=executor,
            workers=workers,
            scheduler=scheduler,
            fail_on=fail_on,
            listener=listener,
        )
    # The command's whole cost, its start included; its workers have ended.
    if executor != "dask":
        report = replace(report, cpu_s=cpu_s(InlineExecutor()))
    if as_json:
        click.echo(json.dumps(report.to_document(), ensure_ascii=False, indent=1))
    _summarize(report, plot, to_stderr=as_json)
    return report.exit_code


def _one(
    audio: Path,
    text: str,
    *,
    language: str,
    aligner: str,
    lexicon: Path | None,
    voices: Path | None,
    output: Path | None,
    form: str,
    plot: Path | None,
    fail_on: str,
    as_json: bool,
) -> int:
    registry.stage("timings-suffix")(form)  # before the work, not after it
    file: Path | None = Path(text)
    if kind_of(Path(text)) in ("timings", "mouth shapes"):
        said = None
    else:
        file, said = None, text
        if Path(text).suffix.lower() in TEXT_SUFFIXES:
            said = registry.stage("read-transcript")(Path(text))
    if voices is not None and voices.is_dir():
        voices = voice_path(voices, language, "")
    alignment = align(
        audio,
        said,
        timings=file,
        language=language,
        aligner=aligner,
        lexicon=lexicon,
        voice=voices,
    )
    if output is not None:
        registry.stage("write-timings")(alignment.track, output, form)
    if plot is not None:
        picture = plot / f"{audio.stem}.png"
        draw = registry.stage("plot-alignment")
        draw(audio, alignment.track, alignment.findings, picture, title=audio.name)
        click.echo(f"Wrote {picture}.", err=True)
    for finding in alignment.findings:
        click.echo(str(finding), err=True)
    if as_json:
        click.echo(json.dumps(alignment.track.to_document(), ensure_ascii=False, indent=1))
    else:
        Console().print(_table(alignment))
    return exit_code_of(alignment.findings, Severity.parse(fail_on))


def _summarize(report: AlignReport, plot: Path | None, *, to_stderr: bool) -> None:
    """Counts, the worst lines and why, and where the timings and their pictures are."""
    bad = [line for line in report.lines if line.status != "ok"]
    bad.sort(key=lambda line: line.status != "failed")
    for line in bad[:SHOWN_LINES]:
        click.echo(f"{line.status:<7} {line.id}", err=to_stderr)
        for finding in line.findings:
            if finding.severity > Severity.INFO:
                click.echo(f"        {finding}", err=to_stderr)
    if len(bad) > SHOWN_LINES:
        click.echo(f"and {len(bad) - SHOWN_LINES} more: --json has them all", err=to_stderr)
    counts = ", ".join(f"{report.count(status)} {status}" for status in STATUSES)
    click.echo(
        f"{len(report.lines)} lines, {report.audio_s:.1f} s of audio: {counts}; "
        f"{report.cpu_s:.1f} CPU-seconds.",
        err=to_stderr,
    )
    written = sum(line.output is not None for line in report.lines)
    if plot is not None:
        click.echo(f"Pictures of the lines are in '{plot}'.", err=to_stderr)
    elif report.output is None:
        click.echo("Nothing was written: --output names a folder for timings.", err=to_stderr)
    if report.output is not None:
        click.echo(f"Timings of {written} lines are in '{report.output}'.", err=to_stderr)


def _table(alignment: Alignment) -> Table:
    """A row per word, with its phones."""
    track = alignment.track
    table = Table("start", "end", "word", "phones")
    for word in track.words:
        inside = [p for p in track.phones if word.start_s <= p.start_s < word.end_s]
        phones = " ".join(f"{escape(p.symbol)}[dim]{p.start_s:.2f}[/dim]" for p in inside)
        table.add_row(f"{word.start_s:.3f}", f"{word.end_s:.3f}", escape(word.text), phones)
    return table
