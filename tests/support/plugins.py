"""Distributions of plug-ins, as pip would have installed them."""

from __future__ import annotations

import tomllib
from pathlib import Path

PLUGINS = Path(__file__).parents[1] / "plugins"


def install(name: str, folder: Path) -> Path:
    """Install a plug-in of ``tests/plugins`` into a folder for ``PYTHONPATH``; gives the folder."""
    source = PLUGINS / name
    project = tomllib.loads((source / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    distribution = f"{project['name'].replace('-', '_')}-{project['version']}"
    info = folder / f"{distribution}.dist-info"
    info.mkdir(parents=True)
    (info / "METADATA").write_text(
        f"Metadata-Version: 2.1\nName: {project['name']}\nVersion: {project['version']}\n"
    )
    (info / "RECORD").touch()
    groups = [
        f"[{group}]\n" + "".join(f"{name} = {value}\n" for name, value in entries.items())
        for group, entries in project["entry-points"].items()
    ]
    (info / "entry_points.txt").write_text("\n".join(groups))
    for module in source.glob("*.py"):
        (folder / module.name).symlink_to(module)
    return folder
