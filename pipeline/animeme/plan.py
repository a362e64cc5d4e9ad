"""Which lines go into which files."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Callable, Collection, Iterator, Mapping
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

from animeme import registry
from animeme.dialogue import Line
from animeme.job import Job
from animeme.tasks import AssemblyItem, AssetItem, LineItem, Target, alignment_path, speech_path

REPORT_NAMES = ("report.json", "summary.md", "run.jsonl")


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
        names = [character.name for character in self.job.characters]
        return tuple(n for n in names if (line.language, n, line.id) not in self._own)

    @cached_property
    def _own(self) -> frozenset[tuple[str, str, str]]:
        return frozenset((li.language, li.character, li.id) for li in self.lines if li.character)

    def line_items(self, spool: Path) -> list[LineItem]:
        """One item per line that has an asset to speak it."""
        items = []
        for number, line in enumerate(self.lines):
            speakers = self.characters_of(line)
            targets = [i for i, t in enumerate(self.targets) if t.character in speakers]
            if targets:
                items.append(LineItem(line, tuple(targets), spool, number))
        return items

    def asset_items(
        self, good: Callable[[str], Mapping[int, float]], spool: Path
    ) -> list[AssetItem]:
        """One item per file to write.

        Args:
            good: character → number of each line that has curves → its length in seconds.
            spool: the run's spool folder.
        """
        items: list[AssetItem] = []
        for index, target in enumerate(self.targets):
            files: dict[tuple[str, Path], list[tuple[int, str, float, Path]]] = defaultdict(list)
            for number, length_s in sorted(good(target.character).items()):
                line = self.lines[number]
                if target.character in self.characters_of(line):
                    file = (line.language, self._file(target, line))
                    audio = self._heard(line)
                    files[file].append((number, line.id, length_s, audio))
            items += [
                AssetItem(
                    index, language, tuple(lines), output, spool, self._exports(target, lines)
                )
                for (language, output), lines in sorted(files.items())
            ]
        return items

    def _exports(
        self, target: Target, lines: list[tuple[int, str, float, Path]]
    ) -> tuple[tuple[int, str, Path], ...]:
        """(place in `lines`, kind, file) of each curve file that goes with an asset's file."""
        return tuple(
            (place, kind, path)
            for place, (number, *_) in enumerate(lines)
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

    def curve_files(self) -> Iterator[Path]:
        """Every curve file that the run may write; none twice, if no two lines clash."""
        for target in self.targets:
            for line in self._lines_of(target):
                yield from (path for _, path in self._curve_files(target, line))

    def assembly_items(self, written: Collection[Path], spool: Path) -> list[AssemblyItem]:
        """One item per file that joins the languages of an asset, of those that were written."""
        items = []
        for index, target in enumerate(self.targets):
            path = self.assembly_path(target)
            files = tuple(entry for entry in self.language_files(target) if entry[1] in written)
            if path is not None and files:
                items.append(AssemblyItem(index, files, path, spool, self.package_path(target)))
        return items

    def language_files(self, target: Target) -> list[tuple[str, Path]]:
        """Language and file of each file that holds all lines of a language."""
        if target.layout != "per-character":
            return []
        return sorted({(li.language, self._file(target, li)) for li in self._lines_of(target)})

    def assembly_path(self, target: Target) -> Path | None:
        """Where a format that joins languages puts the joined file; None where there is none."""
        suffix = target.format.assembly_suffix
        if not suffix or target.layout != "per-character":
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
        yield from self.possible_files()
        for target in self.targets:
            beside = target.format.companions(target.asset)
            folders = {self._file(target, line).parent for line in self._lines_of(target)}
            yield from (folder / name for folder in sorted(folders) for name in beside)

    def possible_files(self) -> Iterator[Path]:
        """Every asset, alignment, speech and curve file of the run, and not what comes along."""
        for line in self.lines:
            yield alignment_path(self.job.output, line)
            yield speech_path(self.job.output, line)
        yield from self.curve_files()
        for target in self.targets:
            yield from dict.fromkeys(self._file(target, line) for line in self._lines_of(target))
            joined = (self.assembly_path(target), self.package_path(target))
            yield from (path for path in joined if path is not None)

    def _lines_of(self, target: Target) -> Iterator[Line]:
        return (line for line in self.lines if target.character in self.characters_of(line))

    def _heard(self, line: Line) -> Path:
        """The line's recording, or what the run spoke in its place."""
        return line.audio if line.audio.exists() else speech_path(self.job.output, line)

    def _file(self, target: Target, line: Line) -> Path:
        """The file of `target` that holds `line`."""
        suffix = target.format.output_suffix(target.asset.source)
        folder = self.job.output / line.language
        if target.layout == "per-character":
            return folder / f"{target.character}{suffix}"
        return folder / target.character / f"{line.id}{suffix}"
