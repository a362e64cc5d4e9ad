"""The work of a run, in its order: lines, files, and what joins languages."""

from __future__ import annotations

import resource
import time
from collections.abc import Callable, Collection, Iterable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from itertools import chain, islice
from pathlib import Path
from typing import Any, TypeVar

from animeme.executors import LATER, Executor, Result
from animeme.findings import Finding
from animeme.ledger import Ledger
from animeme.recall import Recall
from animeme.recall_assets import AssetRecall
from animeme.scope import Entry, Scope, added, outdated
from animeme.shards import Shard
from animeme.tasks import (
    JOIN_LANGUAGES,
    MAKE_LINE,
    WRITE_ASSET,
    AssemblyItem,
    AssetItem,
    AssetOutcome,
    LineItem,
    save_context,
)

# A line of minutes takes seconds; a task beyond these is hung.
LINE_TIMEOUT_S = 600.0
ASSET_TIMEOUT_S = 1800.0
RETRIES = 1
# A result that is lost while a run uses it is made again; not for ever.
MOST_ROUNDS = 3
SAVE_EVERY_S = 5.0
# Files that are looked up together; work on the first begins while others are looked at.
FILES_AT_ONCE = 500

_Item = TypeVar("_Item")


@dataclass(frozen=True)
class Progress:
    """What a listener is told each time something ends.

    Attributes:
        stage: "lines" or "assets".
        done, total: lines, or files while assets are written.
        failed: how many lines have failed so far.
        known: how many of those that are done an earlier run had done.
    """

    stage: str
    done: int
    total: int
    failed: int
    known: int = 0


Listener = Callable[[Progress], None]


@dataclass
class Work:
    """The work of a run, in its order.

    Attributes:
        ledger: takes in how it ends.
        executor: does it.
        listener: is told.
        spool: the run's spool folder.
        recall: knows what need not be done.
        scope: what the run is about, None for everything.
        remarks: line → what the scope makes of it.
    """

    ledger: Ledger
    executor: Executor
    listener: Listener
    spool: Path
    recall: Recall
    scope: Scope | None = None
    remarks: dict[str, Finding] = field(default_factory=dict)
    _saved: float = field(default_factory=time.monotonic)
    # Lines that are being worked on; by number, whether one was made; by target and number, whether
    # its file has been taken up; file → its key, until it is written.
    _under_way: dict[int, LineItem] = field(default_factory=dict)
    _made: bytearray = field(default_factory=bytearray)
    _there: dict[int, bytearray] = field(default_factory=dict)
    _asset_keys: dict[str, str] = field(default_factory=dict)

    def __post_init__(self) -> None:
        self._lines = _Counts("lines", self.ledger, self.listener)
        self._files = _Counts("assets", self.ledger, self.listener)

    @cached_property
    def files(self) -> AssetRecall:
        """Knows which files need not be written."""
        return AssetRecall(self.recall.memory, self.ledger.plan.job, self.ledger.plan.targets)

    def entries(self, shard: Shard | None = None) -> Iterator[Entry]:
        """The lines that the run is about, of a shard or all, with their targets."""
        lines = self.ledger.plan.spoken_lines()
        if self.scope is not None:
            lines = self.scope.entries(asked=shard is not None)
        return (entry for entry in lines if shard is None or shard.has(entry[1].key))

    def do_lines(self, shard: Shard | None = None) -> None:
        """Have curves made for each line, of a shard or of all, but for those that have them."""
        save_context(self.recall.context, self.spool)
        counts = self._lines
        counts.total = sum(1 for _ in self.entries(shard))
        self._made = bytearray(len(self.ledger.plan.lines))
        counts.tell()
        items = self._stale(self.entries(shard))
        if shard is None and self.scope is None and self.executor.overlaps:
            items = chain(items, self._look_ahead())
        for _ in self._make(items):
            counts.done += 1
            counts.tell()
        self.recall.close()

    def _stale(self, lines: Iterable[Entry]) -> Iterator[Any]:
        """The lines that have to be worked on, and a `LATER` now and then; the others are taken up
        on the way.
        """
        for part in self.recall.looked_up(lines, self.spool):
            known = [(item.number, outcome) for item, outcome in part if outcome is not None]
            self.ledger.take_up(known)
            self._lines.take_up(len(known))
            self._lines.tell()
            for item, outcome in part:
                if outcome is None and not self._kept(item):
                    yield item
            self._save()
            yield LATER

    def _look_ahead(self) -> Iterator[Any]:
        """Take up files of one line each that are there, while other lines are worked on.

        Those of lines that this run makes are left for later, as are all when no line is worked on
        any more.
        """
        ledger, count = self.ledger, len(self.ledger.plan.lines)
        self._there = {
            index: bytearray(count)
            for index, target in enumerate(ledger.plan.targets)
            if target.one_line_each
        }

        def good(target: int) -> Iterable[tuple[int, float]]:
            lines = ledger.good(target) if target in self._there else ()
            return (entry for entry in lines if not self._made[entry[0]])

        every = ledger.plan.asset_items(good, ledger.curves.of, self.spool)
        while self._under_way and (part := [*islice(every, FILES_AT_ONCE)]):
            for _, item, outcome in self._looked_up(part):
                self._there[item.target][item.lines[0][0]] = outcome is not None
            yield LATER

    def _kept(self, item: LineItem) -> bool:
        """Whether nobody asked for a line that has changed, and it can stay as it is."""
        if self.scope is None or item.number in self.scope.asked:
            return False
        kept = self.recall.previous(item)
        if kept is not None:
            self.ledger.take_up([(item.number, kept)], "outdated")
            self._lines.take_up(1)
            self._lines.tell()
        why = added() if kept is None else outdated(self.recall.why(item))
        self.remarks[item.line.key] = why
        return kept is not None

    def _make(self, items: Iterable[LineItem]) -> Iterator[None]:
        under_way = self._under_way = {}
        for result in self._run(MAKE_LINE, _noted(items, under_way), LINE_TIMEOUT_S):
            item = under_way.pop(result.index)
            self.ledger.end_line(item, result)
            self._made[item.number] = True
            self.recall.keep(item, result.value)
            self._save()
            yield

    def _save(self) -> None:
        """Have what is new in the index survive the run, now and then."""
        if time.monotonic() - self._saved > SAVE_EVERY_S:
            self.recall.memory.index.save()
            self._saved = time.monotonic()

    def do_assets(self) -> None:
        """Have each file written that is not there as it would be."""
        ledger = self.ledger
        every = ledger.plan.asset_items(self._not_there, ledger.curves.of, self.spool)
        self._files.total = ledger.plan.count_files(ledger.good)
        if self.scope is not None:
            files = self.scope.files
            every = (entry for entry in every if entry[0].output in files)
            self._files.total = len(files)
        waiting: Iterable[AssetItem] = self._unwritten(every)
        for turn in range(1, MOST_ROUNDS + 1):
            lost: set[int] = set()
            again: list[AssetItem] = []
            under_way: dict[int, AssetItem] = {}
            for result in self._run(WRITE_ASSET, _noted(waiting, under_way), ASSET_TIMEOUT_S):
                item = under_way.pop(result.index)
                if result.value is not None and result.value.lost and turn < MOST_ROUNDS:
                    lost.update(result.value.lost)
                    again.append(item)
                    continue
                self._end_asset(item, result)
                self._files.done += 1
                self._files.tell()
                self._save()
            if not again:
                break
            waiting = self._mended(again, lost)

    def _not_there(self, target: int) -> Iterator[tuple[int, float]]:
        """The lines of a target whose files have not been taken up."""
        there = self._there.get(target)
        return (entry for entry in self.ledger.good(target) if there is None or not there[entry[0]])

    def _unwritten(self, every: Iterator[tuple[AssetItem, list[str]]]) -> Iterator[AssetItem]:
        """The files that have to be written; the others are taken up on the way."""
        self._files.tell()
        while part := [*islice(every, FILES_AT_ONCE)]:
            found = self._looked_up(part)
            self._files.tell()
            for key, item, outcome in found:
                if outcome is None:
                    self.ledger.files += 1
                    self._asset_keys[item.output] = key
                    yield item

    def _looked_up(
        self, part: Sequence[tuple[AssetItem, list[str]]]
    ) -> list[tuple[str, AssetItem, AssetOutcome | None]]:
        """Files with their keys, and their outcomes if they are there; those are taken up."""
        keyed = [(self.files.asset_key(item, digests), item) for item, digests in part]
        outcomes = self.files.known(keyed)
        found = [(*entry, outcome) for entry, outcome in zip(keyed, outcomes, strict=True)]
        there = [(item, outcome) for _, item, outcome in found if outcome is not None]
        self.ledger.take_up_assets(there)
        self.ledger.files += len(there)
        self._files.take_up(len(there))
        return found

    def _end_asset(self, item: AssetItem, result: Result) -> None:
        outcome: AssetOutcome | None = result.value
        if outcome is not None and outcome.lost:
            gone = "its lines' curves vanish from the store as fast as they are put there"
            result = replace(result, outcome="error", value=None, error=gone)
        self.ledger.end_asset(item, result)
        key = self._asset_keys.pop(item.output, None)
        if result.value is not None:
            if key is None:  # some of its lines have been made again since it was looked up
                curves = [self.ledger.curves.of(line[0])[item.target][1] for line in item.lines]
                key = self.files.asset_key(item, curves)
            self.files.keep(key, item, result.value)

    def _mended(self, items: Sequence[AssetItem], lost: Collection[int]) -> list[AssetItem]:
        """The items, after the lines that are lost have been made again."""
        self.ledger.record("lost", lines=[self.ledger.plan.lines[n].key for n in sorted(lost)])
        entries = (entry for entry in self.entries() if entry[0] in lost)
        for _ in self._make(self.recall.keyed(entries, self.spool)):
            pass
        again = []
        for item in items:
            self._asset_keys.pop(item.output, None)
            now = {number: self.ledger.curves.of(number) for number, *_ in item.lines}
            lines = tuple(
                (number, name, length_s, now[number][item.target][0], audio)
                for number, name, length_s, _, audio in item.lines
                if item.target in now[number]
            )
            left = {number for number, *_ in lines}
            exports = tuple(export for export in item.exports if export[0] in left)
            again += [replace(item, lines=lines, exports=exports)] if lines else []
        return again

    def join_languages(self) -> None:
        """Give each format the chance to join its languages in one file."""
        items = self._assemblies()
        keys = [self.files.assembly_key(item) for item in items]
        self.ledger.files += len(items)
        waiting = []
        keyed = [*zip(keys, items, strict=True)]
        for (key, item), outcome in zip(keyed, self.files.known(keyed), strict=True):
            if outcome is None:
                waiting.append((key, item))
            else:
                self.ledger.take_up_assembly(item, outcome)
        for result in self._run(JOIN_LANGUAGES, [item for _, item in waiting], ASSET_TIMEOUT_S):
            key, item = waiting[result.index]
            self.ledger.end_assembly(item, result)
            if result.value is not None:
                self.files.keep(key, item, result.value)
        self.files.ran()

    def _assemblies(self) -> list[AssemblyItem]:
        """The files that join languages, of those that were written or are there."""
        plan, scope, start = self.ledger.plan, self.scope, len(str(self.ledger.plan.job.output)) + 1
        beside = frozenset() if scope is None else scope.beside()

        def written(path: Path) -> bool:
            return str(path)[start:] in self.ledger.written or path in beside

        items = plan.assembly_items(written, self.spool)
        return [item for item in items if scope is None or item.target in scope.targets]

    def _run(self, function: str, items: Iterable[Any], timeout_s: float) -> Iterator[Result]:
        return self.executor.run(function, items, timeout_s=timeout_s, retries=RETRIES)


@dataclass
class _Counts:
    """How far a stage is.

    Attributes:
        stage: as of `Progress`.
        ledger: knows what has failed.
        listener: is told.
        done, total, known: as of `Progress`.
    """

    stage: str
    ledger: Ledger
    listener: Listener
    done: int = 0
    total: int = 0
    known: int = 0

    def take_up(self, known: int) -> None:
        """Count what an earlier run had done."""
        self.known += known
        self.done += known

    def tell(self) -> None:
        """Tell the run's listener."""
        failed = self.ledger.failed
        self.listener(Progress(self.stage, self.done, self.total, failed, self.known))


def _noted(items: Iterable[_Item], under_way: dict[int, _Item]) -> Iterator[_Item]:
    """The items, each noted under its index for as long as it is being worked on."""
    index = 0
    for item in items:
        if item is not LATER:
            under_way[index] = item
            index += 1
        yield item


def name_of(function: Callable[..., Any]) -> str:
    """The importable name by which executors call a function."""
    return f"{function.__module__}:{function.__qualname__}"


def cpu_s(executor: Executor) -> float:
    """CPU time of this process, of its ended children and of the executor's living ones."""
    usages = [resource.getrusage(who) for who in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN)]
    return sum(usage.ru_utime + usage.ru_stime for usage in usages) + executor.cpu_s
