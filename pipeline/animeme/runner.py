"""A run from a validated job to its report."""

from __future__ import annotations

import json
import resource
import shutil
import tempfile
import time
from collections import defaultdict
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, TextIO

from animeme import registry
from animeme.dialogue import Line, find_lines
from animeme.errors import InputError, JobError, Problem
from animeme.executors import Executor, Result
from animeme.files import sha256, unwritable
from animeme.findings import Finding, LineResult, RunReport, Severity, status_of
from animeme.job import Job
from animeme.plan import Plan
from animeme.tasks import (
    AssetItem,
    AssetOutcome,
    LineItem,
    LineOutcome,
    RunContext,
    Target,
    make_line,
    save_context,
    write_asset,
)

# A line of minutes takes seconds; a task beyond these is hung.
LINE_TIMEOUT_S = 600.0
ASSET_TIMEOUT_S = 1800.0
RETRIES = 1


@dataclass(frozen=True)
class Progress:
    """What a listener is told each time something ends.

    Attributes:
        done, total: lines, or files while assets are written.
        stage: "lines" or "assets".
        label: what just ended.
        failed: how many lines have failed so far.
    """

    stage: str
    done: int
    total: int
    label: str
    failed: int


Listener = Callable[[Progress], None]


@dataclass
class _State:
    """What is known of each line while the run goes on."""

    plan: Plan
    listener: Listener
    log: TextIO
    audio_s: dict[int, float] = field(default_factory=dict)
    findings: dict[int, list[Finding]] = field(default_factory=lambda: defaultdict(list))
    general: list[Finding] = field(default_factory=list)
    outputs: list[tuple[AssetItem, tuple[Path, ...]]] = field(default_factory=list)

    def record(self, event: str, **data: Any) -> None:
        at = time.strftime("%Y-%m-%dT%H:%M:%S%z")
        self.log.write(json.dumps({"event": event, "at": at, **data}, ensure_ascii=False) + "\n")
        self.log.flush()

    def failed(self) -> int:
        return sum(status_of(findings) == "failed" for findings in self.findings.values())

    def good(self) -> dict[int, float]:
        """Lines that have curves, with their length: no error concerns all of their characters."""
        return {
            number: length_s
            for number, length_s in self.audio_s.items()
            if length_s and not any(f.severity == Severity.ERROR for f in self.findings[number])
        }


def run_job(
    job: Job,
    executor: Executor,
    *,
    fail_on: Severity = Severity.ERROR,
    listener: Listener = lambda _: None,
) -> RunReport:
    """Run a job.

    Args:
        job: what to do.
        executor: who does it.
        fail_on: severity at which the report's exit code turns 1.
        listener: told of progress.

    Returns:
        The report, which is also in the output folder.

    Raises:
        JobError: nothing could be started: no lines, or no asset that could be driven.
        InputError: the output folder cannot be written.
    """
    wall, cpu = time.perf_counter(), _cpu_s()
    lines = find_lines(job.dialogue_root, [c.name for c in job.characters])
    if not lines:
        action = "It holds <language>/<line>.wav with a .txt beside each."
        raise JobError(
            str(job.source),
            [Problem("dialogue.root", f"no recording below '{job.dialogue_root}'", action)],
        )
    targets, broken = _load_targets(job)
    plan = Plan(job, lines, tuple(targets))
    digests = {target.asset.source: sha256(target.asset.source) for target in targets}
    with _output_folder(job.output) as spool, _log(job.output) as log:
        state = _State(plan, listener, log, general=broken)
        state.record("start", job=job.name, lines=len(lines), targets=len(targets))
        _save_context(plan, spool)
        _do_lines(state, plan.line_items(spool), executor)
        _do_assets(state, plan.asset_items(state.good(), spool), executor)
        _join_languages(state)
        state.general += _changed_sources(digests)
        report = _report(state, fail_on)
        report = replace(report, wall_s=time.perf_counter() - wall, cpu_s=_cpu_s() - cpu)
        for name in registry.plugins(registry.REPORTS):
            registry.find(registry.REPORTS, name).load()(report, job.output)
        state.record("end", exit_code=report.exit_code, wall_s=report.wall_s, cpu_s=report.cpu_s)
    return report


def _load_targets(job: Job) -> tuple[list[Target], list[Finding]]:
    """Assets that can be driven, and a finding for each that cannot.

    Raises:
        JobError: none can.
    """
    targets: list[Target] = []
    broken: list[Finding] = []
    for character in job.characters:
        for path in character.assets:
            try:
                asset = registry.format_of(path).load(path)
                rig = registry.stage("bind-rig")(character.rig, asset, job.folder)
            except InputError as error:
                broken.append(Finding.from_error(error, character=character.name))
                continue
            targets.append(Target(character.name, asset, rig))
            if rig.missing:
                broken.append(_missing_shapes(targets[-1]))
    # A character with one broken asset is broken: half a delivery would pass for a whole one.
    lost = {finding.character for finding in broken if finding.severity == Severity.ERROR}
    targets = [target for target in targets if target.character not in lost]
    if not targets:
        problems = [
            Problem(f"characters.{f.character}", f"{f.place}: {f.message}", f.action)
            for f in broken
            if f.severity == Severity.ERROR
        ]
        raise JobError(str(job.source), problems)
    return targets, broken


def _missing_shapes(target: Target) -> Finding:
    names = ", ".join(target.rig.missing)
    return Finding(
        Severity.INFO,
        "rig-shapes-missing",
        f"the rig lacks {len(target.rig.missing)} shapes of '{target.rig.profile.name}': {names}",
        place=str(target.asset.source),
        character=target.character,
    )


def _save_context(plan: Plan, spool: Path) -> None:
    job = plan.job
    context = RunContext(
        plan.targets,
        job.aligner,
        job.model,
        job.model_file,
        job.rate_hz,
        job.max_error,
        job.output,
    )
    save_context(context, spool)


def _do_lines(state: _State, items: Sequence[LineItem], executor: Executor) -> None:
    results = executor.run(_name(make_line), items, timeout_s=LINE_TIMEOUT_S, retries=RETRIES)
    for done, result in enumerate(results, 1):
        item = items[result.index]
        outcome: LineOutcome | None = result.value
        if outcome is None:
            state.findings[item.number].append(_fault(result, item.line))
        else:
            state.audio_s[item.number] = outcome.audio_s
            state.findings[item.number] += outcome.findings
        status = status_of(state.findings[item.number])
        state.record("line", line=item.line.key, status=status, **_effort(result))
        state.listener(Progress("lines", done, len(items), item.line.key, state.failed()))


def _do_assets(state: _State, items: Sequence[AssetItem], executor: Executor) -> None:
    results = executor.run(_name(write_asset), items, timeout_s=ASSET_TIMEOUT_S, retries=RETRIES)
    for done, result in enumerate(results, 1):
        item = items[result.index]
        character = state.plan.targets[item.target].character
        outcome: AssetOutcome | None = result.value
        if outcome is None:
            findings: tuple[Finding, ...] = (_fault(result, None, str(item.output)),)
        else:
            findings = outcome.findings
            state.outputs.append((item, outcome.outputs))
        for number, _, _ in item.lines:
            key = state.plan.lines[number].key
            state.findings[number] += [
                replace(finding, line=key, character=character)
                for finding in findings
                if finding.line in ("", state.plan.lines[number].id)
            ]
        name = _relative(item.output, state.plan.job.output)
        state.record("asset", output=name, lines=len(item.lines), **_effort(result))
        state.listener(Progress("assets", done, len(items), name, state.failed()))


def _effort(result: Result) -> dict[str, Any]:
    effort: dict[str, Any] = {
        "outcome": result.outcome,
        "attempt": result.attempt,
        "wall_s": round(result.wall_s, 4),
        "cpu_s": round(result.cpu_s, 4),
    }
    return {**effort, "error": result.error} if result.error else effort


def _fault(result: Result, line: Line | None, place: str = "") -> Finding:
    """The finding for a task that did not answer: a fault of ours or of a plug-in."""
    last = result.error.strip().splitlines()[-1] if result.error else ""
    what = {"error": "failed", "crash": "crashed", "timeout": "hung"}.get(result.outcome, "failed")
    return Finding(
        Severity.ERROR,
        f"worker-{result.outcome}",
        f"the work on it {what}: {last}",
        place=place or (str(line.audio) if line else ""),
        action="run.jsonl has the details; please report it.",
        line=line.key if line else "",
        ours=True,
    )


def _join_languages(state: _State) -> None:
    """Give each format the chance to join its languages in one file."""
    by_target: dict[int, dict[str, Path]] = defaultdict(dict)
    layouts = {c.name: c.layout for c in state.plan.job.characters}
    for item, outputs in state.outputs:
        target = state.plan.targets[item.target]
        joins = bool(state.plan.format_of(target).assembly_suffix)
        if outputs and joins and layouts[target.character] == "per-character":
            by_target[item.target][item.language] = item.output
    for index, files in sorted(by_target.items()):
        target = state.plan.targets[index]
        form = state.plan.format_of(target)
        path = state.plan.assembly_path(target)
        try:
            written = form.write_assembly(target.asset, dict(sorted(files.items())), path)
        except InputError as error:
            state.general.append(Finding.from_error(error, character=target.character))
            continue
        item = AssetItem(index, "", (), path, path)
        state.outputs.append((item, written))


def _changed_sources(digests: dict[Path, str]) -> Iterator[Finding]:
    for path, digest in digests.items():
        if not path.is_file() or sha256(path) != digest:
            yield Finding(
                Severity.ERROR,
                "source-changed",
                "changed while the run was reading it",
                place=str(path),
                action="Run again when nobody writes to the asset.",
            )


def _report(state: _State, fail_on: Severity) -> RunReport:
    plan, output = state.plan, state.plan.job.output
    files: dict[tuple[int, str], set[str]] = defaultdict(set)
    for item, outputs in state.outputs:
        character = plan.targets[item.target].character
        for number, _, _ in item.lines:
            files[number, character] |= {_relative(path, output) for path in outputs}
    lost = {f.character: f for f in state.general if f.character and f.severity == Severity.ERROR}
    results = []
    for number, line in enumerate(plan.lines):
        for character in plan.characters_of(line):
            findings = [f for f in state.findings[number] if f.character in ("", character)]
            if character in lost and not files[number, character]:
                message = "its character's asset cannot be driven"
                findings.append(
                    replace(
                        lost[character],
                        line=line.key,
                        message=f"{message}: {lost[character].message}",
                    )
                )
            findings = list(dict.fromkeys(replace(f, character=character) for f in findings))
            results.append(
                LineResult(
                    line.key,
                    line.language,
                    character,
                    state.audio_s.get(number, 0.0),
                    status_of(findings),
                    tuple(sorted(findings, key=lambda f: (-f.severity, f.code, f.message))),
                    tuple(sorted(files[number, character])),
                )
            )
    delivered = sorted({_relative(p, output) for _, outputs in state.outputs for p in outputs})
    return RunReport(
        plan.job.name,
        tuple(sorted(results, key=lambda r: (r.character, r.language, r.line))),
        tuple(sorted(state.general, key=lambda f: (-f.severity, f.character, f.code, f.place))),
        tuple(delivered),
        fail_on,
    )


def _relative(path: Path, output: Path) -> str:
    return path.relative_to(output).as_posix()


def _name(function: Callable[..., Any]) -> str:
    return f"{function.__module__}:{function.__qualname__}"


def _cpu_s() -> float:
    """CPU time of this process and of its ended children."""
    usages = [resource.getrusage(who) for who in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN)]
    return sum(usage.ru_utime + usage.ru_stime for usage in usages)


@contextmanager
def _output_folder(output: Path) -> Iterator[Path]:
    """Make the output folder; give a spool folder in it, gone afterwards."""
    made = [folder for folder in (output, *output.parents) if not folder.exists()]
    try:
        output.mkdir(parents=True, exist_ok=True)
        spool = Path(tempfile.mkdtemp(prefix=".animeme-", dir=output))
    except OSError as error:
        raise unwritable(output, error) from error
    try:
        yield spool
    finally:
        shutil.rmtree(spool, ignore_errors=True)
        for folder in made:  # nothing came of the run: leave no empty folders either
            if folder.is_dir() and not any(folder.iterdir()):
                folder.rmdir()


@contextmanager
def _log(output: Path) -> Iterator[TextIO]:
    try:
        with (output / "run.jsonl").open("w", encoding="utf-8", newline="\n") as log:
            yield log
    except OSError as error:
        raise unwritable(output / "run.jsonl", error) from error
