"""``animeme doctor``."""

from __future__ import annotations

import json
import platform
from importlib.metadata import PackageNotFoundError, metadata, requires, version
from typing import Any

import click
from packaging.requirements import Requirement
from rich.console import Console
from rich.markup import escape
from rich.table import Table

from animeme import registry
from animeme.documents import suggestion
from animeme.errors import PluginError

# What each extra adds, in the words of someone who lacks it.
_EXTRAS = {
    "chinese": "Mandarin Chinese",
    "dask": "runs on a cluster of machines",
    "espeak": "all but English, Chinese, Japanese; speech for lines without a recording",
    "japanese": "Japanese",
    "video": "the sound of MP4, M4A and QuickTime files, and films of lines",
    "all": "every optional part",
    "dev": "tools to work on animeme itself",
}


@click.command("doctor", epilog="Example: animeme doctor --json")
@click.option("--json", "as_json", is_flag=True, help="Print the result as JSON on stdout.")
def command(as_json: bool) -> int:
    """Say what is installed, which extras are missing and what they would add.

    Exit code 3 if a plug-in fails to load.
    """
    found = examine()
    if as_json:
        click.echo(json.dumps(found, ensure_ascii=False, indent=1))
    else:
        _show(found)
    return 3 if any(plugin["problem"] for plugin in found["plugins"]) else 0


def examine() -> dict[str, Any]:
    """What is installed: versions, extras, plug-ins and what is wrong with each."""
    needed = [Requirement(text) for text in requires("animeme") or ()]
    extras: list[str] = metadata("animeme").get_all("Provides-Extra") or []
    core = [requirement for requirement in needed if requirement.marker is None]
    return {
        "animeme": version("animeme"),
        "python": platform.python_version(),
        "core": {requirement.name: _version(requirement.name) for requirement in core},
        "extras": [_extra(name, needed) for name in extras],
        "plugins": [
            _plugin(plugin)
            for group in (*registry.GROUPS, *registry.strange_groups())
            for plugin in registry.plugins(group).values()
        ],
    }


def _extra(name: str, needed: list[Requirement]) -> dict[str, Any]:
    own = [r for r in needed if r.marker and r.marker.evaluate({"extra": name})]
    lacking = [r.name for r in own if r.name != "animeme" and _version(r.name) is None]
    for requirement in own:
        if requirement.name == "animeme":  # an extra made of others
            parts = [_extra(part, needed) for part in sorted(requirement.extras)]
            lacking += [package for part in parts for package in part["lacking"]]
    return {
        "extra": name,
        "installed": not lacking,
        "lacking": lacking,
        "adds": _EXTRAS.get(name, ""),
        "install": f"pip install 'animeme[{name}]'",
    }


def _plugin(plugin: registry.Plugin) -> dict[str, str]:
    problem = ""
    try:
        if plugin.group in registry.SUBJECTS:
            registry.check_of(plugin)
        elif plugin.group in registry.GROUPS:
            plugin.load()
        else:
            problem = "animeme has no such group of plug-ins, so it is never used. "
            problem += suggestion(plugin.group, registry.GROUPS)
    except PluginError as error:
        problem = error.problem
    return {
        "group": plugin.group,
        "name": plugin.name,
        "distribution": plugin.distribution,
        "problem": problem,
    }


def _version(distribution: str) -> str | None:
    try:
        return version(distribution)
    except PackageNotFoundError:
        return None


def _show(found: dict[str, Any]) -> None:
    console = Console()
    console.print(f"animeme {found['animeme']}, Python {found['python']}")
    core = ", ".join(f"{name} {number or 'MISSING'}" for name, number in found["core"].items())
    console.print(f"Core: {core}", highlight=False)
    extras = Table("extra", "installed", "adds", "to install")
    for extra in found["extras"]:
        install = "" if extra["installed"] else escape(extra["install"])
        extras.add_row(
            extra["extra"], "yes" if extra["installed"] else "no", extra["adds"], install
        )
    console.print(extras)
    plugins = Table("kind", "plug-ins")
    for group in dict.fromkeys((*registry.GROUPS, *(p["group"] for p in found["plugins"]))):
        names = [
            f"{p['name']} ({p['distribution']})" + (f": {p['problem']}" if p["problem"] else "")
            for p in found["plugins"]
            if p["group"] == group
        ]
        plugins.add_row(group.removeprefix("animeme."), escape(", ".join(names)))
    console.print(plugins)
