"""Folders of empty recordings, and lists of them."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

from animeme.findings import Finding
from animeme.gathering import Dialogue, DialogueSource, gather


def folder_of(root: Path, files: Sequence[str]) -> Path:
    """A folder with these files, which hold one byte each."""
    root.mkdir(parents=True, exist_ok=True)
    for name in files:
        path = root / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_bytes(b"x")
    return root


def gathered(folder: Path, data: str | bytes, name: str = "lines.csv", **how: Any) -> Dialogue:
    """What is found where a file of this content lists the recordings in `folder`."""
    path = folder / name
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_bytes(data.encode() if isinstance(data, str) else data)
    characters = how.pop("characters", None)
    return gather(DialogueSource(how.pop("root", None), (path,), **how), characters)


def spoken(found: Dialogue, folder: Path) -> dict[str, tuple[str, str | None]]:
    """Line → recording below the folder, and text."""
    return {
        line.key: (line.audio.relative_to(folder).as_posix(), line.text) for line in found.lines
    }


def codes(findings: Sequence[Finding]) -> list[str]:
    """Their codes, in order."""
    return [finding.code for finding in findings]
