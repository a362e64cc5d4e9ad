"""What `animeme run` and `animeme merge` have in common: run, and tell how it went."""

from __future__ import annotations

import json
import os
import sys
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

import click

from animeme.batch import run
from animeme.cli.progress import Teller, progress
from animeme.executors.choice import Kind, place
from animeme.findings import RunReport, Severity
from animeme.job import read_job
from animeme.selection import Selection

# More would not be read; --json has them all.
MOST_SHOWN = 40
EXIT_STOPPED = 130
# What GitHub takes of a step; more than that, and it shows nothing at all.
MOST_STEP_SUMMARY_BYTES = 1024 * 1024


@dataclass(frozen=True)
class Order:
    """What was asked for on the command line; members as of `animeme.run`."""

    job: Path
    output: Path | None
    workers: int | None
    executor: Kind
    scheduler: str | None
    fail_on: str
    speak: bool
    cache: Path | Literal[False] | None
    selection: Selection
    as_json: bool
    rehash: bool = False
    shard: str | None = None

    @property
    def folder(self) -> Path:
        """The output folder."""
        return self.output or read_job(self.job, check=False).output


def run_and_tell(order: Order) -> tuple[RunReport | None, int]:
    """Run, and tell people and programs how it ended.

    Returns:
        The report, None if somebody stopped it, and the exit code.
    """
    folder = order.folder
    with progress() as teller:
        try:
            report = run(
                order.job,
                output=folder,
                executor=order.executor,
                workers=order.workers,
                scheduler=order.scheduler,
                fail_on=order.fail_on,
                speak=order.speak,
                cache=order.cache,
                rehash=order.rehash,
                shard=order.shard,
                listener=teller,
                selection=order.selection,
            )
        except KeyboardInterrupt:
            stopped = EXIT_STOPPED
        except SystemExit as end:  # a scheduler asked for it
            stopped = end.code if isinstance(end.code, int) else EXIT_STOPPED
        else:
            stopped = 0
    if stopped:
        click.echo(_stopped(teller, kept=order.cache is not False), err=True)
        return None, stopped
    effort = effort_of(report, place(order.executor, order.workers, order.scheduler))
    if order.shard is not None:
        _tell_shard(report, order.shard, effort, order.as_json)
    else:
        _tell(report, folder, effort, order.as_json)
    return report, report.exit_code


def _stopped(teller: Teller, *, kept: bool) -> str:
    """What is said of a run that somebody stopped."""
    done = [
        f"{event.done} of {event.total} {stage}"
        f"{f' ({event.failed} failed)' if event.failed and stage == 'lines' else ''}"
        for stage, event in teller.last.items()
    ]
    if not done:
        return "Stopped before anything was done."
    again = "the same command goes on from there" if kept else "--no-cache keeps nothing of it"
    return f"Stopped: {' and '.join(done)} are done; {again}."


def _tell(report: RunReport, folder: Path, effort: str, as_json: bool) -> None:
    try:
        summary = (folder / "summary.md").read_text(encoding="utf-8")
    except FileNotFoundError:  # there was no room even for that
        summary = "\n".join(map(str, report.findings[:MOST_SHOWN]))
    _show(summary)
    click.echo(f"{effort} Everything is in {folder}.", err=True)
    if step_summary := os.environ.get("GITHUB_STEP_SUMMARY"):
        _add_to_step(Path(step_summary), f"{summary}\n{effort}\n")
    if as_json and (folder / "report.json").is_file():
        document = json.loads((folder / "report.json").read_text(encoding="utf-8"))
        document = {**document, **_figures(report), "output": str(folder)}
        click.echo(json.dumps(document, ensure_ascii=False, indent=1))


def effort_of(report: RunReport, where: str) -> str:
    """What a run took, in a few sentences."""
    effort = report.effort
    factor = f", {report.real_time_factor:.1f} times real time" if report.wall_s else ""
    known = (
        f"{effort.known_lines} of {effort.lines} lines and {effort.known_files} of "
        f"{effort.files} files were there already."
    )
    steps = ", ".join(
        f"{step} {seconds:.1f} s{_hits(report, step)}" for step, seconds in effort.step_s.items()
    )
    return (
        f"{len(report.lines)} lines in {report.wall_s:.1f} s on {where}, "
        f"{report.cpu_s:.1f} CPU-seconds for {report.audio_s:.1f} s of audio{factor}. {known}"
        f"{f' CPU time by step: {steps}.' if steps else ''}"
    )


def _hits(report: RunReport, step: str) -> str:
    made, found = report.effort.step_results.get(step, (0, 0))
    return f" ({found} of {made + found} from the store)" if found else ""


def _figures(report: RunReport) -> dict[str, Any]:
    """What `--json` says beyond the report; how many lines there are, that says itself."""
    return {name: value for name, value in report.figures().items() if name != "lines"}


def _tell_shard(report: RunReport, shard: str, effort: str, as_json: bool) -> None:
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
    click.echo(f"Shard {shard}: {said}. {effort}", err=True)
    if as_json:
        document = {"shard": shard, "exit_code": report.exit_code, "totals": counts}
        click.echo(json.dumps({**document, **_figures(report)}, indent=1))


def _add_to_step(path: Path, text: str) -> None:
    """Append to the page that GitHub shows of a step, as far as there is room on it."""
    try:
        room = MOST_STEP_SUMMARY_BYTES - (path.stat().st_size if path.exists() else 0)
        data = text.encode()
        if len(data) > room:
            end = "\n\n… `summary.md` has the rest.\n".encode()
            data = data[: max(0, room - len(end))].rpartition(b"\n")[0] + end
            data = data if len(data) <= room else b""
        with path.open("ab") as stream:
            stream.write(data)
    except OSError as error:  # the run itself is none the worse
        click.echo(f"The step's summary cannot be written: {path}: {error}", err=True)


def _show(summary: str) -> None:
    """The summary on stderr, set in type where there is a terminal."""
    if not sys.stderr.isatty():
        click.echo(summary, err=True)
        return
    from rich.console import Console  # takes its time
    from rich.markdown import Markdown

    Console(stderr=True).print(Markdown(summary))
