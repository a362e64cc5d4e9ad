"""Running job files, and saying what a run would do; import the functions from `animeme`."""

from __future__ import annotations

import gc
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Literal

from animeme.executors import choice
from animeme.files import scratch_beside
from animeme.findings import RunReport, Severity
from animeme.job import Job, read_job
from animeme.runner import run_job, run_shard
from animeme.selection import EVERYTHING, Selection
from animeme.shards import Shard
from animeme.store.memory import Memory, default_store, memory
from animeme.work import Listener

if TYPE_CHECKING:
    from animeme.rehearsal import Rehearsal


def run(
    job: str | Path,
    *,
    output: str | Path | None = None,
    executor: choice.Kind = "inline",
    workers: int | None = None,
    scheduler: str | None = None,
    fail_on: str = "error",
    speak: bool = False,
    cache: str | Path | Literal[False] | None = None,
    rehash: bool = False,
    shard: str | None = None,
    listener: Listener = lambda _: None,
    selection: Selection = EVERYTHING,
) -> RunReport:
    """Run a job file: characters and dialogue in, animated assets out.

    Args:
        job: the TOML file.
        output: output folder in place of the job's.
        executor: "inline" in this process, "local" in supervised processes of its own, "dask" on a
            Dask cluster (the calling script then needs an ``if __name__ == "__main__":`` guard).
        workers: how many processes, all processors if None.
        scheduler: address of the cluster's scheduler; None starts a cluster of this machine's own.
        fail_on: severity at which `RunReport.exit_code` turns 1.
        speak: speak transcripts that have no recording, as the job's ``[dialogue] speak`` does.
        cache: folder of results that runs share, in place of the job's or the user's; False keeps
            none, and does everything anew.
        rehash: read every file, whether or not it looks as it did.
        shard: "I/N" does the I-th of N parts of the lines, for the store alone; a run without it,
            with the same store, then writes the files.
        listener: told of progress.
        selection: the lines that are wanted, see `animeme.Selection`. Files that hold one of them
            are written, with all their lines; lines that nobody asked for are as they were
            delivered last. All other files stay as they are.

    Returns:
        The report that is also written to the output folder.

    Raises:
        JobError: the job cannot be run; all reasons at once.
        PluginError: a plug-in that it needs cannot be loaded.
        InputError: the output folder cannot be written, or the selection fits no line.
        ValueError: an argument is none of those that are listed.

    Example:
        >>> import animeme, tempfile
        >>> report = animeme.run("sample_assets/job.toml", output=tempfile.mkdtemp())
        >>> report.exit_code, report.count("ok", character="ada", language="en")
        (0, 6)
    """
    choice.require(executor, workers, scheduler)
    folder = Path(output) if output is not None else None
    severity = Severity.parse(fail_on)
    part = Shard.parse(shard) if shard is not None else None
    if part is not None and cache is False:
        raise ValueError("a shard leaves what it does in a store, so it needs one")
    if part is not None and executor == "dask":
        raise ValueError("a shard is for farms without Dask, which shares out all lines itself")
    form = read_job(Path(job), output=folder, check=False)
    if speak:
        form = replace(form, speak=True)

    begin = run_job if part is None else partial(run_shard, shard=part)
    with (
        _uncollected(executor),
        memory(store_of(form, cache), rehash=rehash) as remembered,
        choice.opened(
            executor,
            workers,
            scheduler,
            sees=_inputs(form),
            marks=_marks(form, remembered) if executor == "dask" else (),
            code=partial(_code, remembered),
        ) as chosen,
    ):
        return begin(
            form, chosen, remembered, fail_on=severity, listener=listener, selection=selection
        )


@contextmanager
def _uncollected(executor: choice.Kind) -> Iterator[None]:
    """No search for cycles meanwhile: the engine makes none, and it takes half of a re-run's time.

    What plug-ins make is in other processes; with the inline executor all stays as it is.
    """
    was = gc.isenabled() and executor != "inline"
    if was:
        gc.disable()
    try:
        yield
    finally:
        if was:
            gc.enable()


def _marks(job: Job, remembered: Memory) -> list[Path]:
    """Files to put where every machine must see them."""
    kept = remembered.store.scratch()
    kept.parent.mkdir(parents=True, exist_ok=True)
    return [scratch_beside(job.output / "mark"), kept]


def _code(remembered: Memory) -> str:
    """Digest of the code that every machine must have."""
    from animeme.executors.crew import code_of  # brings asyncio, which only a cluster needs

    return code_of(remembered.code)


def _inputs(job: Job) -> list[Path]:
    """Where a job's inputs are, as far as there is anything."""
    places = [job.source, *job.dialogue.files, *(a for c in job.characters for a in c.assets)]
    places += [path for path in (job.dialogue.root, job.lexicon, job.voices) if path is not None]
    return [path for path in places if path.exists()]


def rehearse(
    job: str | Path,
    *,
    output: str | Path | None = None,
    speak: bool = False,
    cache: str | Path | Literal[False] | None = None,
    rehash: bool = False,
    selection: Selection = EVERYTHING,
) -> Rehearsal:
    """Say what `run` would do with these arguments, and why; nothing is written.

    Raises:
        JobError, PluginError, InputError: as of `run`.
    """
    form = read_job(Path(job), output=Path(output) if output is not None else None, check=False)
    if speak:
        form = replace(form, speak=True)
    from animeme import rehearsal  # a run needs none

    folder = store_of(form, cache)
    with memory(folder, rehash=rehash, dry=folder is not None) as remembered:
        return rehearsal.rehearse(form, remembered, selection)


def store_of(job: Job, cache: str | Path | Literal[False] | None = None) -> Path | None:
    """The folder of a job's store, as `run` takes it; None for none."""
    if cache is False:
        return None
    return Path(cache) if cache is not None else job.cache or default_store()
