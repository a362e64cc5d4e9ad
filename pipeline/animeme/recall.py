"""Which of a run's results are known already, by their keys."""

from __future__ import annotations

import json
import os
import time
from collections.abc import Iterable, Iterator, Mapping, Sequence
from functools import cached_property, lru_cache
from hashlib import sha256
from itertools import chain, islice, repeat
from pathlib import Path
from typing import Any

from animeme.dialogue import Line, is_spoken
from animeme.files import stamp
from animeme.findings import Finding, Severity
from animeme.job import Job
from animeme.line_keys import Keyring
from animeme.packing import curve_head, delivered_parts, packed, places, unpacked
from animeme.recent import Recent, files_of, look_of, stamped
from animeme.store.keys import Parts, canonical, key_of, target_parts
from animeme.store.memory import Memory
from animeme.tasks import (
    Delivered,
    LineItem,
    LineKeys,
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
# What is remembered of lines by their look changes with this number.
_FORMAT = 1
# Lines that are looked up together: work on the first few begins while others are looked at.
_AT_ONCE = (20, 100, 500)


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
        self.started_s = time.time()
        self._recent = Recent(memory, f"lines of {os.path.abspath(job.source)}")
        self._causes: dict[int, dict[str, str]] = {}
        self._shared: dict[tuple[int, ...], dict[str, str]] = {}

    def looked_up(
        self, lines: Iterable[tuple[int, Line, tuple[int, ...]]], spool: Path
    ) -> Iterator[list[tuple[LineItem, LineOutcome | None]]]:
        """Items of work for lines, some at a time, each with its outcome if it needs no work.

        A line that looks as it did in the last run is known by that; of others, what they are made
        from is compared. What known lines deliver is put in place.
        """
        self.context  # noqa: B018  which says what all lines' keys have in common
        left = iter(lines)
        for size in chain(_AT_ONCE, repeat(_AT_ONCE[-1])):
            if not (part := [*islice(left, size)]):
                return
            if not self._delivers:
                yield [(self._item(*entry, spool), None) for entry in part]
                continue
            rows = self._recent.rows([line.key for _, line, _ in part])
            taken = [self._taken(*entry, spool, rows.get(entry[1].key)) for entry in part]
            changed = [entry for entry, known in zip(part, taken, strict=True) if known is None]
            found = iter(self._compared(changed, spool) if changed else ())
            yield [next(found) if known is None else known for known in taken]

    def _taken(
        self,
        number: int,
        line: Line,
        targets: tuple[int, ...],
        spool: Path,
        row: tuple[str, str] | None,
    ) -> tuple[LineItem, LineOutcome] | None:
        """A line as it was in the last run, None if it may have changed."""
        if row is None or not row[0]:
            return None
        stamps = stamped(files_of(line))
        if not is_spoken(line, self.job.speak, bool(stamps[0][1])):
            voice = self._voice_file(line)
            stamps += ((str(voice), self._voices[voice][1]),) if voice is not None else ()
        if row[0] != look_of(self._look, line, targets, stamps):
            return None
        known = json.loads(row[1])
        places = self._documents(line)
        for place, there in zip(places, known["stamps"], strict=False):
            if stamp(place) != there:
                return None
        by_hand = tuple((speaker, text) for speaker, text in known["by_hand"])
        keys = LineKeys(known["align"], by_hand, known["key"])
        item = LineItem(line, targets, spool, number, keys, stamps)
        outcome = self._outcome(item, known["noted"], known["stamps"])
        return None if outcome is None else (item, outcome)

    def _compared(
        self, entries: Sequence[tuple[int, Line, tuple[int, ...]]], spool: Path
    ) -> Iterator[tuple[LineItem, LineOutcome | None]]:
        """Lines with their outcomes by what they are made from."""
        self.memory.digests.load(
            path for _, line, _ in entries for path in (*files_of(line), *self._documents(line))
        )
        keyed = [self._item_and_parts(*entry, spool) for entry in entries]
        notes = self.memory.index.notes({f"line:{item.keys.end}" for item, _ in keyed})
        for item, parts in keyed:
            noted = notes.get(f"line:{item.keys.end}") if item.keys.end else None
            outcome = self._outcome(item, json.loads(noted)) if noted else None
            if outcome is None:
                self._causes[item.number] = self._told_causes(item, parts)
            yield item, outcome

    def previous(self, item: LineItem) -> LineOutcome | None:
        """What was delivered last of a line, if all its targets can still have it."""
        if not self._delivers:
            return None
        key = self._recent.known(item.line.key).get("key", "")
        text = self.memory.index.note(f"line:{key}") if key else None
        noted = json.loads(text) if text else {}
        if not noted or not self._fits(item, noted):
            return None
        outcome = self._as_it_was(item, noted, key)
        good = outcome and all(f.severity < Severity.ERROR for f in outcome.findings)
        return outcome if good else None

    def _as_it_was(self, item: LineItem, noted: Mapping[str, Any], key: str) -> LineOutcome | None:
        """How a line ended before it changed; it is not remembered as what it looks like now."""
        if self.started_s - noted["used"] > _TOUCH_AFTER_S:
            keys = [noted["alignment"], *(key for _, key, _ in noted["curves"])]
            if not all(self.memory.store.touch(key) for key in keys if key):
                return None
            self._note(key, {**noted, "used": self.started_s})
        return None if self._delivered(item.line, noted) is None else self._told(item, noted)

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
            if not {*curve_head(entry.payload)[0]["names"]} <= {*shapes}:
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

    def _outcome(
        self, item: LineItem, noted: Mapping[str, Any], stamps: Sequence[str] | None = None
    ) -> LineOutcome | None:
        """How a line ended.

        Args:
            item: the line.
            noted: how it did.
            stamps: of its documents where they are known to be in place.
        """
        line = item.line
        worn = self.started_s - noted["used"] > _TOUCH_AFTER_S
        if worn:
            keys = [noted["alignment"], *(key for _, key, _ in noted["curves"])]
            if not all(self.memory.store.touch(key) for key in keys if key):
                return None
            noted = {**noted, "used": self.started_s}
            self._note(item.keys.end, noted)
        there = stamps is not None
        if stamps is None:
            stamps = self._delivered(line, noted)
            if stamps is None:
                return None
        if worn or not there:
            self._remember(item, noted, stamps)
        return self._told(item, noted)

    def _told(self, item: LineItem, noted: Mapping[str, Any]) -> LineOutcome:
        """The outcome that was noted, in this run's words."""
        line = item.line
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

    def _documents(self, line: Line) -> tuple[str, str]:
        """Where a line's documents are: its alignment, and what was spoken for it."""
        return alignment_file(self.job.output, line), speech_file(self.job.output, line)

    def _delivered(self, line: Line, noted: Mapping[str, Any]) -> list[str] | None:
        """Make sure that a line's documents lie in the output folder; their stamps there.

        None if they are nowhere.
        """
        paths = self._documents(line)[: len(noted["documents"])]
        found = [self.memory.digests.look(path) for path in paths]
        if [digest for digest, _ in found] == noted["documents"] or self.dry:
            return [stamped for _, stamped in found]
        entry = self.memory.store.get(noted["alignment"])
        if entry is None:
            return None
        files = deliver(self.job.output, line, *delivered_parts(entry))
        self.learn(files)
        return [file.stamp for file in files]

    def _remember(self, item: LineItem, noted: Mapping[str, Any], stamps: Sequence[str]) -> None:
        """Have the next run know the line by what it looks like.

        Args:
            item: the line.
            noted: how it ended.
            stamps: of its documents.
        """
        if not self._delivers or self.dry:
            return
        known = {
            "key": item.keys.end,
            "align": item.keys.align,
            "by_hand": item.keys.by_hand,
            "noted": noted,
            "stamps": stamps,
        }
        seen = look_of(self._look, item.line, item.targets, item.stamps)
        documents = zip(self._documents(item.line), stamps, strict=False)
        self._recent.put(item.line.key, seen, known, (*item.stamps, *documents))

    def keep(self, item: LineItem, outcome: LineOutcome | None) -> None:
        """Remember how the work on a line ended, if that holds for the next run too.

        Args:
            item: the line.
            outcome: None if the work on it crashed or hung.
        """
        # Where nothing is delivered, nothing is known of the output folder.
        if not self._delivers:
            return
        causes = self._causes.pop(item.number, None)
        if outcome is not None:
            self.learn(outcome.delivered)
        if outcome is None or not self._lasts(outcome) or not item.keys.end:
            if item.keys.end:
                self._recent.forget(item.line.key, {"key": item.keys.end})
            return
        if causes is not None:
            self.memory.index.set_note(f"causes:{item.keys.end}", _as_json(causes))
        tokens = self._tokens(item)
        place = {self.targets[i].character: n for n, i in reversed([*enumerate(item.targets)])}
        rows: dict[int | None, list[Any]] = {}
        for finding in outcome.findings:
            rows.setdefault(place.get(finding.character), []).extend(packed([finding], tokens))
        positions = {index: n for n, index in enumerate(item.targets)}
        noted = {
            "audio_s": outcome.audio_s,
            "score": outcome.score,
            "spoken": outcome.spoken,
            "alignment": outcome.alignment,
            "curves": [[positions[index], key, digest] for index, key, digest in outcome.curves],
            "targets": [self._target_name(index) for index in item.targets],
            "documents": [file.digest for file in outcome.delivered],
            "findings": [*rows.items()],
            "used": time.time(),
        }
        self._note(item.keys.end, noted)
        self._remember(item, noted, [file.stamp for file in outcome.delivered])

    @staticmethod
    def _lasts(outcome: LineOutcome) -> bool:
        """Whether a line would end like this again."""
        ours = any(f.ours and f.severity == Severity.ERROR for f in outcome.findings)
        return outcome.final and not ours

    def _note(self, key: str, noted: Mapping[str, Any]) -> None:
        self.memory.index.set_note(f"line:{key}", _as_json(noted))

    def learn(self, files: Iterable[Delivered]) -> None:
        """Take in the digests of files that were just written."""
        for file in files:
            if file.stamp:
                self.memory.digests.learn(file.path, file.stamp, file.digest)

    def close(self) -> None:
        """When all lines have ended: remember what they look like, for the next run."""
        self._recent.close()

    def why(self, item: LineItem) -> tuple[str, ...]:
        """What has changed of a line since the job was last run, in people's words."""
        if not item.keys.end:
            return ("a file that cannot be read",)
        before = self._recent.known(item.line.key).get("key")
        noted = self.memory.index.note(f"causes:{before}") if before else None
        if noted is None:
            return ("new",)
        old, new = json.loads(noted), self._causes.pop(item.number, None)
        if new is None:
            new = self._told_causes(item, self._line(item.line, item.targets)[2])
        changed = [cause for cause in new if new[cause] != old.get(cause)]
        return tuple(changed) or ("not kept: it failed through no fault of its own",)

    def _told_causes(self, item: LineItem, parts: Parts) -> dict[str, str]:
        """Cause → short digest of what a line's results depend on; of its own, they are `parts`."""
        own = {cause: _short(text) for cause, text in parts.items()}
        return {"curve settings": self._settings, **own, **self._shared_causes(item.targets)}

    def _shared_causes(self, targets: tuple[int, ...]) -> dict[str, str]:
        """What all lines of the same targets depend on."""
        if targets not in self._shared:
            self._shared[targets] = {
                "model": _short(canonical([self._models[index] for index in targets])),
                "rig": _short(canonical([self._rigs[index] for index in targets])),
                "code": _short(canonical(self._all_codes)),
            }
        return self._shared[targets]

    @cached_property
    def _rigs(self) -> list[str]:
        """What each target's curves depend on; as text it takes longer than many a line."""
        return [key_of("rig", target_parts(target)) for target in self.targets]

    @cached_property
    def _settings(self) -> str:
        parts = self._common.values()
        return _short("\n".join(part.get("curve settings", "") for part in parts))

    @cached_property
    def _all_codes(self) -> list[str]:
        """Digests of the code behind all parts of the work."""
        self.context  # noqa: B018  which looks at the models' code
        for part in ("align", "speak", "rig", "by hand"):
            self._code(part)
        return [digest for _, digest in sorted(self._codes.items())]

    @cached_property
    def _look(self) -> str:
        """What all lines of the run depend on, and where it puts what."""
        codes = self._all_codes
        targets = [[t.character, t.model is None, len(t.model_files)] for t in self.targets]
        job, context = self.job, self.context
        places = [os.path.abspath(path) for path in (job.output, job.voices or "")]
        parts = [
            *(_FORMAT, codes, targets, places, context.prefixes, self._common),
            *(self._lexicon.state, job.speak),
        ]
        return key_of("recent", [canonical(parts)])[:16]


_as_json = json.JSONEncoder(ensure_ascii=False, separators=(",", ":")).encode


@lru_cache(maxsize=1024)  # most causes are the same for many lines
def _short(text: str) -> str:
    return sha256(text.encode("utf-8", "surrogateescape")).hexdigest()[:8]
