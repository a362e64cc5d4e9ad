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
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from animeme import executors
from animeme.executors import Result, child, local, processes, resolve
from animeme.executors.local import LocalExecutor
from animeme.executors.processes import Processes

if TYPE_CHECKING:
    from distributed import Worker

    from animeme.store.code import CodeDigests

# A mark that the driver has just made may take so long to appear on a network file system.
SEEN_WITHIN_S = 5.0
# How often a chunk sends its results, and asks whether anybody still waits for them.
TOGETHER_S = 0.5
CODE_TIMEOUT_S = 300.0
# What a run calls, besides plug-ins.
_ENGINE = ("animeme.animating", "animeme.writing", "animeme.preflight")
_PARTS = [
    Path(__file__),
    *(Path(str(part.__file__)) for part in (executors, child, local, processes)),
]
_OWN = hashlib.sha256(b"".join(path.read_bytes() for path in _PARTS)).hexdigest()


@dataclass(frozen=True)
class Terms:
    """What a worker needs for a run.

    Attributes:
        run: names the run; its processes are its own.
        code: digest of all code that makes results.
        folder: the driver's working folder, which relative paths start from.
        marks: (path, SHA-256 of the file, or "" where it only has to be there).
        own: digest of this module and those that it rests on, as the driver has them.
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


_PROCESSES = Processes()


async def fit(terms: Terms) -> Misfit | None:
    """See whether this worker can take part, and start a process for it."""

    def look() -> Misfit | None:
        with _PROCESSES.one(terms.run) as pool:
            return _misfit(terms, pool)

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

    with _PROCESSES.one(run) as pool:
        found = _Found(pool, tell)
        with _watched(worker, run, found):
            misfit = _misfit(chunk.terms, pool)
            if misfit is not None:
                tell(misfit=pickle.dumps(misfit), chunk=worker.get_current_task())
                return
            name = f"{__name__}:{do.__qualname__}"
            given = [(chunk.terms.folder, chunk.function, item) for _, item in chunk.items]
            for result in pool.run(name, given, timeout_s=chunk.timeout_s, retries=chunk.retries):
                index = chunk.items[result.index][0]
                found.add(replace(result, index=index, host=socket.gethostname()))
            found.send()


class _Found:
    """Results of a chunk, which are sent some at a time, from whichever thread."""

    def __init__(self, pool: LocalExecutor, tell: Callable[..., None]) -> None:
        self.pool = pool
        self._tell = tell
        self._lock = threading.Lock()
        self._results: list[Result] = []
        self._cpu_s = self._told_s = self._used_s()

    def add(self, result: Result) -> None:
        """Take in a result; for the thread that does the chunk, whose CPU time counts."""
        with self._lock:
            self._results.append(result)
            self._cpu_s = self._used_s()

    def send(self) -> None:
        """Tell what has not been told; it is on its way before this ends."""
        with self._lock:
            if self._results:
                spent_s = max(self._cpu_s - self._told_s, 0.0)
                self._tell(results=pickle.dumps(self._results), cpu_s=spent_s)
                self._results, self._told_s = [], self._cpu_s

    def _used_s(self) -> float:
        return self.pool.cpu_s + time.thread_time()


@contextmanager
def _watched(worker: Worker, run: str, found: _Found) -> Iterator[None]:
    """Send what is found, and stop when nobody waits for it: the driver or scheduler is gone."""
    key = worker.get_current_task()
    over = threading.Event()

    def watch() -> None:
        while not over.wait(TOGETHER_S):
            task = worker.state.tasks.get(key)
            wanted = task is not None and task.state == "executing"
            if not wanted or worker.status.name not in ("running", "paused", "closing_gracefully"):
                found.pool.stop()
                return
            found.send()

    watcher = threading.Thread(target=watch, daemon=True)
    watcher.start()
    try:
        if _PROCESSES.is_stopped(run):
            found.pool.stop()
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


def _misfit(terms: Terms, pool: LocalExecutor) -> Misfit | None:
    """Why this worker cannot do the run, None if it can; each thing is looked at once."""
    for seen, look in ((terms.marks, _misplaced), (terms.code, _strange)):
        if (terms.run, seen) in _PROCESSES.fit:
            continue
        found = look(terms, pool)
        if found is not None:
            return found
        _PROCESSES.fit.add((terms.run, seen))
    return None


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
