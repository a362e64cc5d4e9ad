"""What a run of some of a job's lines works on, and what it says of the others.

A file is written with all its lines or not at all. So a run that is asked for some lines works on
those, and on no others that it can take from the store as they were delivered last.
"""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping
from dataclasses import dataclass, replace
from pathlib import Path

from animeme.dialogue import Line, composed
from animeme.findings import Finding, RunReport, Severity
from animeme.plan import Plan
from animeme.selection import Selection, select
from animeme.tasks import alignment_file, speech_file

Entry = tuple[int, Line, tuple[int, ...]]
"""Number of a line, the line, indices of the targets that speak it."""


@dataclass(frozen=True)
class Scope:
    """Some lines of a plan, and the files that hold them.

    Attributes:
        plan: of the whole job.
        selection: what was asked for.
        asked: numbers of the lines that it fits.
        lines: numbers of all lines in their files, those that were not asked for among them.
        files: asset files that hold a line that was asked for.
        pairs: (key of a line, character) that the run is about.
    """

    plan: Plan
    selection: Selection
    asked: frozenset[int]
    lines: frozenset[int]
    files: frozenset[str]
    pairs: frozenset[tuple[str, str]]

    def entries(self, *, asked: bool = False) -> Iterator[Entry]:
        """The lines with their targets; with `asked`, only those that were asked for."""
        numbers = self.asked if asked else self.lines
        return (entry for entry in self.plan.spoken_lines() if entry[0] in numbers)

    @property
    def targets(self) -> frozenset[int]:
        """Indices of the targets that a file is written for."""
        return frozenset(
            index
            for _, line, targets in self.entries()
            for index in targets
            if self.plan.file_of(self.plan.targets[index], line) in self.files
        )

    def beside(self) -> set[Path]:
        """Files of other languages that lie where they were, for what joins all of them."""
        others = (
            path
            for index in self.targets
            for _, path in self.plan.language_files(self.plan.targets[index])
        )
        return {path for path in others if str(path) not in self.files and path.is_file()}

    def covers(self, finding: Finding) -> bool:
        """Whether a stale file, by its place below the output folder, is the run's to mend."""
        return finding.place in self._own()

    def _own(self) -> set[str]:
        output, lines = self.plan.job.output, [self.plan.lines[number] for number in self.lines]
        own = {file(output, line) for file in (alignment_file, speech_file) for line in lines}
        own |= self.files
        for index in self.targets:
            target = self.plan.targets[index]
            joined = (self.plan.assembly_path(target), self.plan.package_path(target))
            own |= {str(path) for path in joined if path is not None}
            driven = [line for line in lines if (line.key, target.character) in self.pairs]
            own |= {str(path) for line in driven for path in self.plan.curve_files_of(target, line)}
        return {path[len(str(output)) + 1 :] for path in own}

    def told(self, report: RunReport, remarks: Mapping[str, Finding]) -> RunReport:
        """The report without lines that the run was not about, and with remarks by line."""

        def with_remark(findings: tuple[Finding, ...], line: str, who: str) -> tuple[Finding, ...]:
            if line not in remarks:
                return findings
            found = (*findings, replace(remarks[line], line=line, character=who))
            return tuple(sorted(found, key=lambda f: (-f.severity, f.code, f.place, f.message)))

        lines = tuple(
            replace(entry, findings=with_remark(entry.findings, entry.line, entry.character))
            for entry in report.lines
            if (entry.line, entry.character) in self.pairs
        )
        return replace(report, lines=lines, findings=(*report.findings, self._summary()))

    def _summary(self) -> Finding:
        more = len(self.lines - self.asked)
        shared = f", which share their files with {more} more" if more else ""
        return Finding(
            Severity.INFO,
            "run-partial",
            f"{len(self.asked)} of {len(self.plan.lines)} lines were asked for "
            f"({self.selection}){shared}; files of the others are as they were",
            action="A run without a selection brings everything up to date.",
        )


def scope_of(plan: Plan, selection: Selection) -> Scope | None:
    """What a run that is asked for `selection` works on; None if that is everything.

    Raises:
        InputError: something in the selection fits no line.
    """
    if selection.everything:
        return None
    names = [character.name for character in plan.job.characters]
    keys = {line.key for line in select(plan.lines, selection, names)}
    wanted = {composed(name) for name in selection.characters or names}
    asked = [number for number, line in enumerate(plan.lines) if line.key in keys]
    speakers = [target.character for target in plan.targets]
    files = {
        plan.file_of(plan.targets[index], line)
        for _, line, targets in plan.spoken_lines()
        if line.key in keys
        for index in targets
        if composed(speakers[index]) in wanted
    }
    # A character whose asset cannot be used has no target, and yet fails its lines.
    pairs = {
        (plan.lines[number].key, name)
        for number in asked
        for name in plan.characters_of(plan.lines[number])
        if composed(name) in wanted
    }
    lines = set(asked)
    for number, line, targets in plan.spoken_lines():
        held = [i for i in targets if plan.file_of(plan.targets[i], line) in files]
        pairs |= {(line.key, speakers[index]) for index in held}
        lines |= {number} if held else set()
    return Scope(
        plan, selection, frozenset(asked), frozenset(lines), frozenset(files), frozenset(pairs)
    )


def outdated(causes: Collection[str]) -> Finding:
    """What a line is told whose last animation is in its file, though its inputs have changed."""
    return Finding(
        Severity.INFO,
        "line-outdated",
        f"is not up to date ({', '.join(causes)} changed), and was not asked for: its file has "
        "what was made of it before",
        action="Run with this line selected, or without a selection.",
    )


def added() -> Finding:
    """What a line is told that was done though nobody asked for it."""
    return Finding(
        Severity.INFO,
        "line-added",
        "was not asked for, but its file holds it and nothing had been made of it that could be "
        "used again: it was done too",
    )
