"""Which of a run's files are there already, as this run would write them."""

from __future__ import annotations

import json
import os
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

from animeme import registry
from animeme.files import stamp
from animeme.findings import Severity
from animeme.job import Job
from animeme.packing import packed, unpacked
from animeme.recent import Recent
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
        self._output = str(job.output)
        self._curves = job.curves
        self._targets = targets
        self._sources: dict[tuple[int, str], list[str]] = {}
        self._stamps: dict[int, list[tuple[Path, str]]] = {}
        self._codes: dict[tuple[str, ...], str] = {}
        self._places: dict[tuple[str, str], str] = {}
        self._start = len(self._output) + 1
        self._recent = Recent(memory, f"files of {os.path.abspath(job.output)}")

    def asset_key(self, item: AssetItem, curves: Iterable[str]) -> str:
        """The key of a file, given the digests of its lines' curves; "" if none can be had."""
        folder = os.path.dirname(item.output)
        lines = [
            f"{name}\n{length_s!r}\n{digest}\n{self._relative(audio, folder)}"
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
        folder = os.path.dirname(item.output)
        names = {number: name for number, name, *_ in item.lines}
        return [
            os.path.relpath(self._output, folder),
            canonical(self._targets[item.target].rig),
            canonical(self._curves.frame_rate),
            self._code("write-curves"),
            *(
                f"{names[number]}\n{kind}\n{self._relative(path, folder)}"
                for number, kind, path in item.exports
            ),
        ]

    def assembly_key(self, item: AssemblyItem) -> str:
        """The key of a file that joins languages."""
        folder = os.path.dirname(item.output)
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

    def known(
        self, keyed: Sequence[tuple[str, AssetItem | AssemblyItem]]
    ) -> list[AssetOutcome | None]:
        """The outcome of each file, by its key, that is there already."""
        names = [self._below(item.output) for _, item in keyed]
        rows = self._recent.rows(names)
        outcomes: list[AssetOutcome | None] = []
        wanted: list[int] = []
        for place, ((key, item), name) in enumerate(zip(keyed, names, strict=True)):
            row = rows.get(name)
            found = self._as_it_was(item, row[1]) if row is not None and row[0] == key else None
            outcomes.append(found)
            if found is None and key:
                wanted.append(place)
        notes = self._memory.index.notes(f"file:{keyed[place][0]}" for place in wanted)
        for place in wanted:
            key, item = keyed[place]
            outcomes[place] = self._there(key, item, notes.get(f"file:{key}"))
        return outcomes

    def _as_it_was(self, item: AssetItem | AssemblyItem, text: str) -> AssetOutcome | None:
        """The outcome of a file if it looks as it did when it was last known."""
        value = json.loads(text)
        outputs = tuple(f"{self._output}/{path}" for path, _ in value["outputs"])
        if not outputs or [stamp(path) for path in outputs] != value["stamps"]:
            return None
        return self._outcome(item, value, outputs)

    def _there(
        self, key: str, item: AssetItem | AssemblyItem, noted: str | None
    ) -> AssetOutcome | None:
        """The outcome of a file if it has the content that it had when it was last known."""
        value: Mapping[str, Any] | None = json.loads(noted) if noted else None
        if value is None and (entry := self._memory.store.get(key)):
            value = entry.value
        if value is None:
            return None
        outputs = tuple(f"{self._output}/{path}" for path, _ in value["outputs"])
        found = [self._memory.digests.look(path) for path in outputs]
        if [digest for digest, _ in found] != [digest for _, digest in value["outputs"]]:
            return None
        self._remember(key, item, value, [stamped for _, stamped in found])
        return self._outcome(item, value, outputs)

    def _outcome(
        self, item: AssetItem | AssemblyItem, value: Mapping[str, Any], outputs: tuple[str, ...]
    ) -> AssetOutcome:
        character = self._targets[item.target].character
        tokens = self._tokens(item) if value["findings"] else {}
        findings = [
            found
            for line, rows in value["findings"]
            for found in unpacked(rows, tokens, line=line, character=character)
        ]
        return AssetOutcome(outputs, tuple(findings), final=True)

    def _remember(
        self,
        key: str,
        item: AssetItem | AssemblyItem,
        value: Mapping[str, Any],
        stamps: Sequence[str],
    ) -> None:
        paths = [f"{self._output}/{path}" for path, _ in value["outputs"]]
        known = {"outputs": value["outputs"], "findings": value["findings"], "stamps": stamps}
        files = tuple(zip(paths, stamps, strict=True))
        self._recent.put(self._below(item.output), key, known, files)

    def keep(self, key: str, item: AssetItem | AssemblyItem, outcome: AssetOutcome) -> None:
        """Remember a file that was written."""
        for file in outcome.delivered:
            self._memory.digests.learn(file.path, file.stamp, file.digest)
        if (
            not key
            or not outcome.final
            or any(f.severity == Severity.ERROR for f in outcome.findings)
            or any(stamp(path) != seen for path, seen in self._stamps[item.target])
        ):
            return
        tokens = self._tokens(item)
        value = {
            "outputs": [[file.path[self._start :], file.digest] for file in outcome.delivered],
            "findings": [[finding.line, packed([finding], tokens)] for finding in outcome.findings],
        }
        self._memory.store.put(key, value)
        self._memory.index.set_note(f"file:{key}", json.dumps(value, ensure_ascii=False))
        self._remember(key, item, value, [file.stamp for file in outcome.delivered])

    def ran(self) -> None:
        """Remember the files by what they look like now."""
        self._recent.close()

    def _below(self, path: str | Path) -> str:
        """A file of the run, from its output folder."""
        return str(path)[self._start :]

    def _tokens(self, item: AssetItem | AssemblyItem) -> dict[str, str]:
        source = self._targets[item.target].asset.source
        folder = {self._output: "\0folder\0"}
        return {**folder, str(item.output): "\0output\0", str(source): "\0source\0"}

    def _source_parts(self, index: int, folder: str) -> list[str]:
        """What of its asset a file in a folder depends on; [] if that cannot be read."""
        if (index, folder) not in self._sources:
            target = self._targets[index]
            files = [target.asset.source, *target.inputs]
            looks = [self._memory.digests.look(path) for path in files]
            digests = [digest for digest, _ in looks]
            stamps = [seen for _, seen in looks]
            self._stamps.setdefault(index, [*zip(files, stamps, strict=True)])
            parts = [
                f"{os.path.relpath(path, folder)}\n{digest}"
                for path, digest in zip(files, digests, strict=True)
            ]
            parts += [target.layout, self._format_code(target.asset.format)]
            self._sources[index, folder] = [] if None in digests else parts
        return self._sources[index, folder]

    def _format_code(self, name: str) -> str:
        plugins = [registry.find(registry.FORMATS, name)]
        plugins += registry.plugins(registry.ASSET_CHECKS).values()
        return self._code_of(("format", name), plugins)

    def _code(self, stage: str) -> str:
        return self._code_of(("stage", stage), [registry.find(registry.STAGES, stage)])

    def _code_of(self, key: tuple[str, ...], plugins: Sequence[registry.Plugin]) -> str:
        if key not in self._codes:
            self._codes[key] = self._memory.code.of(plugins, _ENGINE)
        return self._codes[key]

    def _relative(self, path: str | Path, folder: str) -> str:
        """A path from a folder; thousands of them in a few places, so each of these once."""
        head, _, name = str(path).rpartition("/")
        if (folder, head) not in self._places:
            self._places[folder, head] = os.path.relpath(head or "/", folder)
        return f"{self._places[folder, head]}/{name}"
