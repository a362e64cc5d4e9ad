"""Which of a run's files are there already, as this run would write them."""

from __future__ import annotations

import json
import os
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

from animeme import registry
from animeme.findings import Severity
from animeme.job import Job
from animeme.steps import packed, unpacked
from animeme.store.keys import canonical, key_of
from animeme.store.memory import Memory
from animeme.tasks import AssemblyItem, AssetItem, AssetOutcome, Target

_ENGINE = "animeme.writing"


class AssetRecall:
    """What is known of the files that a run writes.

    A file is left alone if it was written from the same asset, with the same lines under the same
    names, by the same code, and still has the digest that it had then.

    Args:
        memory: of earlier runs.
        job: what is run.
        targets: its assets.
    """

    def __init__(self, memory: Memory, job: Job, targets: Sequence[Target]) -> None:
        self._memory = memory
        self._output = job.output
        self._curves = job.curves
        self._targets = targets
        self._sources: dict[tuple[int, Path], list[str]] = {}
        self._codes: dict[tuple[str, ...], str] = {}

    def asset_key(self, item: AssetItem, curves: Iterable[str]) -> str:
        """The key of a file, given the digests of its lines' curves; "" if none can be had."""
        folder, places = item.output.parent, dict[str, str]()
        lines = [
            f"{name}\n{length_s!r}\n{digest}\n{_relative(audio, folder, places)}"
            for (_, name, length_s, _, audio), digest in zip(item.lines, curves, strict=True)
        ]
        sources = self._source_parts(item.target, folder)
        if not sources:
            return ""
        parts = [
            *sources,
            self._below(item.output),
            item.language,
            repr(self._curves.preroll_s),
            *lines,
        ]
        return key_of("asset", [*parts, *self._export_parts(item)])

    def _export_parts(self, item: AssetItem) -> list[str]:
        """What the curve files that go with a file depend on, besides its lines."""
        if not item.exports:
            return []
        folder, places = item.output.parent, dict[str, str]()
        names = {number: name for number, name, *_ in item.lines}
        return [
            os.path.relpath(self._output, folder),
            canonical(self._targets[item.target].rig),
            canonical(self._curves.frame_rate),
            self._code("write-curves"),
            *(
                f"{names[number]}\n{kind}\n{_relative(path, folder, places)}"
                for number, kind, path in item.exports
            ),
        ]

    def assembly_key(self, item: AssemblyItem) -> str:
        """The key of a file that joins languages."""
        folder = item.output.parent
        sources = self._source_parts(item.target, folder)
        files = [
            f"{language}\n{os.path.relpath(path, folder)}\n{self._memory.digests.of(path)}"
            for language, path in item.files
        ]
        if not sources:
            return ""
        parts = [*sources, self._below(item.output), *files]
        if item.package is not None:
            sounds = [(path, self._memory.digests.of(path)) for path in item.sounds]
            parts += [os.path.relpath(item.package, folder), self._code("package-usdz")]
            parts += [f"{os.path.relpath(path, folder)}\n{digest}" for path, digest in sounds]
            if None in (digest for _, digest in sounds):
                return ""
        return key_of("assembly", parts)

    def known(self, key: str, item: AssetItem | AssemblyItem) -> AssetOutcome | None:
        """The outcome of a file that is there already."""
        noted = self._memory.index.note(f"file:{key}") if key else None
        value: Mapping[str, Any] | None = json.loads(noted) if noted else None
        if value is None and key and (entry := self._memory.store.get(key)):
            value = entry.value
        if value is None:
            return None
        outputs = tuple(self._output / path for path, _ in value["outputs"])
        digests = [self._memory.digests.of(path) for path in outputs]
        if digests != [digest for _, digest in value["outputs"]]:
            return None
        character = self._targets[item.target].character
        tokens = self._tokens(item)
        findings = [
            found
            for line, rows in value["findings"]
            for found in unpacked(rows, tokens, line=line, character=character)
        ]
        return AssetOutcome(outputs, tuple(findings), final=True)

    def keep(self, key: str, item: AssetItem | AssemblyItem, outcome: AssetOutcome) -> None:
        """Remember a file that was written."""
        for file in outcome.delivered:
            self._memory.digests.learn(os.path.abspath(file.path), file.stamp, file.digest)
        if (
            not key
            or not outcome.final
            or any(f.severity == Severity.ERROR for f in outcome.findings)
        ):
            return
        tokens = self._tokens(item)
        value = {
            "outputs": [[self._below(file.path), file.digest] for file in outcome.delivered],
            "findings": [[finding.line, packed([finding], tokens)] for finding in outcome.findings],
        }
        self._memory.store.put(key, value)
        self._memory.index.set_note(f"file:{key}", json.dumps(value, ensure_ascii=False))

    def _below(self, path: Path) -> str:
        """A file of the run, from its output folder."""
        return path.relative_to(self._output).as_posix()

    def _tokens(self, item: AssetItem | AssemblyItem) -> dict[str, str]:
        source = self._targets[item.target].asset.source
        folder = {str(self._output): "\0folder\0"}
        return {**folder, str(item.output): "\0output\0", str(source): "\0source\0"}

    def _source_parts(self, index: int, folder: Path) -> list[str]:
        """What of its asset a file in a folder depends on; [] if that cannot be read."""
        if (index, folder) not in self._sources:
            target = self._targets[index]
            files = [target.asset.source, *target.inputs]
            digests = [self._memory.digests.of(path) for path in files]
            parts = [
                f"{os.path.relpath(path, folder)}\n{digest}"
                for path, digest in zip(files, digests, strict=True)
            ]
            parts += [target.layout, self._format_code(target.asset.format)]
            self._sources[index, folder] = [] if None in digests else parts
        return self._sources[index, folder]

    def _format_code(self, name: str) -> str:
        plugins = [registry.find(registry.FORMATS, name)]
        plugins += registry.plugins(registry.CHECKS).values()
        return self._code_of(("format", name), plugins)

    def _code(self, stage: str) -> str:
        return self._code_of(("stage", stage), [registry.find(registry.STAGES, stage)])

    def _code_of(self, key: tuple[str, ...], plugins: Sequence[registry.Plugin]) -> str:
        if key not in self._codes:
            self._codes[key] = self._memory.code.of(plugins, _ENGINE)
        return self._codes[key]


def _relative(path: Path, folder: Path, places: dict[str, str]) -> str:
    """A path from a folder; thousands of them in a few `places`, so each of these once."""
    head, name = os.path.split(path)
    if head not in places:
        places[head] = os.path.relpath(head, folder)
    return f"{places[head]}/{name}"
