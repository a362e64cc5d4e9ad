"""Which lines go into which files."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path

from animeme import registry
from animeme.contracts import Format
from animeme.dialogue import Line
from animeme.job import Job
from animeme.tasks import AssetItem, LineItem, Target


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
        """Names of the job's characters that speak a line."""
        names = (character.name for character in self.job.characters)
        return tuple(name for name in names if line.character in ("", name))

    def line_items(self, spool: Path) -> list[LineItem]:
        """One item per line that has an asset to speak it."""
        items = []
        for number, line in enumerate(self.lines):
            speakers = self.characters_of(line)
            targets = [i for i, t in enumerate(self.targets) if t.character in speakers]
            if targets:
                items.append(LineItem(line, tuple(targets), spool, number))
        return items

    def asset_items(self, good: Mapping[int, float], spool: Path) -> list[AssetItem]:
        """One item per file to write.

        Args:
            good: number of each line that has curves → its length in seconds.
            spool: the run's spool folder.
        """
        items: list[AssetItem] = []
        for index, target in enumerate(self.targets):
            by_language: dict[str, list[tuple[int, str, float]]] = defaultdict(list)
            for number, length_s in sorted(good.items()):
                line = self.lines[number]
                if target.character in self.characters_of(line):
                    by_language[line.language].append((number, line.id, length_s))
            for language, lines in sorted(by_language.items()):
                items += self._files(index, target, language, lines, spool)
        return items

    def _files(
        self,
        index: int,
        target: Target,
        language: str,
        lines: list[tuple[int, str, float]],
        spool: Path,
    ) -> Iterable[AssetItem]:
        suffix = self.format_of(target).output_suffix(target.asset.source)
        folder = self.job.output / language
        layout = {c.name: c.layout for c in self.job.characters}[target.character]
        if layout == "per-character":
            output = folder / f"{target.character}{suffix}"
            return [AssetItem(index, language, tuple(lines), output, spool)]
        return [
            AssetItem(
                index, language, (line,), folder / target.character / f"{line[1]}{suffix}", spool
            )
            for line in lines
        ]

    def assembly_path(self, target: Target) -> Path:
        """Where a format that joins languages puts the joined file."""
        return self.job.output / f"{target.character}{self.format_of(target).assembly_suffix}"

    @staticmethod
    def format_of(target: Target) -> Format:
        """The format of a target's asset."""
        return registry.format_named(target.asset.format)
