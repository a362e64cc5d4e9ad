"""Recordings whose names bear their language: ``EN_line01.wav``, ``line01_de.wav``."""

from __future__ import annotations

import re
from collections import defaultdict
from pathlib import Path
from typing import Literal

from animeme.dialogue import Groups, Line, composed, files_below, lines_of_files
from animeme.findings import Finding, Severity
from animeme.languages import find_tag, is_common

Where = Literal["prefix", "suffix"]
_SIGNS = re.compile(r"[\s._-]+")


def find_affixed(
    root: Path,
    where: Where,
    characters: tuple[str, ...],
    *,
    language: str = "",
    without: Path | None = None,
) -> tuple[tuple[Line, ...], tuple[Finding, ...]]:
    """Lines below ``root/[character/]``, sorted by key.

    Args:
        root: the folder.
        where: the language stands before or after the name.
        characters: names of the job's characters.
        language: of files whose names bear none; "" leaves them out.
        without: a folder that is left out.

    Returns:
        The lines, and a warning if files were left out.
    """
    known = {composed(name): name for name in characters}
    groups: Groups = defaultdict(list)
    left: list[Path] = []
    for file in files_below(root, root, without):
        *folders, stem = file.relative_to(root).with_suffix("").parts
        tag, name = _split(composed(stem), where)
        if not tag and not language:
            left.append(file)
            continue
        character = known.get(composed(folders[0]), "") if folders else ""
        parts = (*folders[1:], name) if character else (*folders, name)
        groups[tag or language, character, composed("/".join(parts))].append(str(file))
    return lines_of_files(groups), tuple(_left(left, where) if left else ())


def _split(stem: str, where: Where) -> tuple[str, str]:
    """Tag and name, the tag of up to three parts (``zh_Hans_CN``); ("", stem) if there is none."""
    cuts = list(_SIGNS.finditer(stem))
    ordered = cuts[:3][::-1] if where == "prefix" else cuts[-3:]
    for cut in ordered:
        head, tail = stem[: cut.start()], stem[cut.end() :]
        affix, name = (head, tail) if where == "prefix" else (tail, head)
        if name and is_common(affix):
            return find_tag(affix) or "", name
    return "", stem


def _left(files: list[Path], where: Where) -> tuple[Finding, ...]:
    names = ", ".join(file.name for file in files[:3]) + (" …" if len(files) > 3 else "")
    return (
        Finding(
            Severity.WARNING,
            "language-missing",
            f"{len(files)} files have no language as the {where} of their names: {names}",
            place=str(files[0].parent),
            action="Rename them, or add `language` to the job's [dialogue].",
        ),
    )
