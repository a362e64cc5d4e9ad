"""``animeme schema``."""

from __future__ import annotations

import json

import click

import animeme_schemas


@click.command("schema", epilog="Example: animeme schema job > job.schema.json")
@click.argument("kind", required=False)
@click.option("--json", "as_json", is_flag=True, help="Without KIND: list the kinds as JSON.")
def command(kind: str | None, as_json: bool) -> int:
    """Print the JSON Schema of a KIND of document; without KIND, list the kinds."""
    kinds = animeme_schemas.kinds()
    if kind is None:
        names = [f"animeme.{name}/{number}" for name, number in kinds]
        click.echo(json.dumps(names) if as_json else "\n".join(names))
        return 0
    name, _, text = kind.removeprefix("animeme.").partition("/")
    newest = max((version for known, version in kinds if known == name), default=0)
    number = int(text) if text.isdecimal() else 0 if text else newest
    if (name, number) not in kinds:
        known = ", ".join(dict.fromkeys(known for known, _ in kinds))
        raise click.UsageError(f"there is no document kind '{kind}'. Known: {known}.")
    click.echo(animeme_schemas.text(name, number), nl=False)
    return 0
