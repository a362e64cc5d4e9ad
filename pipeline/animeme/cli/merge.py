"""``animeme merge``."""

from __future__ import annotations

from pathlib import Path

import click

from animeme import api
from animeme.cli import options as shared
from animeme.cli.progress import progress
from animeme.cli.run import end_run
from animeme.executors.choice import Kind, place
from animeme.job import read_job


@click.command("merge", epilog="Example: animeme merge job.toml --cache /mnt/farm/animeme")
@click.argument("job", type=click.Path(path_type=Path))
@click.option(
    "--output", type=click.Path(path_type=Path), help="Output folder in place of the job's."
)
@shared.executor
@shared.fail_on
@click.option("--speak", is_flag=True, help="The shards were run with --speak.")
@shared.cache
@click.option("--json", "as_json", is_flag=True, help="Print the report as JSON on stdout.")
def command(
    job: Path,
    output: Path | None,
    workers: int | None,
    executor: Kind,
    scheduler: str | None,
    fail_on: str,
    speak: bool,
    cache: Path | None,
    as_json: bool,
) -> int:
    """Write the files and reports of a JOB whose lines were done by `animeme run --shard`.

    It takes them from the store that the shards filled. Lines that are not there, since a shard
    died or a line failed through no fault of its own, are done now. Files and reports are those of
    a single run.
    """
    folder = output or read_job(job, check=False).output
    with progress("lines", "assets") as listener:
        report = api.run(
            job,
            output=folder,
            executor=executor,
            workers=workers,
            scheduler=scheduler,
            fail_on=fail_on,
            speak=speak,
            cache=cache,
            listener=listener,
        )
    missing = report.effort.lines - report.effort.known_lines
    if missing:
        click.echo(f"{missing} lines were in no shard's results, and were done now.", err=True)
    where = place(executor, workers, scheduler)
    return end_run(report, folder, where, as_json)
