"""``animeme diff``: the curves of two runs, or of two files, compared animation by animation."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass
from importlib.metadata import version
from pathlib import Path
from typing import Any, Literal

import numpy as np

from animeme import documents, registry
from animeme.curves import CurveSet, Floats
from animeme.errors import InputError
from animeme.files import anywhere

Side = Literal["a", "b"]


@dataclass(frozen=True)
class Difference:
    """One animation that both sides have.

    Attributes:
        file: below the folders that are compared; the name of `a` where files are.
        animation: its name.
        largest: the largest difference of a weight at any time, in weight units.
        mean: the mean difference of all shapes over all time, in weight units.
        shape: whose difference is the largest, "" if there is none.
        at_s: when, on the animations' own time axis.
        ends_s: when the last key of each side is.
        only_a, only_b: shapes that only one side's character has.
        beyond: it is not the same within the tolerance.
    """

    file: str
    animation: str
    largest: float
    mean: float
    shape: str
    at_s: float
    ends_s: tuple[float, float]
    only_a: tuple[str, ...]
    only_b: tuple[str, ...]
    beyond: bool

    def __str__(self) -> str:
        parts = []
        if self.largest > 0:
            parts.append(
                f"{self.shape} differs by {self.largest:.4g} at {self.at_s:.3f} s "
                f"(mean of all {self.mean:.2g})"
            )
        for side, names in (("A", self.only_a), ("B", self.only_b)):
            if names:
                parts.append(f"only {side} has {', '.join(names)}")
        return f"{self.file}: {self.animation}: {'; '.join(parts) or 'the same'}"


@dataclass(frozen=True)
class Alone:
    """An animation, or a whole file (`animation` is ""), that one side has and not the other."""

    side: Side
    file: str
    animation: str


@dataclass(frozen=True)
class Unread:
    """A file whose curves cannot be read, and why."""

    side: Side
    file: str
    problem: str


@dataclass(frozen=True)
class DiffReport:
    """What two sides have in common, and what not.

    Attributes:
        a, b: as they were named.
        tolerance: the difference that is accepted, in weight units.
        differences: of every animation that both have, the largest first.
        alone: what only one has, sorted.
        unread: what could not be compared, sorted.
    """

    a: str
    b: str
    tolerance: float
    differences: tuple[Difference, ...]
    alone: tuple[Alone, ...] = ()
    unread: tuple[Unread, ...] = ()

    @property
    def beyond(self) -> tuple[Difference, ...]:
        """Animations that are not the same within the tolerance."""
        return tuple(entry for entry in self.differences if entry.beyond)

    @property
    def exit_code(self) -> int:
        """0 if all is the same within the tolerance, 1 if not."""
        return 1 if self.beyond or self.alone or self.unread else 0

    def to_document(self) -> dict[str, Any]:
        """An ``animeme.diff/1`` document."""
        return {
            "schema": "animeme.diff/1",
            "animeme": version("animeme"),
            "a": self.a,
            "b": self.b,
            "tolerance": self.tolerance,
            "exit_code": self.exit_code,
            "totals": {
                "compared": len(self.differences),
                "beyond": len(self.beyond),
                "only_a": sum(entry.side == "a" for entry in self.alone),
                "only_b": sum(entry.side == "b" for entry in self.alone),
                "unread": len(self.unread),
            },
            "largest": max((entry.largest for entry in self.differences), default=0.0),
            "animations": [_plain(entry) for entry in self.differences],
            "alone": [asdict(entry) for entry in self.alone],
            "unread": [asdict(entry) for entry in self.unread],
        }


def _plain(entry: Difference) -> dict[str, Any]:
    lists = {"ends_s": list(entry.ends_s), "only_a": [*entry.only_a], "only_b": [*entry.only_b]}
    return asdict(entry) | lists


@dataclass(frozen=True)
class _Curves:
    """Curves, and what a shape that they say nothing about does; None: it is not known."""

    curves: CurveSet
    rest: Mapping[str, float] | None


def diff(a: Path, b: Path, *, tolerance: float = 0.0) -> DiffReport:
    """Compare the curves of two runs' output folders, or of two files.

    Files are found by their names below the folders, animations by theirs; two files with one
    animation each need not call it the same. Curves are compared at all keys of both sides. A
    shape that one side has no curve of is at rest there.

    Args:
        a, b: folders, or files: assets or curve files.
        tolerance: the largest difference that is accepted, in weight units.

    Raises:
        InputError: one of them is not there, they are not of one kind, or no curve is in either.
    """
    for path in (a, b):
        if not path.exists():
            raise InputError(
                "diff-missing", "does not exist", place=str(path), action="Check the path."
            )
    if a.is_dir() != b.is_dir():
        folder, file = (a, b) if a.is_dir() else (b, a)
        raise InputError(
            "diff-kinds", f"is a folder, and '{file}' is a file", place=str(folder),
            action="Compare two output folders, or two files.",
        )  # fmt: skip
    in_a, in_b = (_files_in(a), _files_in(b)) if a.is_dir() else ({a.name: a}, {a.name: b})
    alone = [Alone("a", name, "") for name in in_a if name not in in_b]
    alone += [Alone("b", name, "") for name in in_b if name not in in_a]
    found: list[Difference] = []
    unread: list[Unread] = []
    for name in (name for name in in_a if name in in_b):
        read: dict[Side, dict[str, _Curves]] = {}
        paths: dict[Side, Path] = {"a": in_a[name], "b": in_b[name]}
        for side, path in paths.items():
            try:
                read[side] = _read(path)
            except InputError as error:
                if not a.is_dir():
                    raise
                unread.append(Unread(side, name, f"{error.problem} [{error.code}]"))
        if len(read) == 2:
            found += _compared(name, read["a"], read["b"], tolerance, alone)
    if not (found or alone or unread):
        raise InputError(
            "diff-empty", "has no curves to compare", place=str(a),
            action="Name two output folders of `animeme run`, two assets with animations, or two "
            "curve files.",
        )  # fmt: skip
    return DiffReport(
        str(a),
        str(b),
        tolerance,
        tuple(sorted(found, key=lambda d: (-d.beyond, -d.largest, d.file, d.animation))),
        tuple(sorted(alone, key=lambda entry: (entry.side, entry.file, entry.animation))),
        tuple(sorted(unread, key=lambda entry: (entry.side, entry.file))),
    )


def _files_in(folder: Path) -> dict[str, Path]:
    """Assets and curve files below a folder, by their path in it."""
    suffixes = {
        suffix
        for name in registry.plugins(registry.FORMATS)
        for suffix in registry.format_named(name).suffixes
    }
    found = {}
    for path in sorted(folder.rglob("*")):
        name = path.relative_to(folder).as_posix()
        hidden = any(part.startswith(".") for part in name.split("/"))
        if not hidden and path.is_file():
            suffix = path.suffix.lower()
            if suffix in suffixes or suffix in (".csv", ".npz") or _holds_curves(path):
                found[name] = path
    return found


def _holds_curves(path: Path) -> bool:
    """Whether a file is a document of curves, and not of something else."""
    try:
        return path.suffix.lower() == ".json" and documents.kind_of(path) == "curves"
    except InputError:
        return False


def _read(path: Path) -> dict[str, _Curves]:
    """Animation → its curves; of a curve file, "curves".

    Raises:
        InputError: the file cannot be read.
    """
    if path.suffix.lower() in (".csv", ".npz", ".json"):
        return {"curves": _Curves(registry.stage("read-curves")(path)[0], None)}
    form = registry.format_of(path)
    rest = form.load(path, within=anywhere(path)).rest_weights()
    return {name: _Curves(c, rest) for name, c in form.read_animations(path).items()}


def _compared(
    file: str,
    a: Mapping[str, _Curves],
    b: Mapping[str, _Curves],
    tolerance: float,
    alone: list[Alone],
) -> Iterator[Difference]:
    """Differences of the animations of two files; those of one side go to `alone`."""
    pairs = [(name, name) for name in a if name in b]
    if not pairs and len(a) == len(b) == 1:
        pairs = [(next(iter(a)), next(iter(b)))]
    alone += [Alone("a", file, name) for name in a if name not in {own for own, _ in pairs}]
    alone += [Alone("b", file, name) for name in b if name not in {other for _, other in pairs}]
    for own, other in pairs:
        yield _difference(file, own, a[own], b[other], tolerance)


def _difference(file: str, name: str, a: _Curves, b: _Curves, tolerance: float) -> Difference:
    # Both are linear between their keys, so they differ most at a key of one of them.
    times_s = np.union1d(a.curves.times_s, b.curves.times_s)
    shapes, lacking = _shapes(a, b)
    off = np.abs(_sampled(a, times_s, shapes) - _sampled(b, times_s, shapes))
    largest, shape, at_s = 0.0, "", 0.0
    if off.size and off.max() > 0:
        row, column = np.unravel_index(int(np.argmax(off)), off.shape)
        largest, shape, at_s = float(off[row, column]), shapes[column], float(times_s[row])
    return Difference(
        file,
        name,
        largest,
        _mean(times_s, off),
        shape,
        at_s,
        (a.curves.duration_s, b.curves.duration_s),
        *lacking,
        beyond=largest > tolerance or any(lacking),
    )


def _shapes(a: _Curves, b: _Curves) -> tuple[list[str], tuple[tuple[str, ...], tuple[str, ...]]]:
    """Shapes that can be compared, sorted, and those that only A and only B know."""
    known = [{*side.curves.names, *(side.rest or ())} for side in (a, b)]
    lacking = (
        tuple(sorted(known[0] - known[1])) if b.rest is not None else (),
        tuple(sorted(known[1] - known[0])) if a.rest is not None else (),
    )
    moved = {*a.curves.names, *b.curves.names}
    return sorted(moved.difference(*lacking)), lacking


def _sampled(side: _Curves, times_s: Floats, shapes: Sequence[str]) -> Floats:
    """Weights at times, shape (T, N); a shape without a curve rests, at 0 if nothing tells."""
    columns = {name: index for index, name in enumerate(side.curves.names)}
    sampled = side.curves.sample(times_s)
    still, rest = np.ones(len(times_s)), side.rest or {}
    weights = [
        sampled[:, columns[name]] if name in columns else still * rest.get(name, 0.0)
        for name in shapes
    ]
    return np.array(weights).reshape(len(shapes), len(times_s)).T


def _mean(times_s: Floats, off: Floats) -> float:
    """Mean over time, by the trapezoidal rule, and over shapes."""
    if not off.size:
        return 0.0
    span_s = float(times_s[-1] - times_s[0])
    each = off.mean(axis=1)
    return float(np.trapezoid(each, times_s) / span_s) if span_s > 0 else float(each.mean())
