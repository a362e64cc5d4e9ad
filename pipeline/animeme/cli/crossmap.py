"""``animeme crossmap``."""

from __future__ import annotations

import json
from pathlib import Path

import click

from animeme import crossmapping
from animeme.cli import options as shared
from animeme.errors import InputError
from animeme.findings import Severity, exit_code_of


@click.command(
    "crossmap",
    epilog="Example: animeme crossmap landmarks.npz --character head/ --lines takes/ "
    "--output mapped/ && animeme train mapped/ --output hero.animeme",
)
@click.argument("landmarks", type=click.Path(path_type=Path))
@click.option(
    "--character",
    required=True,
    type=click.Path(path_type=Path),
    help="Folder of its shapes: <shape>.obj, one neutral.obj, vertex_indices.json.",
)
@click.option(
    "--output", required=True, type=click.Path(path_type=Path), help="Folder of the dataset."
)
@click.option(
    "--lines",
    type=click.Path(path_type=Path),
    help="Folder of recordings, transcripts and timings to link into the dataset.",
)
@click.option(
    "--keys",
    default="auto",
    show_default=True,
    help="Key lip shapes: auto, none, or a CSV file (take, time_s, a column per control).",
)
@click.option("--symmetric", is_flag=True, help="Move both sides of the mouth alike.")
@click.option(
    "--depth",
    default=0.25,
    show_default=True,
    type=click.FloatRange(0, 1),
    help="Weight of motion to and from the camera.",
)
@click.option(
    "--ridge",
    default=0.01,
    show_default=True,
    type=click.FloatRange(0, 1000),
    help="How strongly weights are kept small.",
)
@click.option(
    "--motion-rate-hz",
    type=click.FloatRange(0, min_open=True),
    help="Frames per second, where the landmarks do not say.",
)
@shared.fail_on
@click.option("--json", "as_json", is_flag=True, help="Print the summary as JSON on stdout.")
def command(
    landmarks: Path,
    character: Path,
    output: Path,
    lines: Path | None,
    keys: str,
    symmetric: bool,
    depth: float,
    ridge: float,
    motion_rate_hz: float | None,
    fail_on: str,
    as_json: bool,
) -> int:
    """Map the tracked lips in LANDMARKS to a character's controls, from 0 to 1.

    LANDMARKS is an .npz of many takes, a .csv of one, or a folder of these, numbered as MediaPipe's
    face mesh or iBUG's 68 points; all of one speaker before one camera. The head's own motion is
    removed. Each take becomes <id>.csv; frames in which points were lost are gaps.
    """
    if not landmarks.exists():
        raise InputError(
            "landmarks-missing", "there is no such file or folder", place=str(landmarks),
            action="Name an .npz, a .csv, or a folder of .csv files.",
        )  # fmt: skip
    found = crossmapping.crossmap(
        landmarks, character, output, lines=lines, rate_hz=motion_rate_hz, keys=keys,
        symmetric=symmetric, depth=depth, ridge=ridge,
    )  # fmt: skip
    for finding in found.findings:
        where = f"{finding.line}: " if finding.line else ""
        click.echo(f"{where}{finding}", err=True)
    keyed = f"{found.keys} key shapes stay {found.key_residual:.4f} from it; " * bool(found.keys)
    click.echo(
        f"{len(found.files)} takes, {found.frames} frames, {found.gaps} of them gaps, "
        f"{len(found.controls)} controls. Of the tracked lips, {keyed}the character stays "
        f"{found.residual:.4f} (1 = the distance between the eyes). Wrote {output}.",
        err=True,
    )
    if found.worst:
        listed = ", ".join(f"{name} {value:.3f}" for name, value in [*found.worst.items()][:3])
        click.echo(f"Least well mapped: {listed}", err=True)
    if as_json:
        click.echo(json.dumps(found.to_json(), ensure_ascii=False, indent=1))
    return exit_code_of(found.findings, Severity.parse(fail_on))
