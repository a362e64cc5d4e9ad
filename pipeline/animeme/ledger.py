"""What is known of each line while a run goes on, and the report it becomes."""

from __future__ import annotations

import json
import time
from collections import defaultdict
from collections.abc import Iterable
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, TextIO

from animeme.executors import Result
from animeme.findings import Finding, LineResult, RunReport, Severity, status_of
from animeme.plan import Plan
from animeme.tasks import (
    AssemblyItem,
    AssetItem,
    AssetOutcome,
    LineItem,
    LineOutcome,
    alignment_path,
    speech_path,
)


@dataclass
class Ledger:
    """The running record of a run.

    Attributes:
        plan: what is being done.
        log: ``run.jsonl``, flushed with every event.
        audio_s: number of each line that was read → its length in seconds.
        spoken: numbers of the lines that were spoken for want of a recording.
        findings: number of each line → its findings.
        general: findings that concern no single line.
        outputs: number of each line, character → files that hold it.
        written: every asset file written.
    """

    plan: Plan
    log: TextIO
    audio_s: dict[int, float] = field(default_factory=dict)
    spoken: set[int] = field(default_factory=set)
    findings: dict[int, list[Finding]] = field(default_factory=lambda: defaultdict(list))
    general: list[Finding] = field(default_factory=list)
    outputs: dict[tuple[int, str], set[Path]] = field(default_factory=lambda: defaultdict(set))
    written: set[Path] = field(default_factory=set)
    _failed: set[int] = field(default_factory=set)
    _lost: dict[str, list[Finding]] = field(default_factory=dict)

    def record(self, event: str, **data: Any) -> None:
        """Write one event to the log."""
        at = time.strftime("%Y-%m-%dT%H:%M:%S%z")
        self.log.write(json.dumps({"event": event, "at": at, **data}, ensure_ascii=False) + "\n")
        self.log.flush()

    def end_line(self, item: LineItem, result: Result) -> None:
        """Take in how the work on a line ended."""
        outcome: LineOutcome | None = result.value
        if outcome is None:
            fault = fault_of(result, str(item.line.audio))
            self._add(item.number, [replace(fault, line=item.line.key)])
        else:
            self.audio_s[item.number] = outcome.audio_s
            self.spoken |= {item.number} if outcome.spoken else set()
            self._add(item.number, outcome.findings)
        status = status_of(self.findings[item.number])
        self.record("line", line=item.line.key, status=status, **_effort(result))

    def end_asset(self, item: AssetItem, result: Result) -> None:
        """Take in how the work on a file ended: its findings go to the lines in it."""
        character = self.plan.targets[item.target].character
        outcome: AssetOutcome | None = result.value
        findings = (fault_of(result, str(item.output)),) if outcome is None else outcome.findings
        for number, name, *_ in item.lines:
            line = self.plan.lines[number].key
            own = (finding for finding in findings if finding.line in ("", name))
            self._add(number, (replace(f, line=line, character=character) for f in own))
            self.outputs[number, character] |= set(outcome.outputs if outcome else ())
        self.written |= set(outcome.outputs if outcome else ())
        self.record(
            "asset", output=self._relative(item.output), lines=len(item.lines), **_effort(result)
        )

    def end_assembly(self, item: AssemblyItem, result: Result) -> None:
        """Take in how the work on a file that joins languages ended."""
        character = self.plan.targets[item.target].character
        outcome: AssetOutcome | None = result.value
        findings = (fault_of(result, str(item.output)),) if outcome is None else outcome.findings
        # Its lines are in the languages' own files: what is wrong here fails none of them.
        self.general += [replace(finding, character=character) for finding in findings]
        self.written |= set(outcome.outputs if outcome else ())
        self.record("assembly", output=self._relative(item.output), **_effort(result))

    def good(self, character: str) -> dict[int, float]:
        """Lines that have curves for a character, with their length in seconds."""
        return {
            number: length_s
            for number, length_s in self.audio_s.items()
            if length_s
            and not any(
                finding.severity == Severity.ERROR and finding.character in ("", character)
                for finding in self.findings[number]
            )
        }

    def fresh(self) -> set[Path]:
        """Every file that this run wrote, alignments included."""
        aligned = {
            alignment_path(self.plan.job.output, self.plan.lines[number])
            for number, length_s in self.audio_s.items()
            if length_s and number not in self._failed
        }
        spoken = {
            speech_path(self.plan.job.output, self.plan.lines[number])
            for number in self.spoken - self._failed
        }
        return self.written | aligned | spoken

    @property
    def failed(self) -> int:
        """How many lines have failed so far."""
        return len(self._failed)

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
            self._line_result(number, character)
            for number, line in enumerate(self.plan.lines)
            for character in self.plan.characters_of(line)
        ]
        return RunReport(
            self.plan.job.name,
            tuple(sorted(lines, key=lambda r: (r.character, r.language, r.line))),
            tuple(sorted(self.general, key=lambda f: (-f.severity, f.character, f.code, f.place))),
            tuple(sorted(self._relative(path) for path in self.written)),
            fail_on,
        )

    def _line_result(self, number: int, character: str) -> LineResult:
        line = self.plan.lines[number]
        findings = [f for f in self.findings[number] if f.character in ("", character)]
        # An asset that could not be loaded fails every line of its character.
        findings += [
            replace(f, line=line.key, message=f"its character's asset cannot be used: {f.message}")
            for f in self._lost.get(character, ())
        ]
        distinct = dict.fromkeys(replace(f, character=character) for f in findings)
        return LineResult(
            line.key,
            line.language,
            character,
            self.audio_s.get(number, 0.0),
            status_of(distinct),
            tuple(sorted(distinct, key=lambda f: (-f.severity, f.code, f.place, f.message))),
            tuple(sorted(map(self._relative, self.outputs[number, character]))),
        )

    def _relative(self, path: Path) -> str:
        return path.relative_to(self.plan.job.output).as_posix()


def _effort(result: Result) -> dict[str, Any]:
    effort: dict[str, Any] = {
        "outcome": result.outcome,
        "attempt": result.attempt,
        "wall_s": round(result.wall_s, 4),
        "cpu_s": round(result.cpu_s, 4),
    }
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
