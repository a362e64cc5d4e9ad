"""``animeme rig``."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import click
from rich.console import Console
from rich.markup import escape
from rich.table import Table

from animeme import registry
from animeme.assets import load_character
from animeme.errors import InputError
from animeme.files import anywhere, write_text
from animeme.rig import BoundRig, Character, Drive


@click.command("rig", epilog="Example: animeme rig sample_assets/ada.glb --json")
@click.argument("asset", type=click.Path(path_type=Path))
@click.option("--rig", default="auto", show_default=True, help="A shipped profile, or a file.")
@click.option(
    "--draft",
    type=click.Path(path_type=Path),
    help="Write a profile guessed from the shapes' names to this new file, to complete by hand.",
)
@click.option("--json", "as_json", is_flag=True, help="Print the result as JSON on stdout.")
def command(asset: Path, rig: str, draft: Path | None, as_json: bool) -> int:
    """Say which profile fits ASSET, which of its shapes are mapped and which are missing."""
    character = load_character(asset, within=anywhere(asset))
    if draft is not None:
        _write_draft(character, draft)
    bound, problem = _bound(character, rig)
    if as_json:
        click.echo(json.dumps(_document(character, bound), ensure_ascii=False, indent=1))
    elif bound is not None:
        _show(character, bound)
    if problem is not None and draft is None:
        raise problem
    return 0


def _bound(character: Character, rig: str) -> tuple[BoundRig | None, InputError | None]:
    """The rig, or why there is none; only an unknown rig is an answer, other errors are raised."""
    try:
        return registry.stage("bind-rig")(rig, character, Path()), None
    except InputError as error:
        if error.code != "rig-unknown":
            raise
        return None, error


def _write_draft(character: Character, draft: Path) -> None:
    if draft.suffix.lower() != ".toml":
        raise InputError(
            "draft-not-toml",
            "would be no file that a job can name: a draft is TOML",
            place=str(draft),
            action="End its name in .toml.",
        )
    if draft.exists():
        raise InputError(
            "output-exists",
            "is there already",
            place=str(draft),
            action="Choose another name for the draft: a completed profile would be lost.",
        )
    write_text(draft, registry.stage("draft-rig")(character, draft.stem.removesuffix(".rig")))
    click.echo(f"Drafted {draft}: check every line of it.", err=True)


def _document(character: Character, bound: BoundRig | None) -> dict[str, Any]:
    return {
        "asset": str(character.source),
        "format": character.format,
        "profile": bound.profile.name if bound else None,
        "shapes": list(character.shapes),
        "mapped": dict(bound.mapped) if bound else {},
        "missing": list(bound.missing) if bound else [],
        "coverage": round(bound.coverage, 4) if bound else 0.0,
        "fallbacks": {s: _drive(d) for s, d in bound.fallbacks.items()} if bound else {},
        "binds": {n: [_drive(d) for d in drives] for n, drives in bound.binds.items()}
        if bound
        else {},
    }


def _drive(drive: Drive) -> dict[str, Any]:
    return {"shape": drive.shape, "gain": drive.gain}


def _show(character: Character, bound: BoundRig) -> None:
    console = Console()
    console.print(
        f"{character.source}: {len(character.shapes)} shapes on {len(character.meshes)} meshes, "
        f"profile {bound.profile.name}, coverage {bound.coverage:.0%}",
        markup=False,
        highlight=False,
    )
    table = Table("profile's shape", "character's shape")
    for shape, own in bound.mapped.items():
        parts = bound.binds.get(own, (Drive(own),))
        table.add_row(escape(shape), escape(" + ".join(map(_text, parts))))
    for shape in bound.missing:
        stand_in = bound.fallbacks.get(shape)
        instead = f", {escape(_text(stand_in))} instead" if stand_in else ""
        table.add_row(escape(shape), f"[dim]missing{instead}[/dim]")
    console.print(table)


def _text(drive: Drive) -> str:
    return drive.shape if drive.gain == 1.0 else f"{drive.gain:g} × {drive.shape}"
