"""What the results of a run's lines are found under."""

from __future__ import annotations

import time
from collections.abc import Iterable, Sequence
from dataclasses import replace
from functools import cached_property
from os.path import basename
from pathlib import Path

from animeme import registry
from animeme.dialogue import Line, is_spoken, voice_path
from animeme.job import Job
from animeme.side_cars import drawn
from animeme.store.digests import ABSENT
from animeme.store.keys import (
    CONTEXT,
    CURVES,
    LINE,
    STEPS,
    Files,
    Parts,
    canonical,
    key_of,
    parts_of,
    target_parts,
)
from animeme.store.lexicon import LexiconParts
from animeme.store.memory import Memory
from animeme.tasks import LineItem, LineKeys, RunContext, Target

_ENGINE = "animeme.steps"
_UNREADABLE = "unreadable"


class Keyring:
    """Keys of a run's lines.

    Args:
        memory: of earlier runs.
        job: what is run.
        targets: its assets.
        deliver: the run puts lines' documents into its output folder.
    """

    def __init__(
        self, memory: Memory, job: Job, targets: Sequence[Target], *, deliver: bool = True
    ) -> None:
        self.memory = memory
        self.job = job
        self.targets = tuple(targets)
        self._delivers = deliver
        self._lexicon = LexiconParts(memory, job.aligner, job.lexicon)
        self._codes: dict[str, str] = {}
        self._common: dict[str, Parts] = {}
        self._models: list[str] = []
        self._voices: dict[Path, tuple[str | None, str]] = {}

    @cached_property
    def context(self) -> RunContext:
        """What every line's work is given."""
        job, look = self.job, Files(self.memory.digests.look)
        bare = RunContext(
            self.targets,
            job.aligner,
            job.lexicon,
            job.voices,
            None if job.model_file else job.model,
            job.model_file,
            job.curves,
            job.output if self._delivers else None,
            job.speak,
            self.memory.store.folder,
            (),
            (),
        )
        for step in STEPS:
            own, settings = (
                parts_of(step, subject, table, look)
                for subject, table in ((bare, CONTEXT), (job.curves, CURVES))
            )
            assert own is not None  # neither has a file
            assert settings is not None
            self._common[step] = own | settings
        if job.lexicon is not None:
            look(str(job.lexicon))
        prefixes = []
        for target in self.targets:
            model = self._model_parts(target, look)
            self._models.append(canonical(model))
            model |= self._common["synthesize"]
            parts = {**self._common["retarget"], **target_parts(target), "code": self._code("rig")}
            prefixes.append((key_of("model", model), key_of("rig", parts)))
        return RunContext(
            **{**vars(bare), "prefixes": tuple(prefixes), "watched": tuple(look.stamps)}
        )

    def _code(self, part: str) -> str:
        """Digest of the code behind a part of the work."""
        if part not in self._codes:
            find, stages = registry.find, registry.STAGES
            names = {
                "align": ["read-speech", "read-transcript", "read-timings"],
                "speak": ["read-transcript", "speak", "write-speech"],
                "rig": ["retarget"],
                "by hand": ["read-curves", "read-transcript"],
            }[part]
            plugins = [find(stages, name) for name in names]
            if part == "align":
                plugins.append(find(registry.ALIGNERS, self.job.aligner))
            if part == "rig":
                plugins += registry.plugins(registry.LINE_CHECKS).values()
            self._codes[part] = self.memory.code.of(plugins, _ENGINE)
        return self._codes[part]

    def _model_parts(self, target: Target, look: Files) -> Parts:
        """What a target's model is: its files, or its name, and its code."""
        name = self.job.model if target.model is None else target.model.name
        files = [(basename(path), look(str(path))) for path in target.model_files]
        if files:
            name = self._model_in(target.model_files[0])
        if None in (digest for _, digest in files):
            files.append(("unreadable", str(time.time_ns())))
        models = registry.plugins(registry.MODELS)
        # A document of another kind is read by whatever model says that it reads it.
        plugins = [models[name]] if name in models else models.values()
        code = f"model {name if name in models else ''}"
        if code not in self._codes:
            self._codes[code] = self.memory.code.of(plugins, _ENGINE)
        return {"model": canonical([name, files]), "code": self._codes[code]}

    def _model_in(self, file: Path) -> str:
        """Name of the model that a document is of, "" if it is of another kind."""
        key = f"model-name:{self.memory.digests.of(file)}"
        name = self.memory.index.note(key)
        if name is None:
            from animeme.documents import parse_file

            name = str(parse_file(file).get("model", ""))
            self.memory.index.set_note(key, name)
        return name

    def keyed(
        self, lines: Iterable[tuple[int, Line, tuple[int, ...]]], spool: Path
    ) -> list[LineItem]:
        """Items of work for lines (number, line, indices of targets), each with its keys."""
        return [self._item(number, line, targets, spool) for number, line, targets in lines]

    def _item(self, number: int, line: Line, targets: tuple[int, ...], spool: Path) -> LineItem:
        return self._item_and_parts(number, line, targets, spool)[0]

    def _item_and_parts(
        self, number: int, line: Line, targets: tuple[int, ...], spool: Path
    ) -> tuple[LineItem, Parts]:
        """Work on a line, and what of it people are told of."""
        keys, stamps, parts = self._line(line, targets)
        if keys.align:
            content = [keys.align, *(text for entry in keys.by_hand for text in entry)]
            for index in targets:
                model, rig = self.context.prefixes[index]
                own = self.targets[index].model is not None  # whose its remarks are
                content += [model if self._drawn(line, index) is None else "", rig, str(own)]
            keys = replace(keys, end=key_of("line", content))
        return LineItem(line, targets, spool, number, keys, stamps), parts

    def _drawn(self, line: Line, target: int) -> Path | None:
        return drawn(line, self.targets[target].character) if line.side_cars else None

    def _line(
        self, line: Line, targets: Sequence[int]
    ) -> tuple[LineKeys, tuple[tuple[str, str], ...], Parts]:
        """Keys of a line's results, stamps of its files, and what of them people are told of."""
        files = Files(self.memory.digests.look)
        parts = {} if line.findings else parts_of("align", line, LINE, files)
        if not parts:
            return LineKeys(""), tuple(files.stamps), {}
        recorded = not parts["audio"].endswith(ABSENT)
        spoken = is_spoken(line, self.job.speak, recorded)
        parts |= self._common["align"]
        parts["lexicon"] = self._lexicon.of(line, parts["text"])
        parts["voice"] = "-" if spoken else self._voice(line, files)
        parts["code"] = self._code("speak" if spoken else "align")
        align = key_of("align", parts)
        cars = [(car.kind, car.character, car.path.name, files(str(car.path)))
                for car in line.side_cars]  # fmt: skip
        if None in (digest for *_, digest in cars) or parts["voice"] == _UNREADABLE:
            return LineKeys(""), tuple(files.stamps), {}
        by_hand = []
        for speaker in dict.fromkeys(self.targets[i].character for i in targets) if cars else ():
            own = [car for car in cars if car[1] in ("", speaker)]
            said = parts["text"] if any(kind == "edits" for kind, *_ in own) else ""
            if own:
                text = canonical([speaker, own, said, self._code("by hand")])
                by_hand.append((speaker, text))
        # People are told which of them changed.
        for kind in ("edits", "curves"):
            parts[f"{kind} by hand"] = canonical([car for car in cars if car[0] == kind])
        return LineKeys(align, tuple(by_hand)), tuple(files.stamps), parts

    def _voice(self, line: Line, files: Files) -> str:
        """What of the job's voices the line's alignment is keyed on."""
        path = self._voice_file(line)
        if path is None:
            return "-"
        digest, stamped = self._voices[path]
        files.stamps.append((str(path), stamped))
        if digest is None:
            return _UNREADABLE
        return "-" if digest == ABSENT else f"{path.name} {digest}"

    def _voice_file(self, line: Line) -> Path | None:
        """Where the line's voice is, or would be; None if the job has none."""
        voices = self.job.voices
        if voices is None:
            return None
        path = voices
        if not self._one_voice:
            path = voice_path(voices, line.language, line.character)
        if path not in self._voices:
            self._voices[path] = self.memory.digests.look(path)
        return path

    @cached_property
    def _one_voice(self) -> bool:
        """Whether one voice is for all lines."""
        return self.job.voices is not None and self.job.voices.is_file()
