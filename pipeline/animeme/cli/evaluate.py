"""``animeme evaluate``."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import click
from rich.console import Console
from rich.markup import escape
from rich.table import Table

from animeme import registry, training
from animeme.cli.dataset_options import dataset_options, read
from animeme.cli.progress import parts
from animeme.errors import InputError
from animeme.findings import Severity, exit_code_of
from animeme.scoring import Closure, captured_recall


@click.command(
    "evaluate",
    epilog="Example: animeme evaluate takes/ --model dam mmm dam:degree=0,modes=none hero.animeme "
    "--holdout 0.2 --plot compared",
)
@click.argument("dataset", type=click.Path(path_type=Path))
@click.argument("more", nargs=-1, metavar="")
@click.option(
    "--model",
    "models",
    multiple=True,
    required=True,
    metavar="NAME|FILE",
    help="A registered model, perhaps with options (dam:degree=0,modes=none), or a document. "
    "More may follow, to compare.",
)
@click.option(
    "--holdout",
    default=0.2,
    show_default=True,
    type=click.FloatRange(0, 1, min_open=True, max_open=True),
    help="Part of the lines that models are judged by and not fitted to.",
)
@click.option(
    "--closure",
    default="lip_gap<=0.02",
    show_default=True,
    help="When a mouth counts as closed: control<=value.",
)
@click.option(
    "--plot",
    type=click.Path(path_type=Path),
    help="Draw captured against modelled curves of one line: PLOT.png and PLOT.html.",
)
@dataset_options
@click.option("--json", "as_json", is_flag=True, help="Print the scores as JSON on stdout.")
def command(
    dataset: Path,
    more: tuple[str, ...],
    models: tuple[str, ...],
    holdout: float,
    closure: str,
    plot: Path | None,
    as_json: bool,
    **given: Any,
) -> int:
    """Compare models on DATASET: fit them to a part of its lines, judge them by the others.

    Models named by file are judged as they are; they should not have seen the held-out lines, which
    are the same for the same files and --holdout.
    """
    closed = _closure(closure)
    lines = read(dataset, **given)
    for finding in lines.findings:
        where = f"{finding.line}: " if finding.line else ""
        click.echo(f"{where}{finding}", err=True)
    with parts() as listener:
        compared = training.evaluate(
            lines, [*models, *more], held_out=holdout, closure=closed, listener=listener
        )
    held = lines.subset(compared.lines)
    own = captured_recall(held, closed)
    speaker = "" if own is None else f"; the speaker himself closes {own:.1%} of his bilabials"
    click.echo(
        f"Fitted to {compared.fitted_lines} lines, judged by {len(compared.lines)}{speaker}.",
        err=True,
    )
    if plot is not None:
        for path in registry.stage("plot-comparison")(compared, lines.controls, plot):
            click.echo(f"Wrote {path}.", err=True)
    if as_json:
        click.echo(json.dumps(compared.to_json(), ensure_ascii=False, indent=1))
    else:
        Console().print(_table(compared, lines.controls))
    return exit_code_of(lines.findings, Severity.ERROR)


def _closure(text: str) -> Closure:
    control, found, value = text.partition("<=")
    try:
        if found and control.strip():
            return Closure(control.strip(), float(value))
    except ValueError:
        pass
    raise InputError(
        "closure-option", f"{text!r} is not control<=value", place="--closure",
        action="Write, for example, lip_gap<=0.02.",
    )  # fmt: skip


def _table(compared: training.Comparison, controls: tuple[str, ...]) -> Table:
    shown = controls[:6]
    table = Table("model", *shown, "closed", "training", "µs per phone")
    for name, score in compared.scores.items():
        errors = ["–" if score.rmse[c] is None else f"{score.rmse[c]:.4f}" for c in shown]
        recall = "–" if score.closure_recall is None else f"{score.closure_recall:.1%}"
        train = "–" if score.train_s is None else f"{score.train_s:.1f} s"
        table.add_row(escape(name), *errors, recall, train, f"{score.synthesis_us_per_phone:.0f}")
    return table
