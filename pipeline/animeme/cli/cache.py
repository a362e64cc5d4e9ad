"""``animeme cache``."""

from __future__ import annotations

import json
import re
from collections.abc import Callable
from pathlib import Path
from typing import Any

import click

from animeme.store.entries import Store
from animeme.store.index import index_path
from animeme.store.memory import default_store
from animeme.store.upkeep import collect, survey, verify

_UNITS = {"": 1, "K": 10**3, "M": 10**6, "G": 10**9, "T": 10**12}

_folder = click.option(
    "--cache",
    type=click.Path(path_type=Path),
    help="The store's folder; by default the user's own.",
)
_json = click.option("--json", "as_json", is_flag=True, help="Print the result as JSON on stdout.")


def _size(_: click.Context, __: click.Parameter, value: str | None) -> int | None:
    if value is None:
        return None
    match = re.fullmatch(r"(\d+(?:\.\d+)?)\s*([KMGT]?)B?", value.strip(), re.IGNORECASE)
    if match is None:
        raise click.BadParameter("give a number of bytes, or one with K, M, G or T, such as 20G")
    return int(float(match[1]) * _UNITS[match[2].upper()])


@click.group("cache", epilog="Example: animeme cache gc --max-size 20G")
def command() -> None:
    """Look after the store of results that runs take up again.

    Nothing in it is needed: what is not there is made again. Each command takes --json.
    """


def _answer(document: dict[str, Any], text: str, as_json: bool) -> None:
    click.echo(text, err=True)
    if as_json:
        click.echo(json.dumps(document, ensure_ascii=False, indent=1))


def _store(cache: Path | None) -> Store:
    return Store(cache or default_store())


def _shared(function: Callable[..., Any]) -> Callable[..., Any]:
    return _folder(_json(function))


@command.command("stat", epilog="Example: animeme cache stat --json")
@_shared
def stat(cache: Path | None, as_json: bool) -> int:
    """Say how much there is, and where."""
    store = _store(cache)
    found = survey(store)
    index = index_path(store.folder)
    size = index.stat().st_size if index.is_file() else 0
    document = {
        "schema": "animeme.cache/1",
        "store": str(store.folder),
        "results": found.results,
        "bytes": found.size,
        "oldest": found.oldest,
        "newest": found.newest,
        "index": str(index),
        "index_bytes": size,
    }
    text = f"{found.results} results, {shown(found.size)}, in {store.folder}"
    if found.oldest is not None:
        text += f"; used between {found.oldest} and {found.newest}"
    _answer(document, f"{text}. Index: {index}, {shown(size)}.", as_json)
    return 0


@command.command("verify", epilog="Example: animeme cache verify")
@_shared
def verify_(cache: Path | None, as_json: bool) -> int:
    """Read everything, and remove what is not what was put there; exit code 1 if there is any."""
    store = _store(cache)
    checked, damaged = verify(store)
    document = {
        "schema": "animeme.cache/1",
        "store": str(store.folder),
        "results": checked,
        "damaged": damaged,
    }
    text = f"{checked} results in {store.folder}: {len(damaged)} damaged"
    _answer(document, text + (", which are removed." if damaged else "."), as_json)
    return 1 if damaged else 0


@command.command("gc", epilog="Example: animeme cache gc --max-size 20G")
@click.option(
    "--max-size",
    callback=_size,
    default="20G",
    show_default=True,
    help="What may stay: bytes, or K, M, G or T of them.",
)
@_shared
def gc(cache: Path | None, as_json: bool, max_size: int) -> int:
    """Remove what has not been used for longest, until the rest is no larger than --max-size."""
    store = _store(cache)
    removed, freed, left = collect(store, max_size)
    document = {
        "schema": "animeme.cache/1",
        "store": str(store.folder),
        "removed": removed,
        "freed_bytes": freed,
        "bytes": left,
    }
    text = f"Removed {removed} results, {shown(freed)}; {shown(left)} left in {store.folder}."
    _answer(document, text, as_json)
    return 0


def shown(size: int) -> str:
    """A number of bytes for people."""
    for unit, scale in reversed(_UNITS.items()):
        if unit and size >= scale:
            return f"{size / scale:.1f} {unit}B"
    return f"{size} bytes"
