"""``animeme merge``."""

from __future__ import annotations

from pathlib import Path

import click

from animeme.cli import options as shared
from animeme.cli.running import Order, run_and_tell
from animeme.executors.choice import Kind
from animeme.selection import Selection


@click.command("merge", epilog="Example: animeme merge job.toml --cache /mnt/farm/animeme")
@click.argument("job", type=click.Path(path_type=Path))
@click.option(
    "--output", type=click.Path(path_type=Path), help="Output folder in place of the job's."
)
@shared.executor
@shared.fail_on
@click.option("--speak", is_flag=True, help="The shards were run with --speak.")
@shared.cache
@shared.selection
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
    selection: Selection,
    as_json: bool,
) -> int:
    """Write the files and reports of a JOB whose lines were done by `animeme run --shard`.

    It takes them from the store that the shards filled. Lines that are not there, since a shard
    died or a line failed through no fault of its own, are done now. Files and reports are those of
    a single run.
    """
    order = Order(
        job, output, workers, executor, scheduler, fail_on, speak, cache, selection, as_json
    )
    report, code = run_and_tell(order)
    if report is not None and (missing := report.effort.lines - report.effort.known_lines):
        click.echo(f"{missing} lines were in no shard's results, and were done now.", err=True)
    return code
