"""Which of a run's results are known already, by their keys."""

from __future__ import annotations

import json
import os
import time
from collections.abc import Collection, Iterable, Mapping, Sequence
from functools import cached_property
from hashlib import sha256
from typing import Any

from animeme.dialogue import Line
from animeme.findings import Finding, Severity
from animeme.job import Job
from animeme.line_keys import Keyring
from animeme.steps import curves_of, delivered_parts, packed, places, unpacked
from animeme.store.keys import (
    canonical,
    target_parts,
)
from animeme.store.memory import Memory
from animeme.tasks import (
    Delivered,
    LineItem,
    LineOutcome,
    Target,
    alignment_file,
    deliver,
    retarget_key,
    speech_file,
    synthesize_key,
)

# How long an entry may be in use before its file says so again: `cache gc` goes by that.
_TOUCH_AFTER_S = 12 * 3600.0


class Recall(Keyring):
    """Keys of a run's lines, and what is known under them.

    Args:
        memory: of earlier runs.
        job: what is run.
        targets: its assets.
        dry: nothing is to be written.
        deliver: the run puts lines' documents into its output folder.
    """

    def __init__(
        self,
        memory: Memory,
        job: Job,
        targets: Sequence[Target],
        *,
        dry: bool = False,
        deliver: bool = True,
    ) -> None:
        super().__init__(memory, job, targets, deliver=deliver)
        self.dry = dry

    def known(self, items: Sequence[LineItem]) -> dict[int, LineOutcome]:
        """Outcome of each line that needs no work; what it delivers is put in place."""
        if not self._delivers:
            return {}
        wanted = {i.number: f"line:{self._keys[i.number]}" for i in items if i.number in self._keys}
        found = self.memory.index.notes(dict.fromkeys(wanted.values()))
        outcomes = {}
        for item in items:
            noted = found.get(wanted.get(item.number, ""))
            key = self._keys.get(item.number, "")
            outcome = self._outcome(item, json.loads(noted), key) if noted else None
            if outcome is not None:
                outcomes[item.number] = outcome
        return outcomes

    def previous(self, items: Sequence[LineItem]) -> dict[int, LineOutcome]:
        """What was delivered last of each line, if all its targets can still have it."""
        if not self._delivers:
            return {}
        before = {i.number: self._last[i.line.key] for i in items if i.line.key in self._last}
        found = self.memory.index.notes(f"line:{key}" for key in before.values())
        outcomes = {}
        for item in items:
            key = before.get(item.number, "")
            noted = json.loads(found.get(f"line:{key}", "{}"))
            if noted and self._fits(item, noted):
                outcome = self._outcome(item, noted, key)
                if outcome and all(f.severity < Severity.ERROR for f in outcome.findings):
                    outcomes[item.number] = outcome
        return outcomes

    def _fits(self, item: LineItem, noted: Mapping[str, Any]) -> bool:
        """Whether curves that were made for a line move the assets that it has now."""
        names = [self._target_name(index) for index in item.targets]
        rows = {place: (key, digest) for place, key, digest in noted["curves"]}
        if noted.get("targets") != names or sorted(rows) != [*range(len(names))]:
            return False
        for place, index in enumerate(item.targets):
            key, digest = rows[place]
            entry = self.memory.store.get(key)
            shapes = self.targets[index].asset.shapes
            if entry is None or entry.digest != digest:
                return False
            if not {*curves_of(entry.payload)[0].names} <= {*shapes}:
                return False
        return True

    def _target_name(self, index: int) -> str:
        """What tells a target from the others, whatever becomes of its asset."""
        target = self.targets[index]
        return f"{target.character}{target.suffix}"

    def stored(self, item: LineItem) -> bool:
        """Whether all results of a line are in the store, whoever put them there."""
        store = self.memory.store
        aligned = store.get(item.keys.align) if item.keys.align else None
        if aligned is None or not aligned.value["digest"]:
            return aligned is not None
        digest = aligned.value["digest"]
        for index in item.targets:
            controls = None
            if self._drawn(item.line, index) is None:
                controls = store.get(synthesize_key(self.context, item.keys, index, digest))
                if controls is None:
                    return False
                if not controls.payload:
                    continue
            if not store.has(retarget_key(self.context, item.keys, index, controls, digest)):
                return False
        return True

    def _tokens(self, item: LineItem) -> dict[str, str]:
        """As `places`, of all that a line and its targets are made of."""
        own = {
            str(path): f"\0model {number} of {target.character}\0"
            for target in (self.targets[index] for index in item.targets)
            for number, path in enumerate(target.model_files)
        }
        return {**own, **places(item.line, self.context)}

    def _outcome(self, item: LineItem, noted: Mapping[str, Any], key: str) -> LineOutcome | None:
        line = item.line
        if time.time() - noted["used"] > _TOUCH_AFTER_S:
            keys = [noted["alignment"], *(key for _, key, _ in noted["curves"])]
            if not all(self.memory.store.touch(key) for key in keys if key):
                return None
            self._note(key, {**noted, "used": time.time()})
        if noted["documents"] and not self._delivered(line, noted):
            return None
        findings: list[Finding] = []
        tokens = self._tokens(item) if noted["findings"] else {}
        for whose, rows in noted["findings"]:
            character = "" if whose is None else self.targets[item.targets[whose]].character
            findings += unpacked(rows, tokens, line=line.key, character=character)
        return LineOutcome(
            noted["audio_s"],
            tuple(findings),
            noted["score"],
            noted["spoken"],
            noted["alignment"],
            tuple((item.targets[place], key, digest) for place, key, digest in noted["curves"]),
            final=True,
        )

    def _delivered(self, line: Line, noted: Mapping[str, Any]) -> bool:
        """Make sure that a line's documents lie in the output folder."""
        output, digests = self.job.output, self.memory.digests
        paths = [alignment_file(output, line)]
        if len(noted["documents"]) > 1:
            paths.append(speech_file(output, line))
        if all(digests.of(p) == d for p, d in zip(paths, noted["documents"], strict=True)):
            return True
        if self.dry:
            return True
        entry = self.memory.store.get(noted["alignment"])
        if entry is None:
            return False
        self.learn(deliver(output, line, *delivered_parts(entry)))
        return True

    def keep(self, item: LineItem, outcome: LineOutcome) -> None:
        """Remember how a line ended, if that holds for the next run too."""
        self.learn(outcome.delivered)
        ours = any(f.ours and f.severity == Severity.ERROR for f in outcome.findings)
        # Where nothing is delivered, nothing is known of the output folder.
        if not outcome.final or not self._delivers or ours or item.number not in self._keys:
            return
        causes = json.dumps(self._causes(item), separators=(",", ":"))
        self.memory.index.set_note(f"causes:{self._keys[item.number]}", causes)
        tokens = self._tokens(item)
        place = {self.targets[i].character: n for n, i in reversed([*enumerate(item.targets)])}
        rows: dict[int | None, list[Any]] = {}
        for finding in outcome.findings:
            rows.setdefault(place.get(finding.character), []).extend(packed([finding], tokens))
        positions = {index: n for n, index in enumerate(item.targets)}
        self._note(
            self._keys[item.number],
            {
                "audio_s": outcome.audio_s,
                "score": outcome.score,
                "spoken": outcome.spoken,
                "alignment": outcome.alignment,
                "curves": [
                    [positions[index], key, digest] for index, key, digest in outcome.curves
                ],
                "targets": [self._target_name(index) for index in item.targets],
                "documents": [file.digest for file in outcome.delivered],
                "findings": [*rows.items()],
                "used": time.time(),
            },
        )

    def _note(self, key: str, noted: Mapping[str, Any]) -> None:
        text = json.dumps(noted, ensure_ascii=False, separators=(",", ":"))
        self.memory.index.set_note(f"line:{key}", text)

    def learn(self, files: Iterable[Delivered]) -> None:
        """Take in the digests of files that were just written."""
        for file in files:
            if file.stamp:
                self.memory.digests.learn(os.path.abspath(file.path), file.stamp, file.digest)

    def ran(self, without: Collection[int] = ()) -> None:
        """Remember which keys the lines of the job had, for `why` and `previous` of a later run.

        Args:
            without: numbers of lines that are as an earlier run left them.
        """
        mine = {line: number for line, number in self._lines.items() if number not in without}
        last = {**self._last, **{line: self._keys[number] for line, number in mine.items()}}
        text = json.dumps(last, ensure_ascii=False, separators=(",", ":"))
        if self._last != last and self._delivers:
            self.memory.index.set_note(self._scope, text)

    def why(self, item: LineItem) -> tuple[str, ...]:
        """What has changed of a line since the job was last run, in people's words."""
        if item.number not in self._keys:
            return ("a file that cannot be read",)
        before = self._last.get(item.line.key)
        noted = self.memory.index.note(f"causes:{before}") if before else None
        if noted is None:
            return ("new",)
        old, new = json.loads(noted), self._causes(item)
        changed = [cause for cause in new if new[cause] != old.get(cause)]
        return tuple(changed) or ("not kept: it failed through no fault of its own",)

    def _causes(self, item: LineItem) -> dict[str, str]:
        """Cause → short digest of what a line's results depend on."""
        settings = "\n".join(part.get("curve settings", "") for part in self._common.values())
        targets = [target_parts(self.targets[index]) for index in item.targets]
        causes = {
            "curve settings": settings,
            **self._parts[item.number],
            "model": canonical([self._models[index] for index in item.targets]),
            "rig": canonical(targets),
            "code": "".join(self._codes.values()),
        }
        return {cause: sha256(text.encode()).hexdigest()[:8] for cause, text in causes.items()}

    @cached_property
    def _scope(self) -> str:
        return f"last:{os.path.abspath(self.job.source)}"

    @cached_property
    def _last(self) -> dict[str, str]:
        """Line → key, when the job was last run."""
        noted = self.memory.index.note(self._scope)
        found: dict[str, str] = json.loads(noted) if noted else {}
        return found
