"""What a run would do, and why, without doing any of it."""

from __future__ import annotations

import io
from collections import Counter
from dataclasses import dataclass, field
from importlib.metadata import version
from pathlib import Path
from typing import Any

from animeme.job import Job
from animeme.ledger import Ledger
from animeme.recall import Recall
from animeme.recall_assets import AssetRecall
from animeme.runner import planned
from animeme.scope import scope_of
from animeme.selection import EVERYTHING, Selection
from animeme.store.memory import Memory


@dataclass(frozen=True)
class Rehearsal:
    """What a run would do.

    Attributes:
        job: the job's name.
        lines: how many lines there are.
        stale: line that would be worked on → what has changed of it, or "new".
        outdated: line that would stay as it is, being asked for by nobody → what has changed of it.
        files: how many asset files there are.
        unwritten: those that would be written, relative to the output folder, sorted.
    """

    job: str
    lines: int
    stale: dict[str, tuple[str, ...]]
    files: int
    unwritten: tuple[str, ...]
    outdated: dict[str, tuple[str, ...]] = field(default_factory=dict)

    def causes(self) -> dict[str, int]:
        """Cause → how many lines it makes stale, the most frequent first."""
        counts = Counter(cause for causes in self.stale.values() for cause in causes)
        return dict(sorted(counts.items(), key=lambda entry: (-entry[1], entry[0])))

    def to_document(self) -> dict[str, Any]:
        """An ``animeme.rehearsal/1`` document."""
        return {
            "schema": "animeme.rehearsal/1",
            "animeme": version("animeme"),
            "job": self.job,
            "totals": {
                "lines": self.lines,
                "stale": len(self.stale),
                "files": self.files,
                "unwritten": len(self.unwritten),
            },
            "causes": self.causes(),
            "lines": [{"line": line, "causes": list(why)} for line, why in self.stale.items()],
            "outdated": [{"line": li, "causes": list(why)} for li, why in self.outdated.items()],
            "files": list(self.unwritten),
        }


def rehearse(job: Job, memory: Memory, selection: Selection = EVERYTHING) -> Rehearsal:
    """What `animeme.runner.run_job` would do with these; errors as there."""
    plan, _ = planned(job, memory)
    scope = scope_of(plan, selection)
    recall = Recall(memory, job, plan.targets, dry=True)
    ledger, files = Ledger(plan, io.StringIO()), AssetRecall(memory, job, plan.targets)
    lines = 0
    stale: dict[str, tuple[str, ...]] = {}
    late: dict[str, tuple[str, ...]] = {}
    every: set[str] = set()
    unwritten: set[str] = set()
    for part in recall.looked_up(scope.entries() if scope else plan.spoken_lines(), Path()):
        for item, known in part:
            lines += 1
            own = {plan.file_of(plan.targets[index], item.line) for index in item.targets}
            every |= own
            outcome = known
            if outcome is None and scope and item.number not in scope.asked:
                outcome = recall.previous(item)
                if outcome is not None:
                    late[item.line.key] = recall.why(item)
            if outcome is not None:
                ledger.take_up([(item.number, outcome)])
                continue
            # A line that only others have done, its files are not known either.
            unwritten |= own
            if not recall.stored(item):
                stale[item.line.key] = recall.why(item)

    assets = plan.asset_items(ledger.good, ledger.curves.of, Path())
    keyed = [
        (files.asset_key(asset, digests), asset)
        for asset, digests in assets
        if asset.output not in unwritten
    ]
    there = files.known(keyed)
    unwritten |= {asset.output for (_, asset), old in zip(keyed, there, strict=True) if old is None}
    if scope is not None:
        every, unwritten = every & scope.files, unwritten & scope.files
    start = len(str(job.output)) + 1
    return Rehearsal(
        job.name,
        lines,
        stale,
        len(every),
        tuple(sorted(path[start:] for path in unwritten)),
        late,
    )
