"""``animeme review``: what a person is shown of a run, or of delivered files."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from fnmatch import translate
from pathlib import Path
from typing import Protocol

import numpy as np

from animeme import registry
from animeme.curves import CurveSet
from animeme.dialogue import composed
from animeme.errors import InputError
from animeme.findings import Complaint, Finding, LineStatus, Severity
from animeme.phones import SILENCE, PhoneTrack

DEFAULT_FRAME_HZ = 30.0

_RANK: dict[LineStatus, int] = {"failed": 0, "review": 1, "ok": 2}
# How findings say when: "at 1.20 s", "1.20–1.45 s", "from 1.20 to 1.45 s"; not "lasts 1.20 s".
_NUMBER = r"(\d+(?:\.\d+)?)"
_SPAN = re.compile(rf"{_NUMBER}\s?[–-]\s?{_NUMBER} s\b|from {_NUMBER} to {_NUMBER} s\b")
_MOMENT = re.compile(rf"(?:\bat|\baround) {_NUMBER} s\b")


@dataclass(frozen=True)
class Performed:
    """A line as one file plays it.

    Attributes:
        file: the file's name, as a person would say it.
        path: the file.
        animation: its name in the file.
        face: the file that has the character's meshes: itself, or what it is to be played on.
        shapes: the weights that are stored in it, over canonical shape names; those that never
            leave their rest are left out.
        audio_start_s: when the recording starts on the time axis of `shapes`.
    """

    file: str
    path: Path
    animation: str
    face: Path
    shapes: CurveSet
    audio_start_s: float = 0.0


@dataclass(frozen=True)
class ReviewedLine:
    """A line of one character, as lists show it.

    Attributes:
        key: ``<language>/<line>``.
        character: its name.
        language: BCP-47 tag, "" if nothing tells.
        status: how it ended.
        audio_s: length of the recording, 0 if it is not known.
        findings: about it, the worst first.
        score: mean log score of its worst phone; None where there is none.
        words: what is said, for a search.
    """

    key: str
    character: str
    language: str
    status: LineStatus
    audio_s: float
    findings: tuple[Finding, ...] = ()
    score: float | None = None
    words: str = ""


@dataclass(frozen=True)
class Detail:
    """All that a line's page shows.

    Attributes:
        text: its transcript.
        audio: its recording, None if there is none to be heard.
        track: its words and phones, None where they are not known.
        performed: how each file plays it.
        remarks: why something is not shown.
    """

    text: str
    audio: Path | None
    track: PhoneTrack | None
    performed: tuple[Performed, ...]
    remarks: tuple[str, ...] = ()


class Reviewable(Protocol):
    """A run, or delivered files."""

    title: str
    lines: tuple[ReviewedLine, ...]
    findings: tuple[Finding, ...]
    frame_hz: float

    def details(self, lines: Sequence[ReviewedLine]) -> Iterator[Detail]:
        """What the pages of `lines` show, in the same order."""
        ...


@dataclass(frozen=True)
class Review:
    """What is to be shown, and beside what.

    Attributes:
        shown: the run, or the files.
        chosen: lines that get a page, in the order of `shown`.
        other: what they are compared with, None if with nothing.
        other_lines: (key, character) → the line in `other`.
    """

    shown: Reviewable
    chosen: tuple[ReviewedLine, ...]
    other: Reviewable | None = None
    other_lines: Mapping[tuple[str, str], ReviewedLine] = field(default_factory=dict)


Listener = Callable[[int, int], None]


@dataclass(frozen=True)
class WrittenReview:
    """What `review` wrote.

    Attributes:
        index: the file to open.
        lines: how many lines its list has.
        pages: how many of them can be looked at.
        size_bytes: of all files.
        head: whether the pages have the 3D view.
        remarks: what a person should know, each once.
    """

    index: Path
    lines: int
    pages: int
    size_bytes: int
    head: bool
    remarks: tuple[str, ...] = ()


@dataclass(frozen=True)
class Pictures:
    """What `picture` drew, and what a person should know."""

    files: tuple[Path, ...]
    remarks: tuple[str, ...] = ()


def write_review(
    shown: Reviewable,
    output: Path,
    *,
    lines: Sequence[str] = (),
    worst: int | None = None,
    other: Reviewable | None = None,
    single_file: bool = False,
    listener: Listener = lambda done, total: None,
) -> WrittenReview:
    """Write pages on which a person sees and hears lines.

    Args:
        shown: the run, or the delivered files.
        output: folder to write to.
        lines: globs over keys, or ids, of the lines that get a page; all if there is none.
        worst: only so many of them, the worst.
        other: what to compare with, line by line.
        single_file: one file that holds everything.
        listener: told how many pages are done, of how many.

    Raises:
        InputError: no line fits, or `output` cannot be written.
    """
    chosen = choose(shown.lines, lines, worst)
    by_name = {(line.key, line.character): line for line in other.lines} if other else {}
    whole = Review(shown, chosen, other, by_name)
    written: WrittenReview = registry.stage("write-review")(
        whole, output, single_file=single_file, listener=listener
    )
    return written


def picture(
    shown: Reviewable,
    output: Path,
    *,
    lines: Sequence[str] = (),
    worst: int | None = None,
    strips: bool = False,
    films: bool = False,
    listener: Listener = lambda done, total: None,
) -> Pictures:
    """Draw lines without a browser: key moments as a PNG, or an MP4 with sound, for each.

    Args:
        shown, output, lines, worst, listener: as for `review`.
        strips: draw ``<output>/<character>/<language>/<line>.png``.
        films: draw ``….mp4``.

    Raises:
        InputError: no line fits.
        PluginError: nothing that draws is installed.
    """
    chosen = choose(shown.lines, lines, worst)
    written, remarks = [], []
    for done, (line, detail) in enumerate(zip(chosen, shown.details(chosen), strict=True), 1):
        base = output / line.character / line.key
        # Of several formats the first: they hold the same motion.
        played = next((p for p in detail.performed if p.face == p.path), None)
        if played is None:
            remarks.append(f"{line.key} of {line.character}: no file of it has a face to draw.")
        for wanted, suffix, draw in (
            (strips, ".png", _strip), (films, ".mp4", _film),
        ):  # fmt: skip
            if not wanted or played is None:
                continue
            target = base.with_name(f"{base.name}{suffix}")
            try:
                draw(played, line, detail, target)
                written.append(target)
            except InputError as error:
                remarks.append(f"{line.key} of {line.character}: {error}")
        listener(done, len(chosen))
    return Pictures(tuple(written), tuple(dict.fromkeys(remarks)))


def _strip(played: Performed, line: ReviewedLine, detail: Detail, target: Path) -> None:
    title = f"{line.character}: {detail.text}"
    draw = registry.stage("draw-strip")
    draw(played.path, played.animation, detail.track, target, title=title)


def _film(played: Performed, line: ReviewedLine, detail: Detail, target: Path) -> None:
    draw = registry.stage("film")
    draw(played.path, played.animation, detail.audio, detail.track, target)


def choose(
    lines: Sequence[ReviewedLine], globs: Sequence[str], worst: int | None
) -> tuple[ReviewedLine, ...]:
    """The lines that get a page, in the same order.

    Failed lines are worse than those for review, more warnings are worse than fewer, and then a
    worse phone decides.

    Raises:
        InputError: a glob fits no line.
    """
    kept = list(lines)
    if globs:
        fits = [[line for line in lines if _fits(line, glob)] for glob in globs]
        idle = [glob for glob, found in zip(globs, fits, strict=True) if not found]
        if idle:
            raise InputError(
                "selection-empty",
                f"no line fits {', '.join(idle)}",
                place="--lines",
                action="Give <language>/<line> or <line>; * stands for anything.",
            )
        wanted = {id(line) for found in fits for line in found}
        kept = [line for line in lines if id(line) in wanted]
    if worst is not None and len(kept) > worst:
        order = sorted(range(len(kept)), key=lambda index: _badness(kept[index]))
        kept = [kept[index] for index in sorted(order[:worst])]
    return tuple(kept)


def _fits(line: ReviewedLine, glob: str) -> bool:
    pattern = re.compile(translate(composed(glob)))
    key = composed(line.key)
    bare = key.partition("/")[2]
    own = bare.removeprefix(f"{composed(line.character)}/")
    return any(pattern.match(name) for name in (key, bare, own))


def _badness(line: ReviewedLine) -> tuple[int, int, bool, float, str, str]:
    warnings = sum(finding.severity >= Severity.WARNING for finding in line.findings)
    score = 0.0 if line.score is None else line.score
    return (_RANK[line.status], -warnings, line.score is None, score, line.key, line.character)


def moving(curves: CurveSet, rest: Mapping[str, float]) -> CurveSet:
    """Without the curves that stay at rest; of none, the first is kept."""
    at_rest = np.array([rest.get(name, 0.0) for name in curves.names])
    moves = (np.abs(curves.weights - at_rest) > 0).any(axis=0)
    moves[0] |= not moves.any()
    names = tuple(name for name, moving in zip(curves.names, moves, strict=True) if moving)
    return CurveSet(curves.times_s, names, curves.weights[:, moves])


def scores_of(phones: Iterable[tuple[str, float | None]]) -> list[float]:
    """Scores of phones, pauses left out."""
    return [score for symbol, score in phones if symbol != SILENCE and score is not None]


def when_of(finding: Finding) -> tuple[float, float] | None:
    """When on the recording's time axis a finding is about, in seconds; None if it does not say.

    Example:
        >>> when_of(Finding(Severity.WARNING, "x", "'boat' does not fit at 1.20–1.45 s"))
        (1.2, 1.45)
        >>> when_of(Finding(Severity.WARNING, "x", "the recording lasts 1.20 s"))
    """
    if isinstance(finding, Complaint) and finding.start_s is not None:
        end_s = finding.start_s if finding.end_s is None else finding.end_s
        return finding.start_s, max(end_s, finding.start_s)
    for text in (finding.place, finding.message):
        if span := _SPAN.search(text):
            first, last = (float(number) for number in span.groups() if number is not None)
            if last >= first:
                return first, last
        if moment := _MOMENT.search(text):
            return float(moment[1]), float(moment[1])
    return None
