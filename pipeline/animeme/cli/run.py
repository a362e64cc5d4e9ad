"""``animeme run``."""

from __future__ import annotations

import json
import sys
from pathlib import Path
from typing import Literal

import click

from animeme import api
from animeme.cli import options as shared
from animeme.cli.progress import progress
from animeme.executors.choice import Kind, place
from animeme.findings import RunReport, Severity
from animeme.job import read_job
from animeme.rehearsal import Rehearsal
from animeme.runner import Shard

# More would not be read; --json has them all.
MOST_SHOWN = 40


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
    as_json: bool,
) -> int:
    """Run JOB: align its dialogue, animate its characters, write and check the assets.

    The output folder gets <language>/<character>.glb (and .usdc), <character>.usda with a variant
    per language, alignments/, curves/ if the job exports them, speech/ with what was spoken,
    report.json, summary.md and run.jsonl. What an earlier run has done already is taken up from
    the store.
    """
    if no_cache and (cache is not None or shard is not None):
        raise click.UsageError(
            "--no-cache keeps nothing, so it goes with neither --cache nor --shard."
        )
    if shard is not None and executor == "dask":
        raise click.UsageError("--shard is for farms without Dask, which shares out all lines.")
    chosen: Path | Literal[False] | None = False if no_cache else cache
    if dry_run:
        rehearsal = api.rehearse(job, output=output, speak=speak, cache=chosen, rehash=rehash)
        _show_rehearsal(rehearsal)
        if as_json:
            click.echo(json.dumps(rehearsal.to_document(), ensure_ascii=False, indent=1))
        return 0
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
            cache=chosen,
            rehash=rehash,
            shard=shard,
            listener=listener,
        )
    where = place(executor, workers, scheduler)
    if shard is not None:
        return _end_shard(report, shard, where, as_json)
    return end_run(report, folder, where, as_json)


def end_run(report: RunReport, folder: Path, where: str, as_json: bool) -> int:
    """Tell people and programs how a run ended; gives the exit code."""
    summary = folder / "summary.md"
    if summary.is_file():
        _show(summary.read_text(encoding="utf-8"))
    else:  # there was no room even for that
        for finding in report.findings[:MOST_SHOWN]:
            click.echo(str(finding), err=True)
    click.echo(f"{effort_of(report, where)} Everything is in {folder}.", err=True)
    if as_json and (folder / "report.json").is_file():
        document = json.loads((folder / "report.json").read_text(encoding="utf-8"))
        click.echo(
            json.dumps(
                {**document, **_figures(report), "output": str(folder)},
                ensure_ascii=False,
                indent=1,
            )
        )
    return report.exit_code


def effort_of(report: RunReport, where: str) -> str:
    """What a run took, in a sentence or two."""
    effort = report.effort
    factor = f", {report.audio_s / report.wall_s:.1f} times real time" if report.wall_s else ""
    known = (
        f"{effort.known_lines} of {effort.lines} lines and {effort.known_files} of "
        f"{effort.files} files were there already."
    )
    return (
        f"{len(report.lines)} lines in {report.wall_s:.1f} s on {where}, "
        f"{report.cpu_s:.1f} CPU-seconds for {report.audio_s:.1f} s of audio{factor}. {known}"
    )


def _figures(report: RunReport) -> dict[str, object]:
    """What `--json` says beyond the report: the run's own effort."""
    effort = report.effort
    return {
        "wall_s": report.wall_s,
        "cpu_s": report.cpu_s,
        "known_lines": effort.known_lines,
        "files": effort.files,
        "known_files": effort.known_files,
        "step_s": dict(effort.step_s),
    }


def _end_shard(report: RunReport, shard: str, where: str, as_json: bool) -> int:
    counts = {status: report.count(status) for status in ("ok", "review", "failed")}
    worst = sorted(
        (f for f in report.all_findings if f.severity >= Severity.WARNING),
        key=lambda finding: -finding.severity,
    )
    for finding in worst[:MOST_SHOWN]:
        click.echo(f"{finding.line or 'run'}: {finding}", err=True)
    if len(worst) > MOST_SHOWN:
        click.echo(f"… and {len(worst) - MOST_SHOWN} more", err=True)
    said = ", ".join(f"{count} {status}" for status, count in counts.items())
    click.echo(f"Shard {shard}: {said}. {effort_of(report, where)}", err=True)
    if as_json:
        document = {"shard": shard, "exit_code": report.exit_code, "totals": counts}
        click.echo(json.dumps({**document, **_figures(report)}, indent=1))
    return report.exit_code


def _show_rehearsal(rehearsal: Rehearsal) -> None:
    for line, causes in list(rehearsal.stale.items())[:MOST_SHOWN]:
        click.echo(f"{line}: {', '.join(causes)}", err=True)
    if len(rehearsal.stale) > MOST_SHOWN:
        click.echo(f"… and {len(rehearsal.stale) - MOST_SHOWN} more lines", err=True)
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


def _show(summary: str) -> None:
    """The summary on stderr, set in type where there is a terminal."""
    if not sys.stderr.isatty():
        click.echo(summary, err=True)
        return
    from rich.console import Console  # takes its time
    from rich.markdown import Markdown

    Console(stderr=True).print(Markdown(summary))
