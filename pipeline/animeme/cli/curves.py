"""``animeme curves``."""

from __future__ import annotations

import json
import math
from pathlib import Path

import click
from rich.console import Console
from rich.markup import escape
from rich.table import Table

from animeme import registry
from animeme.cli import options as shared
from animeme.curves import CurveSet, drop_still
from animeme.documents import suggestion
from animeme.errors import InputError
from animeme.rig import BoundRig
from animeme.timing import FrameRate

_ASSET = click.argument("asset", type=click.Path(path_type=Path))


@click.group("curves", epilog="Example: animeme curves list out/sample/en/ada.glb --json")
def command() -> None:
    """List the animations of an asset, or write one as a curve file."""


@command.command("list", epilog="Example: animeme curves list out/sample/en/ada.glb")
@_ASSET
@click.option("--json", "as_json", is_flag=True, help="Print the result as JSON on stdout.")
def list_(asset: Path, as_json: bool) -> None:
    """List the animations of ASSET that move blendshapes."""
    found = _animations(asset)
    entries = [
        {
            "name": name,
            "start_s": float(curves.times_s[0]),
            "end_s": curves.duration_s,
            "keys": len(curves.times_s),
            "shapes": list(curves.names),
        }
        for name, curves in found.items()
    ]
    if as_json:
        document = {"asset": str(asset), "animations": entries}
        click.echo(json.dumps(document, ensure_ascii=False, indent=1))
        return
    table = Table("animation", "ends at", "keys", "shapes")
    for name, curves in found.items():
        times = f"{curves.duration_s:.3f} s", str(len(curves.times_s))
        table.add_row(escape(name), *times, str(len(curves.names)))
    Console().print(table)


@command.command(
    "export",
    epilog="Example: animeme curves export out/sample/en/ada.glb --line boat --format csv "
    "--output boat.csv",
)
@_ASSET
@click.option("--line", required=True, help="The animation's name; `animeme curves list` has them.")
@click.option("--format", "kind", required=True, help="livelink-csv, csv, json or npz.")
@click.option("--output", type=click.Path(path_type=Path), required=True, help="File to write.")
@click.option(
    "--frame-rate",
    help="Keys on the frames of this rate: 23.976, 24, 25, 29.97, 29.97df, 30, 48, 60 …; "
    "livelink-csv has 60 a second without.",
)
@click.option(
    "--shift-s",
    type=float,
    default=0.0,
    show_default=True,
    help="Move all keys: minus the pre-roll gives the recording's time.",
)
@click.option("--rig", default="auto", show_default=True, help="A shipped profile, or a file.")
@click.option("--json", "as_json", is_flag=True, help="Print the result as JSON on stdout.")
def export(
    asset: Path,
    line: str,
    kind: str,
    output: Path,
    frame_rate: str | None,
    shift_s: float,
    rig: str,
    as_json: bool,
) -> None:
    """Write one animation of ASSET as a curve file."""
    kinds = registry.stage("curve-files")()
    if kind not in kinds:
        raise click.BadParameter(suggestion(kind, kinds), param_hint="--format")
    rate = _rate(frame_rate)
    curves = _chosen(_animations(asset), line, asset)
    if not math.isfinite(shift_s):
        raise click.BadParameter("is no number of seconds", param_hint="--shift-s")
    if shift_s:
        curves = CurveSet(curves.times_s + shift_s, curves.names, curves.weights)
    if rate is not None:
        curves = _on_frames(curves, rate)
    if output.exists() and output.resolve() == asset.resolve():
        raise InputError(
            "output-is-input", "is read, and would be written", place=str(output),
            action="Choose another name.",
        )  # fmt: skip
    findings = registry.stage("write-curves")(
        curves, output, kind, rig=_bound(asset, rig), frame_rate=rate
    )
    for finding in findings:
        click.echo(str(finding), err=True)
    if as_json:
        document = {"output": str(output), "shapes": list(curves.names)}
        click.echo(json.dumps(document, ensure_ascii=False, indent=1))
    else:
        click.echo(f"Wrote {output}: {len(curves.names)} curves.", err=True)


def _animations(asset: Path) -> dict[str, CurveSet]:
    """Every animation's curves that leave the rest pose."""
    form = registry.format_of(asset)
    rest = form.load(asset, within=shared.anywhere(asset)).rest_weights()
    found = form.read_animations(asset)
    return {name: drop_still([curves], rest, [])[0] for name, curves in found.items()}


def _chosen(found: dict[str, CurveSet], line: str, asset: Path) -> CurveSet:
    if line in found:
        return found[line]
    raise InputError(
        "animation-unknown",
        f"has no animation '{line}' that moves blendshapes",
        place=str(asset),
        action=suggestion(line, found),
    )


def _rate(text: str | None) -> FrameRate | None:
    try:
        return None if text is None else FrameRate.parse(text)
    except ValueError as error:
        raise click.BadParameter(str(error), param_hint="--frame-rate") from None


def _on_frames(curves: CurveSet, rate: FrameRate) -> CurveSet:
    times_s = rate.times_s(max(curves.duration_s, 0.0))
    return CurveSet(times_s, curves.names, curves.sample(times_s))


def _bound(asset: Path, rig: str) -> BoundRig | None:
    """The rig; None if it is of no known family, for then shapes go by their own names."""
    try:
        character = registry.format_of(asset).load(asset, within=shared.anywhere(asset))
        bound: BoundRig = registry.stage("bind-rig")(rig, character, Path())
    except InputError as error:
        if error.code != "rig-unknown":
            raise
        return None
    return bound
