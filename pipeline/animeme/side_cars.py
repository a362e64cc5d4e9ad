"""Files by hand beside a recording: ``<line>.curves.csv``, ``<line>.<character>.edits.toml``."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import replace
from pathlib import Path

from animeme.dialogue import Line, SideCar, composed
from animeme.files import walk
from animeme.findings import Finding, Severity

# What the files' names end in → what they are.
SUFFIXES = {
    ".curves.csv": "curves",
    ".curves.json": "curves",
    ".curves.npz": "curves",
    ".edits.toml": "edits",
    ".edits.json": "edits",
}
_Key = tuple[Path, str]


def with_side_cars(
    root: Path, lines: Sequence[Line], characters: Iterable[str]
) -> tuple[tuple[Line, ...], tuple[Finding, ...]]:
    """Give each line the files by hand that lie beside it.

    Args:
        root: the dialogue folder.
        lines: the lines below it.
        characters: names of the job's characters.

    Returns:
        The lines, and a warning for each file that belongs to none of them.
    """
    files = [*_files(root)]
    if not files:
        return tuple(lines), ()
    owners: dict[_Key, list[int]] = defaultdict(list)
    for number, line in enumerate(lines):
        owners[line.audio.parent, composed(line.audio.stem)].append(number)
    names = {composed(name): name for name in characters}
    found: dict[int, list[SideCar]] = defaultdict(list)
    strays: list[Finding] = []
    for path, stem, kind in files:
        character = ""
        numbers = owners.get((path.parent, stem), [])
        head, _, tail = stem.rpartition(".")
        if not numbers and tail in names:
            character, numbers = names[tail], owners.get((path.parent, head), [])
        for number in numbers:
            found[number].append(SideCar(kind, path, character))
        if not numbers:
            strays.append(_stray(path, kind))
    return (
        tuple(_owned(line, found[number]) if number in found else line
              for number, line in enumerate(lines)),
        tuple(strays),
    )  # fmt: skip


def _files(root: Path) -> Iterator[tuple[Path, str, str]]:
    """Path, name without suffix, and kind of every file by hand, sorted; nothing hidden."""
    endings = tuple(SUFFIXES)
    for folder, names in walk(str(root)):
        for name in (name for name in names if name.lower().endswith(endings)):
            suffix = next(ending for ending in endings if name.lower().endswith(ending))
            yield Path(folder, name), composed(name[: -len(suffix)]), SUFFIXES[suffix]


def _owned(line: Line, side_cars: list[SideCar]) -> Line:
    """The line with its files; two that would take each other's place are an error of its own."""
    findings = list(line.findings)
    files: dict[tuple[str, str], list[str]] = defaultdict(list)
    for car in side_cars:
        files[car.kind, car.character].append(car.path.name)
    for (kind, _), several in files.items():
        if len(several) > 1:
            message = f"has {len(several)} files of {kind}: {', '.join(several)}"
            action = "Keep one of them."
            findings.append(Finding(Severity.ERROR, "line-duplicate", message, action=action))
    ordered = sorted(side_cars, key=lambda car: (car.character != "", car.path))
    return replace(line, side_cars=tuple(ordered), findings=tuple(findings))


def _stray(path: Path, kind: str) -> Finding:
    return Finding(
        Severity.WARNING,
        f"{kind}-without-line",
        f"there is no line that these {kind} could be for",
        place=str(path),
        action=f"Name it <line>.{kind}.… or <line>.<character>.{kind}.…, beside its recording.",
    )


def drawn(line: Line, character: str) -> Path | None:
    """A line's curves by hand for a character, its own before those for all; None for a model's."""
    found = line.files_of("curves", character)
    return found[-1] if found else None
