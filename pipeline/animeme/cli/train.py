"""``animeme train``."""

from __future__ import annotations

import json
import time
from pathlib import Path
from typing import Any

import click

from animeme import registry, training
from animeme.cli import options as shared
from animeme.cli.dataset_options import dataset_options, read
from animeme.cli.progress import parts
from animeme.dataset import Dataset
from animeme.errors import InputError
from animeme.findings import Finding, Severity, exit_code_of
from animeme.phones import ARPABET_TO_IPA, SILENCE


@click.command(
    "train", epilog="Example: animeme train takes/ --model dam --output hero.animeme --set depth=4"
)
@click.argument("dataset", type=click.Path(path_type=Path))
@click.argument("more", nargs=-1, metavar="")
@click.option("--model", default="dam", show_default=True, help="A registered model.")
@click.option(
    "--output", required=True, type=click.Path(path_type=Path), help="Model document to write."
)
@click.option(
    "--set",
    "options",
    multiple=True,
    metavar="KEY=VALUE",
    help="An option of the model; more may follow.",
)
@dataset_options
@shared.fail_on
@click.option("--json", "as_json", is_flag=True, help="Print the summary as JSON on stdout.")
def command(
    dataset: Path,
    more: tuple[str, ...],
    model: str,
    output: Path,
    options: tuple[str, ...],
    fail_on: str,
    as_json: bool,
    **given: Any,
) -> int:
    """Fit a model to DATASET: a folder of <id>.<audio>, <id>.txt and <id>.csv.

    The CSV has time_s and a column per control; Live Link Face's files are read too. A TextGrid
    <id>.TextGrid is used in place of aligning. A line that cannot be used is reported, and left
    out. The document goes into a job as [model] file.
    """
    if output.is_dir():
        raise InputError(
            "output-unwritable", "is a folder", place=str(output), action="Name a file."
        )
    # Before any line is read: a wrong option should not cost minutes.
    kind = registry.model_type(model)
    unfitted = kind.configured(training.parse_options([*options, *more]))
    lines = read(dataset, **given)
    started = time.perf_counter()
    with parts() as listener:
        fitted = unfitted.fit(lines, listener=listener)
    took_s = time.perf_counter() - started
    training.save_model(fitted, output)
    findings = (*lines.findings, *getattr(fitted, "findings_", ()))
    for finding in findings:
        where = f"{finding.line}: " if finding.line else ""
        click.echo(f"{where}{finding}", err=True)
    summary = _summary(lines, findings)
    click.echo(
        f"{summary['lines']} lines, {summary['duration_s']:.0f} s, {summary['frames']} frames, "
        f"{len(lines.controls)} controls; fitted {model} in {took_s:.1f} s. Wrote {output} "
        f"({output.stat().st_size / 1000:.0f} kB).",
        err=True,
    )
    if summary["phones_lacking"]:
        lacking = ", ".join(summary["phones_lacking"])
        click.echo(f"English phones that the data lacks: {lacking}", err=True)
    if as_json:
        effort = {"model": model, "output": str(output), "train_s": took_s}
        click.echo(json.dumps({**effort, **summary}, ensure_ascii=False, indent=1))
    return exit_code_of(findings, Severity.parse(fail_on))


def _summary(lines: Dataset, findings: tuple[Finding, ...]) -> dict[str, Any]:
    """What the data has and lacks."""
    counts: dict[str, int] = {}
    for line in lines.lines:
        for symbol in line.track.ipa():
            counts[symbol] = counts.get(symbol, 0) + 1
    english = all(line.track.inventory == "arpabet" for line in lines.lines)
    expected = ARPABET_TO_IPA.values() if english else ()
    return {
        "lines": len(lines.lines),
        "frames": lines.frames,
        "duration_s": lines.duration_s,
        "controls": list(lines.controls),
        "phones": dict(sorted(counts.items())),
        "phones_lacking": [s for s in expected if s not in counts and s != SILENCE],
        "findings": [finding.to_json() for finding in findings],
    }
