"""A run from a validated job to its report."""

from __future__ import annotations

import resource
import shutil
import tempfile
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from animeme import registry
from animeme.errors import InputError
from animeme.executors import Executor
from animeme.files import sha256, unwritable
from animeme.findings import Finding, RunReport, Severity
from animeme.job import Job
from animeme.ledger import Ledger
from animeme.plan import REPORT_NAMES, Plan
from animeme.preflight import (
    dialogue_of,
    load_plugins,
    load_targets,
    missing_voices,
    require_distinct_companions,
    require_distinct_curve_files,
    require_free_outputs,
    stale_outputs,
)
from animeme.tasks import RunContext, join_languages, make_line, save_context, write_asset

# A line of minutes takes seconds; a task beyond these is hung.
LINE_TIMEOUT_S = 600.0
ASSET_TIMEOUT_S = 1800.0
RETRIES = 1


@dataclass(frozen=True)
class Progress:
    """What a listener is told each time something ends.

    Attributes:
        stage: "lines" or "assets".
        done, total: lines, or files while assets are written.
        failed: how many lines have failed so far.
    """

    stage: str
    done: int
    total: int
    failed: int


Listener = Callable[[Progress], None]


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
        JobError: nothing could be started: no lines, no asset that could be driven, or an output
            that would overwrite an input.
        PluginError: a plug-in that the job needs cannot be loaded.
        InputError: the output folder cannot be written.
    """
    wall, cpu = time.perf_counter(), cpu_s(executor)
    load_plugins(job)
    lines, strays = dialogue_of(job)
    targets, findings = load_targets(job)
    findings += strays
    plan = Plan(job, lines, tuple(targets))
    require_distinct_companions(plan)
    require_distinct_curve_files(plan)
    require_free_outputs(plan)
    digests = {target.asset.source: sha256(target.asset.source) for target in targets}
    findings += missing_voices(job)
    with _output_folder(job.output) as spool, _log(plan, findings) as ledger:
        ledger.record("start", job=job.name, lines=len(lines), targets=len(targets))
        _save_context(plan, spool)
        _do_lines(ledger, executor, listener, spool)
        _do_assets(ledger, executor, listener, spool)
        _join_languages(ledger, executor, spool)
        ledger.general += [*_changed_sources(digests), *stale_outputs(plan, ledger.fresh())]
        report = ledger.report(fail_on)
        report = replace(report, wall_s=time.perf_counter() - wall, cpu_s=cpu_s(executor) - cpu)
        report = _write_reports(report, job.output)
        ledger.record("end", exit_code=report.exit_code, wall_s=report.wall_s, cpu_s=report.cpu_s)
    return report


def _write_reports(report: RunReport, output: Path) -> RunReport:
    """Write the reports; one that cannot be written is itself reported."""
    for name in registry.plugins(registry.REPORTS):
        try:
            registry.find(registry.REPORTS, name).load()(report, output)
        except InputError as error:
            report = replace(report, findings=(*report.findings, Finding.from_error(error)))
    return report


def _save_context(plan: Plan, spool: Path) -> None:
    job = plan.job
    context = RunContext(
        plan.targets,
        job.aligner,
        job.lexicon,
        job.voices,
        job.model,
        job.model_file,
        job.curves,
        job.output,
        job.speak,
    )
    save_context(context, spool)


def _do_lines(ledger: Ledger, executor: Executor, listener: Listener, spool: Path) -> None:
    items = ledger.plan.line_items(spool)
    results = executor.run(name_of(make_line), items, timeout_s=LINE_TIMEOUT_S, retries=RETRIES)
    for done, result in enumerate(results, 1):
        ledger.end_line(items[result.index], result)
        listener(Progress("lines", done, len(items), ledger.failed))


def _do_assets(ledger: Ledger, executor: Executor, listener: Listener, spool: Path) -> None:
    items = ledger.plan.asset_items(ledger.good, spool)
    results = executor.run(name_of(write_asset), items, timeout_s=ASSET_TIMEOUT_S, retries=RETRIES)
    for done, result in enumerate(results, 1):
        ledger.end_asset(items[result.index], result)
        listener(Progress("assets", done, len(items), ledger.failed))


def _join_languages(ledger: Ledger, executor: Executor, spool: Path) -> None:
    """Give each format the chance to join its languages in one file."""
    items = ledger.plan.assembly_items(ledger.written, spool)
    results = executor.run(
        name_of(join_languages), items, timeout_s=ASSET_TIMEOUT_S, retries=RETRIES
    )
    for result in results:
        ledger.end_assembly(items[result.index], result)


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


def name_of(function: Callable[..., Any]) -> str:
    """The importable name by which executors call a function."""
    return f"{function.__module__}:{function.__qualname__}"


def cpu_s(executor: Executor) -> float:
    """CPU time of this process, of its ended children and of the executor's living ones."""
    usages = [resource.getrusage(who) for who in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN)]
    return sum(usage.ru_utime + usage.ru_stime for usage in usages) + executor.cpu_s


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
