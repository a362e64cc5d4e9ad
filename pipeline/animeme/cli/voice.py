"""``animeme voice``."""

from __future__ import annotations

import json
from pathlib import Path

import click

from animeme.cli import options as shared
from animeme.cli.progress import progress
from animeme.executors.choice import Kind
from animeme.speech import learn_voices
from animeme.voices import VoicesReport


@click.command("voice", epilog="Example: animeme voice job.toml · animeme voice dialogue -o voices")
@click.argument("path", type=click.Path(path_type=Path))
@click.option(
    "--output",
    "-o",
    type=click.Path(path_type=Path),
    help="Folder of the voices; by default the job's [align] voices.",
)
@click.option("--language", help="BCP-47 tag of a whole folder, as for `animeme align`.")
@click.option("--aligner", help="A registered aligner; by default the job's, or else pocketsphinx.")
@shared.lexicon
@shared.executor
@shared.fail_on
@click.option("--json", "as_json", is_flag=True, help="Print the result as JSON on stdout.")
def command(
    path: Path,
    output: Path | None,
    language: str | None,
    aligner: str | None,
    lexicon: Path | None,
    workers: int | None,
    executor: Kind,
    scheduler: str | None,
    fail_on: str,
    as_json: bool,
) -> int:
    """Learn how each speaker sounds, to align their lines with more certainty.

    PATH is a job file or a folder of recordings with their transcripts. Lines in doubt are left
    out. `animeme align --voices` and a job's [align] voices use what was learned.
    """
    with progress() as listener:
        report = learn_voices(
            path,
            output=output,
            language=language,
            aligner=aligner,
            lexicon=lexicon,
            executor=executor,
            workers=workers,
            scheduler=scheduler,
            fail_on=fail_on,
            listener=listener,
        )
    if as_json:
        click.echo(json.dumps(report.to_json(), ensure_ascii=False, indent=1))
    _summarize(report, to_stderr=as_json)
    return report.exit_code


def _summarize(report: VoicesReport, *, to_stderr: bool) -> None:
    for voice in report.voices:
        if voice.output is not None and voice.learned is not None:
            learned = voice.learned
            refused = f", {learned.refused} in doubt left out" if learned.refused else ""
            said = f"{learned.lines} lines, {learned.audio_s:.0f} s{refused}"
            click.echo(f"{voice.output}: {said}", err=to_stderr)
        for finding in voice.findings:
            click.echo(str(finding), err=to_stderr)
