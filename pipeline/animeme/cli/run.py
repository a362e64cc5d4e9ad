"""``animeme run``."""

from __future__ import annotations

import json
from pathlib import Path
from typing import TYPE_CHECKING

import click

from animeme.batch import rehearse
from animeme.cli import options as shared
from animeme.cli.running import MOST_SHOWN, Order, run_and_tell
from animeme.executors.choice import Kind
from animeme.selection import Selection
from animeme.shards import Shard

if TYPE_CHECKING:
    from animeme.rehearsal import Rehearsal


def _shard(_: click.Context, __: click.Parameter, value: str | None) -> str | None:
    if value is not None:
        try:
            Shard.parse(value)
        except ValueError as error:
            raise click.BadParameter(str(error)) from None
    return value


@click.command("run", epilog="Example: animeme run sample_assets/job.toml --output /tmp/spoken")
@click.argument("job", type=click.Path(path_type=Path))
@click.option(
    "--output", type=click.Path(path_type=Path), help="Output folder in place of the job's."
)
@shared.executor
@shared.fail_on
@click.option(
    "--speak", is_flag=True, help="Let espeak-ng speak transcripts that have no recording."
)
@shared.cache
@shared.no_cache
@shared.rehash
@click.option("--dry-run", is_flag=True, help="Say what would be done, and why; write nothing.")
@click.option(
    "--shard",
    metavar="I/N",
    callback=_shard,
    help="Do the I-th of N parts of the lines, for the store alone; `animeme merge` goes on.",
)
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
    no_cache: bool,
    rehash: bool,
    dry_run: bool,
    shard: str | None,
    selection: Selection,
    as_json: bool,
) -> int:
    """Run JOB: align its dialogue, animate its characters, write and check the assets.

    The output folder gets <language>/<character>.glb (and .usdc), <character>.usda with a variant
    per language, alignments/, curves/ if the job exports them, speech/ with what was spoken,
    report.json, summary.md, junit.xml, report.sarif and run.jsonl. What an earlier run has done
    already is taken up from the store.

    With --language, --character, --lines or --changed, only files that hold a line which fits are
    written. Other lines in them are as they were delivered last.
    """
    if no_cache and (cache is not None or shard is not None):
        raise click.UsageError(
            "--no-cache keeps nothing, so it goes with neither --cache nor --shard."
        )
    if shard is not None and executor == "dask":
        raise click.UsageError("--shard is for farms without Dask, which shares out all lines.")
    order = Order(
        job,
        output,
        workers,
        executor,
        scheduler,
        fail_on,
        speak,
        False if no_cache else cache,
        selection,
        as_json,
        rehash,
        shard,
    )
    return _rehearse(order) if dry_run else run_and_tell(order)[1]


def _rehearse(order: Order) -> int:
    """Say what would be done."""
    rehearsal = rehearse(
        order.job,
        output=order.output,
        speak=order.speak,
        cache=order.cache,
        rehash=order.rehash,
        selection=order.selection,
    )
    _show_rehearsal(rehearsal)
    if order.as_json:
        click.echo(json.dumps(rehearsal.to_document(), ensure_ascii=False, indent=1))
    return 0


def _show_rehearsal(rehearsal: Rehearsal) -> None:
    for line, causes in list(rehearsal.stale.items())[:MOST_SHOWN]:
        click.echo(f"{line}: {', '.join(causes)}", err=True)
    if len(rehearsal.stale) > MOST_SHOWN:
        click.echo(f"… and {len(rehearsal.stale) - MOST_SHOWN} more lines", err=True)
    for line, causes in list(rehearsal.outdated.items())[:MOST_SHOWN]:
        click.echo(f"{line}: would stay as it is ({', '.join(causes)})", err=True)
    if len(rehearsal.outdated) > MOST_SHOWN:
        click.echo(f"… and {len(rehearsal.outdated) - MOST_SHOWN} more lines", err=True)
    for file in rehearsal.unwritten[:MOST_SHOWN]:
        click.echo(f"{file}: would be written", err=True)
    if len(rehearsal.unwritten) > MOST_SHOWN:
        click.echo(f"… and {len(rehearsal.unwritten) - MOST_SHOWN} more files", err=True)
    counted = ", ".join(f"{count} {cause}" for cause, count in rehearsal.causes().items())
    click.echo(
        f"{len(rehearsal.stale)} of {rehearsal.lines} lines would be worked on"
        f"{f' ({counted})' if counted else ''}, "
        f"{len(rehearsal.unwritten)} of {rehearsal.files} files written. Nothing was.",
        err=True,
    )
