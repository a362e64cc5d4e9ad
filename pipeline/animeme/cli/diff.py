"""``animeme diff``."""

from __future__ import annotations

import json
import math
from pathlib import Path

import click

from animeme.diffing import DiffReport, diff

# More would not be read; --json has them all.
MOST_SHOWN = 40


@click.command("diff", epilog="Example: animeme diff golden/out out --tolerance 0.01")
@click.argument("a", type=click.Path(path_type=Path))
@click.argument("b", type=click.Path(path_type=Path))
@click.option(
    "--tolerance",
    type=click.FloatRange(min=0.0),
    default=0.0,
    show_default=True,
    metavar="T",
    help="The difference of a weight that is accepted, in weight units.",
)
@click.option("--json", "as_json", is_flag=True, help="Print the result as JSON on stdout.")
def command(a: Path, b: Path, tolerance: float, as_json: bool) -> int:
    """Compare the curves of two runs, A and B, line by line: a gate for changes.

    A and B are output folders of runs, two assets (GLB, glTF, VRM, USD) or two curve files (CSV,
    JSON, NPZ). Exit code 1 if a weight differs by more than T at any time, or if one has a line or
    a shape that the other has not.
    """
    if not math.isfinite(tolerance):
        raise click.BadParameter("is no number of weight units", param_hint="--tolerance")
    report = diff(a, b, tolerance=tolerance)
    if as_json:
        click.echo(json.dumps(report.to_document(), ensure_ascii=False, indent=1))
    _tell(report, to_stderr=as_json)
    return report.exit_code


def _tell(report: DiffReport, *, to_stderr: bool) -> None:
    lines = [f"{entry.file}: cannot be read in {_side(entry.side)}: {entry.problem}"
             for entry in report.unread]  # fmt: skip
    lines += [
        f"{entry.file}: {f'{entry.animation}: ' if entry.animation else ''}only in "
        f"{_side(entry.side)}"
        for entry in report.alone
    ]
    lines += map(str, report.beyond)
    for line in lines[:MOST_SHOWN]:
        click.echo(line, err=to_stderr)
    if len(lines) > MOST_SHOWN:
        click.echo(f"and {len(lines) - MOST_SHOWN} more: --json has them all", err=to_stderr)
    within = [entry for entry in report.differences if not entry.beyond and entry.largest > 0]
    if within:
        click.echo(f"within the tolerance, the largest: {within[0]}", err=to_stderr)
    totals = report.to_document()["totals"]
    click.echo(
        f"{totals['compared']} animations compared: {totals['beyond']} differ by more than "
        f"{report.tolerance:g}, {totals['only_a']} only in A, {totals['only_b']} only in B, "
        f"{totals['unread']} unreadable.",
        err=to_stderr,
    )


def _side(side: str) -> str:
    return side.upper()
