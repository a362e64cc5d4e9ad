"""What is known of each line while a run goes on, and the report it becomes."""

from __future__ import annotations

import json
import time
from collections import defaultdict
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property, lru_cache
from pathlib import Path
from typing import Any, TextIO

from animeme.dialogue import Line
from animeme.executors import Result
from animeme.findings import (
    Effort,
    Finding,
    LineResult,
    LineStatus,
    RunReport,
    Severity,
    status_of,
)
from animeme.plan import Plan
from animeme.tasks import (
    AssemblyItem,
    AssetItem,
    AssetOutcome,
    LineItem,
    LineOutcome,
    alignment_file,
    speech_file,
)


class LineCurves:
    """Target → key and digest of each line's curves: 68 bytes each, there may be millions.

    Args:
        count: how many lines there are.
    """

    def __init__(self, count: int) -> None:
        self._packed = [b""] * count

    def put(self, number: int, curves: Iterable[tuple[int, str, str]]) -> None:
        """Take in those of a line: (target, key, digest) each."""
        self._packed[number] = b"".join(
            target.to_bytes(4, "big") + bytes.fromhex(key) + bytes.fromhex(digest)
            for target, key, digest in curves
        )

    def of(self, number: int) -> dict[int, tuple[str, str]]:
        """Target → key and digest."""
        packed = self._packed[number]
        rows = (packed[start : start + 68] for start in range(0, len(packed), 68))
        return {int.from_bytes(row[:4], "big"): (row[4:36].hex(), row[36:].hex()) for row in rows}


@dataclass
class Ledger:
    """The running record of a run.

    Attributes:
        plan: what is being done.
        log: ``run.jsonl``, flushed with every event.
        audio_s: of each line, by its number: its length in seconds, None until it has ended.
        spoken: numbers of the lines that were spoken for want of a recording.
        findings: number of each line → its findings, where there are any.
        general: findings that concern no single line.
        outputs: of each line: (character, file that holds it), from the output folder.
        written: every asset file that is there as this run would write it, likewise.
        curves: of each line.
        known_lines, known_files: how many an earlier run had done.
        files: how many files there are to write.
        step_s: step → CPU seconds over all workers.
        step_results: step → how many of its results were made, and how many found in the store.
    """

    plan: Plan
    log: TextIO
    spoken: set[int] = field(default_factory=set)
    findings: dict[int, list[Finding]] = field(default_factory=lambda: defaultdict(list))
    general: list[Finding] = field(default_factory=list)
    written: set[str] = field(default_factory=set)
    known_lines: int = 0
    known_files: int = 0
    files: int = 0
    step_s: dict[str, float] = field(default_factory=lambda: defaultdict(float))
    step_results: dict[str, tuple[int, int]] = field(default_factory=dict)
    _failed: set[int] = field(default_factory=set)
    # By number of a line: characters in whose files it is not ("": all), and what its files said.
    _unfit: dict[int, set[str]] = field(default_factory=dict)
    _in_files: dict[int, list[Finding]] = field(default_factory=lambda: defaultdict(list))
    _lost: dict[str, list[Finding]] = field(default_factory=dict)

    def __post_init__(self) -> None:
        count = len(self.plan.lines)
        self.audio_s: list[float | None] = [None] * count
        self.outputs: list[tuple[tuple[str, str], ...]] = [()] * count
        self.curves = LineCurves(count)

    def record(self, event: str, **data: Any) -> None:
        """Write one event to the log."""
        self.log.write(_event(event, data))
        self.log.flush()

    def take_up(self, outcomes: Iterable[tuple[int, LineOutcome]], how: str = "known") -> None:
        """Take in lines that an earlier run did as this one would.

        Args:
            outcomes: number of each, and what became of it.
            how: "known", or "outdated" if their inputs have changed since.
        """
        at = _now()
        for number, outcome in outcomes:
            self.known_lines += 1
            self._end(number, outcome)
            key, status = self.plan.lines[number].key, self._status(number)
            self.log.write(
                f'{{"event": "line", "at": "{at}", "line": {_quoted(key)}, '
                f'"status": "{status}", "outcome": "{how}"}}\n'
            )
        self.log.flush()

    def end_line(self, item: LineItem, result: Result) -> None:
        """Take in how the work on a line ended."""
        outcome: LineOutcome | None = result.value
        # If it is made again: what was found in its files stays.
        self.findings.pop(item.number, None)
        self._failed.discard(item.number)
        self._unfit.pop(item.number, None)
        if item.number in self._in_files:
            self._add(item.number, self._in_files[item.number])
        steps: dict[str, Any] = {}
        if outcome is None:
            fault = fault_of(result, item.line.audio_file)
            self._judge(item.number, [replace(fault, line=item.line.key)])
        else:
            self._end(item.number, outcome)
            for step, seconds, hit in outcome.effort:
                self.step_s[step] += seconds
                made, found = self.step_results.get(step, (0, 0))
                self.step_results[step] = (made + (not hit), found + hit)
            if outcome.effort and all(found for *_, found in outcome.effort):
                self.known_lines += 1
            anew = {step for step, _, found in outcome.effort if not found}
            names = dict.fromkeys(step for step, *_ in outcome.effort)
            steps = {"found": [step for step in names if step not in anew]}
            steps |= {"made": [step for step in names if step in anew]}
            steps |= {"damaged": outcome.damaged} if outcome.damaged else {}
        status = self._status(item.number)
        self.record("line", line=item.line.key, status=status, **steps, **_effort(result))

    def _end(self, number: int, outcome: LineOutcome) -> None:
        self.audio_s[number] = outcome.audio_s
        self.curves.put(number, outcome.curves)
        if outcome.spoken:
            self.spoken.add(number)
        if outcome.findings:
            self._judge(number, outcome.findings)

    def _status(self, number: int) -> LineStatus:
        findings = self.findings.get(number)
        return status_of(findings) if findings else "ok"

    def take_up_assets(self, known: Iterable[tuple[AssetItem, AssetOutcome]]) -> None:
        """Take in files that an earlier run wrote as this one would."""
        at = _now()
        for item, outcome in known:
            self.known_files += 1
            self._end_asset(item, outcome.outputs, outcome.findings)
            self.log.write(
                f'{{"event": "asset", "at": "{at}", "output": '
                f'{_quoted(self._relative(item.output))}, "lines": {len(item.lines)}, '
                '"outcome": "known"}\n'
            )

    def end_asset(self, item: AssetItem, result: Result) -> None:
        """Take in how the work on a file ended: its findings go to the lines in it."""
        outcome: AssetOutcome | None = result.value
        findings = (fault_of(result, item.output),) if outcome is None else outcome.findings
        self.step_s["write"] += result.cpu_s
        self._end_asset(item, outcome.outputs if outcome else (), findings)
        self.record(
            "asset", output=self._relative(item.output), lines=len(item.lines), **_effort(result)
        )

    def _end_asset(
        self, item: AssetItem, outputs: Sequence[str], findings: Sequence[Finding]
    ) -> None:
        character = self.plan.targets[item.target].character
        paths = [*map(self._relative, outputs)]
        self.written.update(paths)
        held = tuple((character, path) for path in paths)
        for number, name, *_ in item.lines:
            if findings:
                line = self.plan.lines[number].key
                own = [finding for finding in findings if finding.line in ("", name)]
                said = [replace(f, line=line, character=character) for f in own]
                self._in_files[number] += said
                self._add(number, said)
            self.outputs[number] += held

    def take_up_assembly(self, item: AssemblyItem, outcome: AssetOutcome) -> None:
        """Take in a file that joins languages and was there already."""
        self.known_files += 1
        self.general += outcome.findings
        self.written.update(map(self._relative, outcome.outputs))
        self.record("assembly", output=self._relative(item.output), outcome="known")

    def end_assembly(self, item: AssemblyItem, result: Result) -> None:
        """Take in how the work on a file that joins languages ended."""
        character = self.plan.targets[item.target].character
        outcome: AssetOutcome | None = result.value
        findings = (fault_of(result, str(item.output)),) if outcome is None else outcome.findings
        self.step_s["write"] += result.cpu_s
        # Its lines are in the languages' own files: what is wrong here fails none of them.
        self.general += [replace(finding, character=character) for finding in findings]
        self.written.update(map(self._relative, outcome.outputs if outcome else ()))
        self.record("assembly", output=self._relative(item.output), **_effort(result))

    def good(self, target: int) -> Iterator[tuple[int, float]]:
        """Number and length in seconds of each line that has curves for a target, in order.

        What becomes of a line's file on another target makes no difference.
        """
        unfit_for = {"", self.plan.targets[target].character}
        for number, length_s in enumerate(self.audio_s):
            if length_s and not (
                number in self._unfit and not unfit_for.isdisjoint(self._unfit[number])
            ):
                yield number, length_s

    def fresh(self) -> set[str]:
        """Every file that is there as this run would write it, from the output folder."""
        output, lines = self.plan.job.output, self.plan.lines
        good = (n for n, length_s in enumerate(self.audio_s) if length_s and n not in self._failed)
        fresh = {self._relative(alignment_file(output, lines[number])) for number in good}
        fresh.update(
            self._relative(speech_file(output, lines[n])) for n in self.spoken - self._failed
        )
        fresh |= self.written
        return fresh

    @property
    def failed(self) -> int:
        """How many lines have failed so far."""
        return len(self._failed)

    def _judge(self, number: int, findings: Iterable[Finding]) -> None:
        """Take in what the work on a line found: with an error it goes into no file."""
        new = list(findings)
        self._add(number, new)
        whose = {finding.character for finding in new if finding.severity == Severity.ERROR}
        if whose:
            self._unfit[number] = whose

    def _add(self, number: int, findings: Iterable[Finding]) -> None:
        new = list(findings)
        self.findings[number] += new
        if any(finding.severity == Severity.ERROR for finding in new):
            self._failed.add(number)

    def report(self, fail_on: Severity) -> RunReport:
        """The report of what has been recorded."""
        driven = {target.character for target in self.plan.targets}
        self._lost = defaultdict(list)
        for finding in self.general:
            if finding.severity == Severity.ERROR and finding.character not in driven:
                self._lost[finding.character].append(finding)
        lines = [
            self._line_result(number, line, character)
            for number, line in enumerate(self.plan.lines)
            for character in self.plan.characters_of(line)
        ]
        lines.sort(key=lambda r: (r.character, r.language, r.line))
        return RunReport(
            self.plan.job.name,
            tuple(lines),
            tuple(sorted(self.general, key=lambda f: (-f.severity, f.character, f.code, f.place))),
            tuple(sorted(self.written)),
            fail_on,
            effort=Effort(
                len(self.audio_s) - self.audio_s.count(None),
                self.files,
                self.known_lines,
                self.known_files,
                {step: round(seconds, 3) for step, seconds in sorted(self.step_s.items())},
                dict(sorted(self.step_results.items())),
            ),
        )

    def _line_result(self, number: int, line: Line, character: str) -> LineResult:
        key, seconds = line.key, self.audio_s[number] or 0.0
        paths = tuple(sorted(path for who, path in self.outputs[number] if who == character))
        own, lost = self.findings.get(number, ()), self._lost.get(character, ())
        if not own and not lost:
            return LineResult(key, line.language, character, seconds, "ok", (), paths)
        findings = [f for f in own if f.character in ("", character)]
        # An asset that could not be loaded fails every line of its character.
        findings += [
            replace(f, line=key, message=f"its character's asset cannot be used: {f.message}")
            for f in lost
        ]
        distinct = dict.fromkeys(replace(f, character=character) for f in findings)
        return LineResult(
            key,
            line.language,
            character,
            seconds,
            status_of(distinct),
            tuple(sorted(distinct, key=lambda f: (-f.severity, f.code, f.place, f.message))),
            paths,
        )

    def _relative(self, path: Path | str) -> str:
        """A path below the output folder; there may be as many as lines."""
        return str(path)[self._start :]

    @cached_property
    def _start(self) -> int:
        return len(str(self.plan.job.output)) + 1


def _now() -> str:
    return _at(int(time.time()))


@lru_cache(maxsize=1)
def _at(second: int) -> str:
    return time.strftime("%Y-%m-%dT%H:%M:%S%z", time.localtime(second))


_quoted = json.encoder.encode_basestring
"""A text as JSON; an event of what is known is written out by hand, there may be as many as lines.
"""


def _event(event: str, data: Mapping[str, Any], at: str = "") -> str:
    at = at or _now()
    return json.dumps({"event": event, "at": at, **data}, ensure_ascii=False) + "\n"


def _effort(result: Result) -> dict[str, Any]:
    effort: dict[str, Any] = {
        "outcome": result.outcome,
        "attempt": result.attempt,
        "wall_s": round(result.wall_s, 4),
        "cpu_s": round(result.cpu_s, 4),
    }
    effort |= {"host": result.host} if result.host else {}
    return {**effort, "error": result.error} if result.error else effort


def fault_of(
    result: Result, place: str, action: str = "run.jsonl has the details; please report it."
) -> Finding:
    """The finding for a task that did not answer: a fault of ours or of a plug-in."""
    last = result.error.strip().splitlines()[-1].rstrip(". ") if result.error else "no answer"
    what = {"crash": "crashed", "timeout": "hung"}.get(result.outcome, "failed")
    return Finding(
        Severity.ERROR,
        f"worker-{result.outcome}",
        f"the work on it {what}: {last}",
        place=place,
        action=action,
        ours=True,
    )
