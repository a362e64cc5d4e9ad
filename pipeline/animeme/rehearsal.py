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
from animeme.tasks import AssetItem, LineItem


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
    items = recall.keyed(scope.entries() if scope else plan.spoken_lines(), Path())
    known = recall.known(items)
    changed = [item for item in items if item.number not in known]
    kept = recall.previous([i for i in changed if scope and i.number not in scope.asked])
    stale = [i for i in changed if i.number not in kept and not recall.stored(i)]
    outdated = {i.line.key: recall.why(i) for i in changed if i.number in kept}
    known |= kept

    def files_of(item: LineItem) -> set[Path]:
        files = {plan.file_of(plan.targets[index], item.line) for index in item.targets}
        return files & scope.files if scope else files

    every = set().union(*map(files_of, items))
    # A line that only others have done, its files are not known either.
    unwritten = set().union(*(files_of(item) for item in items if item.number not in known))
    ledger = Ledger(plan, io.StringIO())
    ledger.take_up(known)
    files = AssetRecall(memory, job, plan.targets)

    def key_of(item: AssetItem) -> str:
        digests = [ledger.curves[line[0]][item.target][1] for line in item.lines]
        return files.asset_key(item, digests)

    assets = plan.asset_items(ledger.good, ledger.curves, Path())
    if scope is not None:
        assets = [asset for asset in assets if asset.output in scope.files]
    assets = [asset for asset in assets if asset.output not in unwritten]
    there = files.known([(key_of(asset), asset) for asset in assets])
    unwritten |= {a.output for a, found in zip(assets, there, strict=True) if found is None}
    start = len(str(job.output)) + 1
    return Rehearsal(
        job.name,
        len(items),
        {item.line.key: recall.why(item) for item in stale},
        len(every),
        tuple(sorted(str(path)[start:] for path in unwritten)),
        outdated,
    )
