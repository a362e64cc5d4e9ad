"""``animeme strip``."""

from __future__ import annotations

import json
from pathlib import Path

import click

from animeme.assets import strip


@click.command("strip", epilog="Example: animeme strip out/sample/en/ada.glb --output ada.glb")
@click.argument("file", type=click.Path(path_type=Path))
@click.option(
    "--output", type=click.Path(path_type=Path), help="Where to write; FILE itself by default."
)
@click.option("--json", "as_json", is_flag=True, help="Print the result as JSON on stdout.")
def command(file: Path, output: Path | None, as_json: bool) -> int:
    """Take animeme's animations out of FILE: what is left is its source, byte for byte.

    Needs no source: a .glb, .gltf or .vrm that animeme wrote remembers what it was. A file that
    was edited since is refused, and stays as it is.
    """
    before = file.stat().st_size if file.is_file() else 0
    taken = strip(file, output=output)
    target = output or file
    after = target.stat().st_size
    if as_json:
        document = {
            "file": str(file),
            "output": str(target),
            "animations": list(taken),
            "bytes_before": before,
            "bytes_after": after,
        }
        click.echo(json.dumps(document, ensure_ascii=False, indent=1))
    else:
        click.echo(f"{target}: {len(taken)} animations taken out, {before} → {after} bytes")
    return 0
