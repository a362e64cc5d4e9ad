"""What runs in the workers of a Dask cluster: chunks of tasks, each by a supervised process.

A thread of a worker does one chunk at a time, in a process of its own, so that a crash or a hang is
blamed on its task as the local pool blames it. Items and results pass through the worker as bytes:
it loads none of the code that they are about, which may change between two runs.
"""

from __future__ import annotations

import asyncio
import hashlib
import multiprocessing
import os
import pickle
import socket
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from animeme.executors import Result, resolve
from animeme.executors.local import LocalExecutor

if TYPE_CHECKING:
    from distributed import Worker

    from animeme.store.code import CodeDigests

# A mark that the driver has just made may take so long to appear on a network file system.
SEEN_WITHIN_S = 5.0
# Results travel together that come within this time.
TOGETHER_S = 0.5
# How often a chunk asks whether anybody still waits for it.
ASK_EVERY_S = 0.25
# Processes of a run whose driver is silent for so long have ended by themselves.
IDLE_S = 15.0
CODE_TIMEOUT_S = 300.0
# What a run calls, besides plug-ins.
_ENGINE = ("animeme.animating", "animeme.writing", "animeme.preflight")
_OWN = hashlib.sha256(Path(__file__).read_bytes()).hexdigest()


@dataclass(frozen=True)
class Terms:
    """What a worker needs for a run.

    Attributes:
        run: names the run; its processes are its own.
        code: digest of all code that makes results.
        folder: the driver's working folder, which relative paths start from.
        marks: (path, SHA-256 of the file, or "" where it only has to be there).
        own: digest of this module, as the driver has it.
    """

    run: str
    code: str
    folder: str
    marks: tuple[tuple[str, str], ...]
    own: str = _OWN


@dataclass(frozen=True)
class Misfit:
    """Why a worker cannot take part: code of the error, what is wrong, what to do."""

    code: str
    problem: str
    action: str


@dataclass(frozen=True)
class Chunk:
    """Some tasks of a run.

    Attributes:
        terms: of the run.
        topic: under which results are told.
        turn: counts the driver's calls of `run`.
        function: importable name.
        items: (index, pickled argument).
        timeout_s, retries: as of `animeme.executors.Executor.run`.
    """

    terms: Terms
    topic: str
    turn: str
    function: str
    items: tuple[tuple[int, bytes], ...]
    timeout_s: float
    retries: int


class _Processes:
    """Supervised processes, each for one thread of the worker, kept from chunk to chunk."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._idle: list[tuple[str, LocalExecutor, float]] = []
        self._busy: list[tuple[str, LocalExecutor]] = []
        self._stopped: set[str] = set()
        self._fit: set[tuple[str, object]] = set()
        self._reaping = False

    @contextmanager
    def one(self, run: str) -> Iterator[LocalExecutor]:
        """A process of a run, for the time being."""
        with self._lock:
            own = next((entry for entry in self._idle if entry[0] == run), None)
            if own is not None:
                self._idle.remove(own)
            pool = own[1] if own else LocalExecutor(1, keeps=True)
            self._busy.append((run, pool))
        try:
            yield pool
        finally:
            with self._lock:
                self._busy.remove((run, pool))
                if not pool.stopped:
                    self._idle.append((run, pool, time.monotonic()))
                start, self._reaping = not self._reaping, True
            if pool.stopped:
                pool.close()
            if start:
                threading.Thread(target=self._reap, daemon=True).start()

    def _reap(self) -> None:
        """End processes as they have been at rest for long; over when none is at rest."""
        wait_s = IDLE_S
        while wait_s:
            time.sleep(wait_s)
            self.end_idle()
            with self._lock:
                self._reaping = bool(self._idle)
                due = min((since for *_, since in self._idle), default=0.0) + IDLE_S
                wait_s = max(due - time.monotonic(), 0.1) if self._reaping else 0.0

    def end_idle(self, run: str | None = None) -> None:
        """End processes that have nothing to do: those of a run, or those long at rest."""
        now = time.monotonic()
        with self._lock:
            ended = [e for e in self._idle if e[0] == run or now - e[2] >= IDLE_S]
            self._idle = [entry for entry in self._idle if entry not in ended]
            self._fit -= {known for known in self._fit if known[0] == run}
        for _, pool, _ in ended:
            pool.close()

    def stop(self, run: str) -> None:
        """Let nothing more be done for a run."""
        self._stopped.add(run)
        with self._lock:
            busy = [pool for own, pool in self._busy if own == run]
        for pool in busy:
            pool.stop()

    def works_for(self, run: str) -> bool:
        """Whether a chunk of the run is being done."""
        with self._lock:
            return any(own == run for own, _ in self._busy)

    def is_stopped(self, run: str) -> bool:
        """Whether `stop` was called for the run."""
        return run in self._stopped

    def misfit(self, terms: Terms, pool: LocalExecutor) -> Misfit | None:
        """Why this worker cannot do the run, None if it can; each thing is looked at once."""
        for seen, look in ((terms.marks, _misplaced), (terms.code, _strange)):
            if (terms.run, seen) in self._fit:
                continue
            found = look(terms, pool)
            if found is not None:
                return found
            self._fit.add((terms.run, seen))
        return None


_PROCESSES = _Processes()


async def fit(terms: Terms) -> Misfit | None:
    """See whether this worker can take part, and start a process for it."""

    def look() -> Misfit | None:
        with _PROCESSES.one(terms.run) as pool:
            return _PROCESSES.misfit(terms, pool)

    return await asyncio.to_thread(look)


async def dismiss(run: str) -> None:
    """Stop what is done for a run and end its processes."""
    await asyncio.to_thread(_PROCESSES.stop, run)
    while _PROCESSES.works_for(run):
        await asyncio.sleep(0.02)
    await asyncio.to_thread(_PROCESSES.end_idle, run)


def work(chunk: Chunk) -> None:
    """Do a chunk; results are told to the driver while it lasts."""
    from distributed import get_worker

    worker = get_worker()
    run = chunk.terms.run

    def tell(**message: Any) -> None:
        told = {"turn": chunk.turn, "worker": worker.address, **message}
        worker.log_event(chunk.topic, told)

    with _PROCESSES.one(run) as pool, _watched(worker, run, pool):
        found = _PROCESSES.misfit(chunk.terms, pool)
        if found is not None:
            tell(misfit=pickle.dumps(found), chunk=worker.get_current_task())
            return
        for results, cpu_s in _together(chunk, pool):
            tell(results=pickle.dumps(results), cpu_s=cpu_s)


def _together(chunk: Chunk, pool: LocalExecutor) -> Iterator[tuple[list[Result], float]]:
    """Results of a chunk, some at a time, and the CPU time that they took here."""
    given = [(chunk.terms.folder, chunk.function, item) for _, item in chunk.items]
    collected: list[Result] = []
    told, before = time.monotonic(), pool.cpu_s + time.thread_time()
    name = f"{__name__}:{do.__qualname__}"
    for result in pool.run(name, given, timeout_s=chunk.timeout_s, retries=chunk.retries):
        index = chunk.items[result.index][0]
        collected.append(replace(result, index=index, host=socket.gethostname()))
        if time.monotonic() - told < TOGETHER_S and len(collected) < len(chunk.items):
            continue
        now = pool.cpu_s + time.thread_time()
        yield collected, max(now - before, 0.0)
        collected, told, before = [], time.monotonic(), now
    if collected:
        yield collected, max(pool.cpu_s + time.thread_time() - before, 0.0)


@contextmanager
def _watched(worker: Worker, run: str, pool: LocalExecutor) -> Iterator[None]:
    """Stop the pool when nobody waits any more: the driver or the scheduler is gone."""
    key = worker.get_current_task()
    over = threading.Event()

    def watch() -> None:
        while not over.wait(ASK_EVERY_S):
            task = worker.state.tasks.get(key)
            wanted = task is not None and task.state == "executing"
            if not wanted or worker.status.name not in ("running", "paused", "closing_gracefully"):
                pool.stop()
                return

    watcher = threading.Thread(target=watch, daemon=True)
    watcher.start()
    try:
        if _PROCESSES.is_stopped(run):
            pool.stop()
        yield
    finally:
        over.set()
        watcher.join()


def do(task: tuple[str, str, bytes]) -> bytes:
    """Run one task in the supervised process; its value, pickled."""
    folder, function, item = task
    if os.getcwd() != folder:
        os.chdir(folder)
    return pickle.dumps(resolve(function)(pickle.loads(item)))  # from the run's own driver


def _misplaced(terms: Terms, _: LocalExecutor) -> Misfit | None:
    """Why the worker's process, or the place where it runs, will not do."""
    if terms.own != _OWN:
        return Misfit(
            "worker-code",
            "it was started with another version of animeme",
            "Install the same version on every machine, and start its worker again.",
        )
    if multiprocessing.current_process().daemon:
        return Misfit(
            "worker-daemon",
            "it must not start processes",
            "Start it with DASK_DISTRIBUTED__WORKER__DAEMON=False in its environment, "
            "or with --no-nanny.",
        )
    unseen = _unseen(terms)
    if not unseen:
        return None
    return Misfit(
        "worker-blind",
        f"it does not see {unseen}, or sees something else there",
        "Put the job, its output and its store (--cache) on a file system that all machines "
        "mount at the same place.",
    )


def _strange(terms: Terms, pool: LocalExecutor) -> Misfit | None:
    """Why results of the code that is installed here are not those of the driver's."""
    name = f"{__name__}:{code_digest.__qualname__}"
    for result in pool.run(name, [terms.folder], timeout_s=CODE_TIMEOUT_S, retries=1):
        if result.value != terms.code:
            why = f" ({result.error.strip().splitlines()[-1]})" if result.error else ""
            return Misfit(
                "worker-code",
                f"its animeme, plug-ins or libraries are not those of this machine{why}",
                "Install the same versions on every machine; `animeme doctor` lists them.",
            )
    return None


def _unseen(terms: Terms) -> str:
    """The first path that a worker should see and does not, "" if there is none."""
    until = time.monotonic() + SEEN_WITHIN_S
    for path, digest in ((terms.folder, ""), *terms.marks):
        while not _sees(path, digest):
            if time.monotonic() > until:
                return path
            time.sleep(0.1)
    return ""


def _sees(path: str, digest: str) -> bool:
    with suppress(OSError):
        if digest:
            os.scandir(os.path.dirname(path)).close()  # a share asks its server again
            return hashlib.sha256(Path(path).read_bytes()).hexdigest() == digest
        os.stat(path)
        return True
    return False


def code_digest(folder: str = "") -> str:
    """Digest of animeme, of all plug-ins and of the libraries that they use, as installed here."""
    from animeme.store.code import CodeDigests
    from animeme.store.digests import Digests
    from animeme.store.index import Index, index_path, user_cache

    if folder and os.getcwd() != folder:
        os.chdir(folder)  # where modules may be as well
    # What modules import is remembered on each machine.
    with Index(index_path(user_cache() / "code")) as index:
        return code_of(CodeDigests(index, Digests(index)))


def code_of(digests: CodeDigests) -> str:
    """As `code_digest`, with digests that are there already."""
    from animeme import registry

    plugins = [p for group in registry.GROUPS for p in registry.plugins(group).values()]
    return digests.of(plugins, *_ENGINE)
