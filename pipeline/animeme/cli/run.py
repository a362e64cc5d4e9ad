"""``animeme run``."""

from __future__ import annotations

import json
from pathlib import Path

import click
from rich.console import Console
from rich.markdown import Markdown

from animeme import api
from animeme.cli import options as shared
from animeme.cli.progress import progress
from animeme.executors.local import default_workers
from animeme.job import read_job


@click.command("run", epilog="Example: animeme run sample_assets/job.toml --output /tmp/spoken")
@click.argument("job", type=click.Path(path_type=Path))
@click.option(
    "--output", type=click.Path(path_type=Path), help="Output folder in place of the job's."
)
@shared.workers
@shared.executor
@shared.fail_on
@click.option(
    "--speak", is_flag=True, help="Let espeak-ng speak transcripts that have no recording."
)
@click.option("--json", "as_json", is_flag=True, help="Print the report as JSON on stdout.")
def command(
    job: Path,
    output: Path | None,
    workers: int | None,
    executor: str,
    fail_on: str,
    speak: bool,
    as_json: bool,
) -> int:
    """Run JOB: align its dialogue, animate its characters, write and check the assets.

    The output folder gets <language>/<character>.glb (and .usdc), <character>.usda with a variant
    per language, alignments/, curves/ if the job exports them, speech/ with what was spoken,
    report.json, summary.md and run.jsonl.
    """
    folder = output or read_job(job).output
    with progress("lines", "assets") as listener:
        report = api.run(
            job,
            output=folder,
            executor="inline" if executor == "inline" else "local",
            workers=workers,
            fail_on=fail_on,
            speak=speak,
            listener=listener,
        )
    summary = (folder / "summary.md").read_text(encoding="utf-8")
    console = Console(stderr=True)
    if console.is_terminal:
        console.print(Markdown(summary))
    else:
        click.echo(summary, err=True)
    audio_s = sum({line.line: line.audio_s for line in report.lines}.values())
    processes = 1 if executor == "inline" else workers or default_workers()
    click.echo(
        f"{len(report.lines)} lines in {report.wall_s:.1f} s on {processes} processors, "
        f"{report.cpu_s:.1f} CPU-seconds for {audio_s:.1f} s of audio. Everything is in {folder}.",
        err=True,
    )
    if as_json:
        document = json.loads((folder / "report.json").read_text(encoding="utf-8"))
        effort = {"output": str(folder), "wall_s": report.wall_s, "cpu_s": report.cpu_s}
        click.echo(json.dumps({**document, **effort}, ensure_ascii=False, indent=1))
    return report.exit_code
