"""A run from a validated job to its report."""

from __future__ import annotations

import io
import tempfile
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path

from animeme import registry
from animeme.errors import InputError
from animeme.executors import Executor
from animeme.files import unwritable
from animeme.findings import Finding, RunReport, Severity
from animeme.job import Job
from animeme.ledger import Ledger
from animeme.outputs import require_distinct_curve_files, require_free_outputs, stale_outputs
from animeme.plan import REPORT_NAMES, Plan
from animeme.preflight import dialogue_of, missing_voices, prepare
from animeme.recall import Recall
from animeme.scope import scope_of
from animeme.selection import EVERYTHING, Selection
from animeme.shards import Shard
from animeme.spool import output_folder
from animeme.store.memory import Memory
from animeme.work import Listener, Work, cpu_s


def run_job(
    job: Job,
    executor: Executor,
    memory: Memory,
    *,
    fail_on: Severity = Severity.ERROR,
    listener: Listener = lambda _: None,
    selection: Selection = EVERYTHING,
) -> RunReport:
    """Run a job.

    Args:
        job: what to do; its files and plug-ins are checked here.
        executor: who does it.
        memory: of earlier runs.
        fail_on: severity at which the report's exit code turns 1.
        listener: told of progress.
        selection: the lines that are wanted; files that hold none of them stay as they are.

    Returns:
        The report, which is also in the output folder.

    Raises:
        JobError: nothing could be started: no lines, no asset that could be driven, or an output
            that would overwrite an input.
        PluginError: a plug-in that the job needs cannot be loaded.
        InputError: the output folder cannot be written, or the selection fits no line.
    """
    wall, cpu = time.perf_counter(), cpu_s(executor)
    plan, findings = planned(job, memory, executor)
    scope = scope_of(plan, selection)
    digests = {t.asset.source: memory.digests.of(t.asset.source) for t in plan.targets}
    with output_folder(job.output) as spool, _log(plan, findings) as ledger:
        # `animeme review` finds the recordings and assets of a run by its job file.
        file = str(job.source.absolute())
        ledger.record(
            "start", job=job.name, file=file, lines=len(plan.lines), targets=len(plan.targets)
        )
        work = Work(ledger, executor, listener, spool, Recall(memory, job, plan.targets), scope)
        work.do_lines()
        work.do_assets()
        work.join_languages()
        executor.release()
        stale = stale_outputs(plan, ledger.fresh())
        ledger.general += [
            *_changed_sources(digests, memory),
            *(finding for finding in stale if scope is None or scope.covers(finding)),
        ]
        report = ledger.report(fail_on)
        report = scope.told(report, work.remarks) if scope else report
        report = replace(report, wall_s=time.perf_counter() - wall, cpu_s=cpu_s(executor) - cpu)
        report = _write_reports(report, job.output)
        ledger.record("end", exit_code=report.exit_code, **report.figures())
    return report


def run_shard(
    job: Job,
    executor: Executor,
    memory: Memory,
    shard: Shard,
    *,
    fail_on: Severity = Severity.ERROR,
    listener: Listener = lambda _: None,
    selection: Selection = EVERYTHING,
) -> RunReport:
    """Do a part of a job's lines, for the store alone: nothing is put into the output folder.

    Args:
        job, executor, memory, fail_on, listener: as of `run_job`.
        shard: which part.
        selection: of which lines it is a part.

    Returns:
        A report of these lines; `run_job` with the same store writes the files.

    Raises:
        JobError, PluginError, InputError: as of `run_job`.
    """
    wall, cpu = time.perf_counter(), cpu_s(executor)
    plan, findings = planned(job, memory, executor)
    with tempfile.TemporaryDirectory(prefix="animeme-") as spool:
        ledger = Ledger(plan, io.StringIO(), general=findings)
        recall = Recall(memory, job, plan.targets, deliver=False)
        scope = scope_of(plan, selection)
        work = Work(ledger, executor, listener, Path(spool), recall, scope)
        work.do_lines(shard)
        report = ledger.report(fail_on)
        mine = {line.key for _, line, _ in work.entries(shard)}
    return replace(
        report,
        lines=tuple(line for line in report.lines if line.line in mine),
        wall_s=time.perf_counter() - wall,
        cpu_s=cpu_s(executor) - cpu,
    )


def planned(
    job: Job, memory: Memory, executor: Executor | None = None
) -> tuple[Plan, list[Finding]]:
    """What a job has to do, and findings about its assets; see `run_job` for errors.

    With an `executor`, assets that nobody has looked at are first opened by its workers.
    """
    prepared = prepare(job, memory, executor)
    lines, strays = dialogue_of(job)
    plan = Plan(job, lines, prepared.targets)
    require_distinct_curve_files(plan)
    require_free_outputs(plan)
    return plan, [*prepared.findings, *strays, *missing_voices(job)]


def _write_reports(report: RunReport, output: Path) -> RunReport:
    """Write the reports; one that cannot be written is itself reported."""
    for name in registry.plugins(registry.REPORTS):
        try:
            registry.find(registry.REPORTS, name).load()(report, output)
        except InputError as error:
            report = replace(report, findings=(*report.findings, Finding.from_error(error)))
    return report


def _changed_sources(digests: dict[Path, str | None], memory: Memory) -> Iterator[Finding]:
    for path, digest in digests.items():
        if memory.digests.of(path) != digest:
            yield Finding(
                Severity.ERROR,
                "source-changed",
                "changed while the run was reading it",
                place=str(path),
                action="Run again when nobody writes to the asset.",
            )


@contextmanager
def _log(plan: Plan, findings: Sequence[Finding]) -> Iterator[Ledger]:
    """A ledger that writes to ``run.jsonl``."""
    path = plan.job.output / "run.jsonl"
    for name in REPORT_NAMES:  # better now than after the work
        if (plan.job.output / name).is_dir():
            raise unwritable(plan.job.output / name, IsADirectoryError("a folder has its name"))
    try:
        log = path.open("w", encoding="utf-8", newline="\n")
    except OSError as error:
        raise unwritable(path, error) from error
    with log:
        yield Ledger(plan, log, general=list(findings))
