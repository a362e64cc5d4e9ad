"""Which lines go into which files."""

from __future__ import annotations

import os
from collections import defaultdict
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

from animeme import registry
from animeme.dialogue import Line
from animeme.job import Job
from animeme.tasks import (
    AssemblyItem,
    AssetItem,
    AssetLine,
    Target,
    alignment_file,
    speech_file,
)

REPORT_NAMES = ("report.json", "summary.md", "junit.xml", "report.sarif", "run.jsonl")


@dataclass(frozen=True)
class Plan:
    """The work of a run.

    Attributes:
        lines: every line, sorted by key; a line's place is its number.
        targets: assets that can be driven.
    """

    job: Job
    lines: tuple[Line, ...]
    targets: tuple[Target, ...]

    def characters_of(self, line: Line) -> tuple[str, ...]:
        """Names of the job's characters that speak a line.

        A character's own recording takes the place of one for all of the same language and id.
        """
        if line.character:
            return (line.character,)
        if not self._own:
            return self._names
        return tuple(n for n in self._names if (line.language, n, line.id) not in self._own)

    @cached_property
    def _names(self) -> tuple[str, ...]:
        return tuple(character.name for character in self.job.characters)

    @cached_property
    def _own(self) -> frozenset[tuple[str, str, str]]:
        return frozenset((li.language, li.character, li.id) for li in self.lines if li.character)

    def spoken_lines(self) -> Iterator[tuple[int, Line, tuple[int, ...]]]:
        """Number, line and indices of targets of each line that has an asset to speak it."""
        of: dict[tuple[str, ...], tuple[int, ...]] = {}
        for number, line in enumerate(self.lines):
            names = self.characters_of(line)
            if names not in of:
                of[names] = tuple(i for i, t in enumerate(self.targets) if t.character in names)
            if of[names]:
                yield number, line, of[names]

    def asset_items(
        self,
        good: Callable[[int], Iterable[tuple[int, float]]],
        curves: Callable[[int], Mapping[int, tuple[str, str]]],
        spool: Path,
    ) -> Iterator[tuple[AssetItem, list[str]]]:
        """One item per file to write, with the digests of its lines' curves.

        Args:
            good: target → number of each line that has curves for it, in order, and its length
                in seconds.
            curves: number of a line → target → key and digest of its curves.
            spool: the run's spool folder.
        """
        for index, target in enumerate(self.targets):
            files: dict[tuple[str, str], list[tuple[AssetLine, str]]] = defaultdict(list)
            for number, length_s in good(index):
                line = self.lines[number]
                if target.character not in self.characters_of(line):
                    continue
                key, digest = curves(number).get(index, ("", ""))
                if key:
                    file = line.language, self.file_of(target, line)
                    asset_line = number, line.id, length_s, key, self._heard(line)
                    files[file].append((asset_line, digest))
                if files and target.one_line_each:
                    yield self._asset_item(index, *files.popitem(), spool)
            for file, lines in sorted(files.items()):
                yield self._asset_item(index, file, lines, spool)

    def count_files(self, good: Callable[[int], Iterable[tuple[int, float]]]) -> int:
        """How many items `asset_items` gives, were it to find curves for all that is good."""
        count = 0
        for index, target in enumerate(self.targets):
            lines = (self.lines[number] for number, _ in good(index))
            own = (line for line in lines if target.character in self.characters_of(line))
            if target.one_line_each:
                count += sum(1 for _ in own)
            else:
                count += len({line.language for line in own})
        return count

    def _asset_item(
        self,
        index: int,
        file: tuple[str, str],
        held: list[tuple[AssetLine, str]],
        spool: Path,
    ) -> tuple[AssetItem, list[str]]:
        lines = tuple(line for line, _ in held)
        exports = self._exports(self.targets[index], lines)
        return AssetItem(index, file[0], lines, file[1], spool, exports), [sum_ for _, sum_ in held]

    def _exports(
        self, target: Target, lines: Iterable[AssetLine]
    ) -> tuple[tuple[int, str, Path], ...]:
        """(number of the line, kind, file) of each curve file that goes with an asset's file."""
        return tuple(
            (number, kind, path)
            for number, *_ in lines
            for kind, path in self._curve_files(target, self.lines[number])
        )

    def _curve_files(self, target: Target, line: Line) -> Iterator[tuple[str, Path]]:
        """Kind and path of a line's curve files; the first asset of a character has them."""
        kinds = self.job.curves.export
        if not kinds or target is not self._first_of[target.character]:
            return
        suffixes = registry.stage("curve-files")()
        folder = self.job.output / "curves" / target.character / line.language
        yield from ((kind, folder / f"{line.id}{suffixes[kind]}") for kind in kinds)

    @cached_property
    def _first_of(self) -> Mapping[str, Target]:
        return {target.character: target for target in reversed(self.targets)}

    def curve_files_of(self, target: Target, line: Line) -> Iterator[Path]:
        """The curve files that go with a line's animation on a target."""
        return (path for _, path in self._curve_files(target, line))

    def curve_files(self) -> Iterator[Path]:
        """Every curve file that the run may write; none twice, if no two lines clash."""
        for target in self.targets if self.job.curves.export else ():
            for line in self._lines_of(target):
                yield from self.curve_files_of(target, line)

    def assembly_items(self, written: Callable[[Path], bool], spool: Path) -> list[AssemblyItem]:
        """One item per file that joins the languages of an asset, of those that were `written`."""
        items = []
        for index, target in enumerate(self.targets):
            path = self.assembly_path(target)
            files = tuple(entry for entry in self.language_files(target) if written(entry[1]))
            if path is not None and files:
                package = self.package_path(target)
                sounds = map(self._heard, self._lines_of(target)) if package else ()
                items.append(
                    AssemblyItem(index, files, path, spool, package, tuple(map(Path, sounds)))
                )
        return items

    def language_files(self, target: Target) -> list[tuple[str, Path]]:
        """Language and file of each file that holds all lines of a language."""
        if target.one_line_each:
            return []
        files = {(li.language, self.file_of(target, li)) for li in self._lines_of(target)}
        return [(language, Path(file)) for language, file in sorted(files)]

    def assembly_path(self, target: Target) -> Path | None:
        """Where a format that joins languages puts the joined file; None where there is none."""
        suffix = target.assembly_suffix
        if not suffix or target.one_line_each:
            return None
        return self.job.output / f"{target.character}{suffix}"

    def package_path(self, target: Target) -> Path | None:
        """Where the joined file is packed with all it needs; None if that is not asked for."""
        path = self.assembly_path(target)
        packed = {character.name for character in self.job.characters if character.usdz}
        return path.with_suffix(".usdz") if path and target.character in packed else None

    def possible_outputs(self) -> Iterator[Path]:
        """Every asset, alignment and report that the run may write."""
        yield from (self.job.output / name for name in REPORT_NAMES)
        yield from map(Path, self.possible_files())
        for target in self.targets:
            beside = target.format.companions(target.asset)
            folders = {os.path.dirname(self.file_of(target, li)) for li in self._lines_of(target)}
            yield from (Path(folder, name) for folder in sorted(folders) for name in beside)

    def possible_files(self) -> Iterator[str]:
        """Every asset, alignment, speech and curve file of the run, and not what comes along."""
        for line in self.lines:
            yield alignment_file(self.job.output, line)
            yield speech_file(self.job.output, line)
        yield from map(str, self.curve_files())
        for target in self.targets:
            yield from dict.fromkeys(self.file_of(target, line) for line in self._lines_of(target))
            joined = (self.assembly_path(target), self.package_path(target))
            yield from (str(path) for path in joined if path is not None)

    def _lines_of(self, target: Target) -> Iterator[Line]:
        return (line for line in self.lines if target.character in self.characters_of(line))

    def _heard(self, line: Line) -> str:
        """The line's recording, or what the run spoke in its place."""
        recorded = not self.job.speak or os.path.exists(line.audio_file)
        return line.audio_file if recorded else speech_file(self.job.output, line)

    def file_of(self, target: Target, line: Line) -> str:
        """The file of `target` that holds `line`, as a string: there may be many thousands."""
        start = f"{self._output}/{line.language}/{target.character}"
        return (
            f"{start}/{line.id}{target.suffix}" if target.one_line_each else start + target.suffix
        )

    @cached_property
    def _output(self) -> str:
        return str(self.job.output)
