"""Some of a dialogue's lines: those that somebody wants now."""

from __future__ import annotations

import csv
import re
import sys
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from fnmatch import translate
from pathlib import Path
from typing import Any

from animeme import documents
from animeme.dialogue import AUDIO_SUFFIXES, Line, composed
from animeme.errors import InputError
from animeme.files import unreadable
from animeme.languages import find_tag

MARKS = "animeme.marks/1"
_SUFFIXES = (*AUDIO_SUFFIXES, ".txt", ".lab")


@dataclass(frozen=True)
class Selection:
    """What is wanted; a line must satisfy each member that is not empty.

    Attributes:
        languages: tags or names; ``en`` takes ``en-US`` too.
        characters: names; a line of nobody's own is everybody's.
        patterns: globs over a line's key, or over its id alone; ``*`` matches ``/`` too.
        changed: keys, ids or paths of lines, as a list of changed files has them.
    """

    languages: tuple[str, ...] = ()
    characters: tuple[str, ...] = ()
    patterns: tuple[str, ...] = ()
    changed: tuple[str, ...] | None = None

    @property
    def everything(self) -> bool:
        """Whether no line is left out."""
        return not (self.languages or self.characters or self.patterns) and self.changed is None

    def __str__(self) -> str:
        """In people's words; "" for everything."""
        asked = [f"language {name}" for name in self.languages]
        asked += [f"character {name}" for name in self.characters]
        asked += [f"lines {glob}" for glob in self.patterns]
        if self.changed is not None:
            count = len(self.changed)
            asked.append(f"{count} {'entry' if count == 1 else 'entries'} in a list of changes")
        return ", ".join(asked)


EVERYTHING = Selection()


def select(
    lines: Sequence[Line], selection: Selection, characters: Iterable[str] = ()
) -> tuple[Line, ...]:
    """The lines that are wanted, in the same order.

    Args:
        lines: all that there are.
        selection: which of them.
        characters: who may be asked for beside those with lines of their own.

    Raises:
        InputError: something in the selection fits no line, so that it is likely misspelt. An
            empty list of changes is none.
    """
    tags = [_tag(name) for name in selection.languages]
    globs = [re.compile(translate(composed(glob))) for glob in selection.patterns]
    changed = {_bare(name) for name in selection.changed or ()}
    used: set[str] = set()
    kept: list[Line] = []
    for line in lines:
        wanted = [
            _hits(selection.languages, [_speaks(line, tag) for tag in tags], used, "language "),
            _hits(
                selection.characters,
                [composed(name) == composed(line.character) or not line.character
                 for name in selection.characters],
                used,
                "character ",
            ),
            _hits(
                selection.patterns,
                [bool(glob.match(line.key) or glob.match(line.id)) for glob in globs],
                used,
                "lines ",
            ),
            selection.changed is None or bool(changed & _names(line)),
        ]  # fmt: skip
        if all(wanted):
            kept.append(line)
    asked = [f"language {name}" for name in selection.languages]
    asked += [f"character {name}" for name in selection.characters]
    asked += [f"lines {glob}" for glob in selection.patterns]
    # A line of nobody's own fits any name, a misspelt one too.
    known = {composed(name) for name in (*characters, *(line.character for line in lines))}
    used -= {f"character {n}" for n in selection.characters if composed(n) not in known}
    idle = [entry for entry in asked if entry not in used]
    if idle:
        raise InputError(
            "selection-empty",
            f"no line fits {', '.join(idle)}",
            place=f"--{idle[0].split()[0]}",
            action="`animeme lines` lists what there is.",
        )
    return tuple(kept)


def read_changed(path: Path) -> tuple[str, ...]:
    """The lines that a list of changes names.

    Args:
        path: keys, ids or paths, one a line, as ``git diff --name-only`` prints them; or what the
            review page exports, as ``.json`` or ``.csv``: of its marks, those that say "fix".
            ``-`` is standard input.

    Raises:
        InputError: it cannot be read.
    """
    if str(path) == "-":
        return _listed(sys.stdin.read())
    try:
        text = path.read_text(encoding="utf-8-sig")
    except OSError as error:
        raise unreadable(path, "changed-unreadable", error) from error
    except UnicodeDecodeError as error:
        raise InputError(
            "changed-unreadable",
            f"is not UTF-8 text (byte {error.start})",
            place=str(path),
            action="Write one line's key or file a line.",
        ) from error
    if path.suffix.lower() == ".json":
        data = documents.parse_file(path)
        marks = data.get("marks")
        if data.get("schema") != MARKS or not isinstance(marks, list):
            raise _invalid(path, f"is no document of marks: it needs schema = '{MARKS}' and marks")
        return _to_fix(path, marks)
    if path.suffix.lower() == ".csv" and _is_marks(text):
        return _to_fix(path, list(csv.DictReader(text.splitlines())))
    return _listed(text)


def _listed(text: str) -> tuple[str, ...]:
    return tuple(line.strip() for line in text.splitlines() if line.strip())


def _is_marks(text: str) -> bool:
    """Whether a table is the review page's; any other is a list, one entry a line."""
    header = next(csv.reader(text.splitlines()), [])
    return {"line", "mark"} <= {*header}


def _to_fix(path: Path, marks: Sequence[Any]) -> tuple[str, ...]:
    """Each line that is marked "fix", once."""
    for number, mark in enumerate(marks, 1):
        whole = isinstance(mark, Mapping) and isinstance(mark.get("line"), str) and mark["line"]
        if not whole or mark.get("mark") not in ("good", "fix"):
            raise _invalid(path, f"mark {number} needs a line, and a mark that is good or fix")
    return tuple(dict.fromkeys(mark["line"] for mark in marks if mark["mark"] == "fix"))


def _invalid(path: Path, problem: str) -> InputError:
    return InputError(
        "changed-invalid",
        problem,
        place=str(path),
        action="Export the marks from the review page again, or write a list of lines, one a line.",
    )


def _hits(asked: Sequence[str], fits: Sequence[bool], used: set[str], kind: str) -> bool:
    """Whether one of `asked` fits, or nothing was asked; those that do are `used`."""
    used |= {kind + name for name, fit in zip(asked, fits, strict=True) if fit}
    return not asked or any(fits)


def _tag(name: str) -> str:
    return find_tag(name) or name


def _speaks(line: Line, tag: str) -> bool:
    return line.language == tag or line.language.startswith(f"{tag}-")


def _names(line: Line) -> set[str]:
    """What a list of changes may call a line."""
    paths = [line.audio, line.transcript, *([line.timings] if line.timings else [])]
    paths += [car.path for car in line.side_cars]
    names = {composed(line.key), composed(line.id)}
    for path in paths:
        whole = composed(path.absolute().as_posix())
        names |= {whole, _bare(whole)}
        parts = whole.split("/")
        # A list's paths start at the repository's root, wherever that is.
        for start in range(max(0, len(parts) - 8), len(parts)):
            tail = "/".join(parts[start:])
            if "/" in tail:
                names |= {tail, _bare(tail)}
    return names


def _bare(name: str) -> str:
    """A name in composed form with ``/``, without the suffix of a recording or transcript."""
    plain = composed(name.replace("\\", "/")).removeprefix("./")
    for suffix in _SUFFIXES:
        if plain.lower().endswith(suffix):
            return plain[: -len(suffix)]
    return plain
