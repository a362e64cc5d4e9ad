"""A supervised pool of local processes.

Each child has a pipe of its own, and answers each task before it begins the next, so that a death
or a hang is blamed on the task that caused it, and costs that task only. Children end with their
parent: their pipe closes.
"""

from __future__ import annotations

import multiprocessing
import os
import pickle
import select
import signal
import struct
import sys
import threading
import time
import traceback
from collections import deque
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace
from itertools import islice
from multiprocessing import resource_tracker
from multiprocessing.connection import Connection, wait
from multiprocessing.process import BaseProcess
from types import ModuleType
from typing import Any, Self

from animeme.executors import LATER, Outcome, Result, call

# A task is small; threads of numerical libraries would only fight over the cores.
_SINGLE_THREADED = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS")
# How far ahead of the work tasks are drawn, and how many before children are looked after.
_MOST_WAITING = 10_000
_DRAWN_AT_ONCE = 50
# A child is given tasks for about so long at once, and so many at most; meanwhile the driver rests.
_TOGETHER_S = 0.05
_MOST_TOGETHER = 16
_MOST_REST_S = 0.01
# A long task is remembered for some short ones.
_FADING = 0.9
# What a child's result begins with: its CPU seconds so far.
_CPU = struct.Struct("d")
# What a child takes to start, about, and how many waiting tasks are worth that at any rate.
_START_S = 0.4
# How long few tasks wait for the first result: it comes after the start of the child that gives it.
_FIRST_S = 1.6
_MANY = 20
# What children inherit is the whole process's, and a Dask worker starts them in several threads.
_ENVIRONMENT = threading.Lock()


def default_workers() -> int:
    """How many processors this process may use."""
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


@dataclass(frozen=True)
class _Task:
    index: int
    item: Any
    attempt: int = 1


class _Tasks:
    """What has to be done: drawn from where it comes from while children work.

    Args:
        items: of the tasks; what takes its time to give one does so beside the children.
    """

    def __init__(self, items: Iterable[Any]) -> None:
        self._left = iter(items)
        self._count = 0
        self.waiting: deque[_Task] = deque()
        self.open = True

    def draw(self, most: int) -> None:
        """Have up to `most` more of them waiting: as many as there are without a `LATER`."""
        for item in islice(self._left, most):
            if item is LATER:
                return
            self.waiting.append(_Task(self._count, item))
            self._count += 1
            most -= 1
        self.open = most == 0


class _Child:
    """One process, the pipe to it, and what it is doing."""

    def __init__(self, context: Any) -> None:
        self.pipe, theirs = context.Pipe()
        self.process: BaseProcess = context.Process(target=_serve, args=(theirs,), daemon=True)
        self.process.start()
        theirs.close()
        self.handles = self.pipe.fileno(), self.process.sentinel
        self.tasks: deque[_Task] = deque()
        self.started = 0.0
        self.cpu_s = 0.0
        self.warm = False  # it has loaded what it needs: its tasks take their own time

    def give(self, function: str, tasks: list[_Task]) -> None:
        """Have it do these; it has done what it was given before."""
        # Each by itself: what cannot be loaded is nobody's fault but its own.
        rows = [(task.index, pickle.dumps(task.item), task.attempt) for task in tasks]
        self.pipe.send((function, rows))
        self.tasks, self.started = deque(tasks), time.monotonic()

    def end(self) -> None:
        self.pipe.close()
        self.process.join(timeout=5)
        if self.process.is_alive():
            self.process.kill()
            self.process.join()

    def kill(self) -> None:
        self.process.kill()
        self.process.join()
        self.pipe.close()


class LocalExecutor:
    """Runs tasks in `workers` spawned processes.

    Used as a context manager it keeps its processes, and what they have loaded, from one run to the
    next. Its processes do not import the caller's script, as those of multiprocessing do: tasks
    name what they need.

    Args:
        workers: how many.
        keeps: as if it had been entered as a context manager; `close` ends it.
    """

    def __init__(self, workers: int, *, keeps: bool = False) -> None:
        self.workers = workers
        self._children: list[_Child] = []
        self._keeps = keeps
        self._stopped = threading.Event()

    def __enter__(self) -> Self:
        self._keeps = True
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def release(self) -> None:
        """Let the processes that it keeps end; `close` waits for that."""
        for child in self._children:
            child.pipe.close()

    def close(self) -> None:
        """End the processes that it keeps."""
        self._keeps = False
        self._end()

    @property
    def stopped(self) -> bool:
        """Whether `stop` was called."""
        return self._stopped.is_set()

    def stop(self) -> None:
        """End it from another thread: `run` gives no more results."""
        self._stopped.set()
        for child in [*self._children]:
            child.process.kill()

    @property
    def cpu_s(self) -> float:
        """CPU time of the processes that it keeps; the system counts the others' as children's."""
        return sum(child.cpu_s for child in self._children)

    def run(
        self, function: str, items: Iterable[Any], *, timeout_s: float, retries: int
    ) -> Iterator[Result]:
        """Yield results as they come; see `animeme.executors.Executor`."""
        try:
            yield from self._results(function, _Tasks(items), timeout_s, retries)
        except BaseException:
            for child in self._children:
                child.kill()
            self._children.clear()
            raise
        finally:
            if not self._keeps:
                self._end()

    def _results(
        self, function: str, tasks: _Tasks, timeout_s: float, retries: int
    ) -> Iterator[Result]:
        children, waiting = self._children, tasks.waiting
        came, pace_s = time.monotonic(), 0.0
        for child in children:
            child.warm = False
        while not self._stopped.is_set():
            busy = sum(bool(child.tasks) for child in children)
            if tasks.open and not waiting and busy < self.workers:
                tasks.draw(1)  # the first child starts while the next is looked for
            if not waiting and not busy:
                if tasks.open:
                    continue
                return
            more = min(self.workers, busy + len(waiting)) - len(children)
            if more > 0 and (not children or self._worth(tasks, came, pace_s)):
                self._start(more if children or len(waiting) >= _MANY else 1)
            if self._stopped.is_set():
                return  # `stop` may have come too early to see the newest child
            for child in [child for child in children if not child.tasks]:
                share = _share(len(waiting), len(children), pace_s)
                if share and not _hand_over(child, function, waiting, share):
                    children.remove(child)
            ahead = tasks.open and len(waiting) < _MOST_WAITING
            if not ahead:
                _rest(children, pace_s)
            most_s = 0.0 if ahead else _START_S if waiting and more > 0 else timeout_s
            ready = _ready(children, timeout_s, most_s)
            if ahead and not ready:
                tasks.draw(_DRAWN_AT_ONCE)
            for child in ready:
                for task, result in _collected(child, timeout_s):
                    came = time.monotonic()
                    pace_s = max(result.wall_s, _FADING * pace_s) if child.warm else pace_s
                    child.warm = True
                    if self._stopped.is_set():
                        return  # what it ended with is nobody's fault
                    if result.outcome in ("crash", "timeout"):
                        children.remove(child)
                        waiting.extendleft(reversed(child.tasks))
                        if result.attempt <= retries:
                            waiting.append(replace(task, attempt=task.attempt + 1))
                            continue
                    yield result

    def _worth(self, tasks: _Tasks, came: float, pace_s: float) -> bool:
        """Whether those that are there would be at the waiting tasks longer than more of them take
        to start.

        Args:
            tasks: what waits, and whether more is to come.
            came: when the last result did.
            pace_s: what that took, 0 if not known yet.
        """
        there, many, processors = len(self._children), len(tasks.waiting), default_workers()
        if many >= _MANY or processors > there + many:
            return True
        if tasks.open and there + 1 >= processors:  # looking for tasks needs one as well
            return False
        patience_s = _START_S if pace_s else _FIRST_S
        return time.monotonic() - came >= patience_s or many * pace_s > there * _START_S

    def _start(self, more: int) -> None:
        with _ENVIRONMENT, _single_threaded(), _scriptless(), uninterrupted():
            context = multiprocessing.get_context("spawn")
            for _ in range(more):
                self._children.append(_Child(context))

    def _end(self) -> None:
        self.release()
        for child in self._children:
            child.end()
        self._children.clear()


@contextmanager
def uninterrupted() -> Iterator[None]:
    """Start processes and threads that Ctrl-C does not reach; this one hears of it afterwards."""
    resource_tracker.ensure_running()  # where it is started, it lets the signal through again
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    heard: list[int] = []
    # The system may give the signal to another thread, but it is the main one that it interrupts.
    handler = signal.getsignal(signal.SIGINT) if _is_main() else None
    if handler is not None:
        signal.signal(signal.SIGINT, lambda number, _: heard.append(number))
    try:
        yield
    finally:
        if handler is not None:
            signal.signal(signal.SIGINT, handler)
        signal.pthread_sigmask(signal.SIG_SETMASK, before)
        if heard:
            signal.raise_signal(signal.SIGINT)


def _is_main() -> bool:
    return threading.current_thread() is threading.main_thread()


@contextmanager
def _single_threaded() -> Iterator[None]:
    """Let processes that are started now use one thread each."""
    inherited = {name: os.environ.get(name) for name in _SINGLE_THREADED}
    os.environ.update(dict.fromkeys(_SINGLE_THREADED, "1"))
    try:
        yield
    finally:
        for name, value in inherited.items():
            if value is None:
                os.environ.pop(name, None)
            else:
                os.environ[name] = value


@contextmanager
def _scriptless() -> Iterator[None]:
    """Let processes that are started now leave the caller's script alone, which takes its time."""
    script = sys.modules["__main__"]
    sys.modules["__main__"] = ModuleType("__main__")
    try:
        yield
    finally:
        sys.modules["__main__"] = script


def _share(waiting: int, children: int, pace_s: float) -> int:
    """How many of the waiting tasks a child is given at once; long ones one by one."""
    many = int(_TOGETHER_S / pace_s) if pace_s else 1
    return min(waiting, max(1, min(many, _MOST_TOGETHER, waiting // (2 * children))))


def _rest(children: list[_Child], pace_s: float) -> None:
    """Leave the processor to children that have more than one task: several results are taken in
    at once for less.
    """
    left = min((len(child.tasks) for child in children if child.tasks), default=1) - 1
    if left > 0:
        time.sleep(min(left * pace_s / 2, _MOST_REST_S))


def _hand_over(child: _Child, function: str, waiting: deque[_Task], share: int) -> bool:
    """Give the child the next tasks; False if it has died while it was idle, nobody's fault."""
    try:
        child.give(function, [*islice(waiting, share)])
    except OSError:
        child.kill()
        return False
    for _ in range(share):
        waiting.popleft()
    return True


def _ready(children: list[_Child], timeout_s: float, most_s: float) -> list[_Child]:
    """Children that answered, died, or ran out of time; waits `most_s` for the first."""
    now = time.monotonic()
    busy = [child for child in children if child.tasks]
    patience = min((child.started + timeout_s - now for child in busy), default=0.0)
    handles = [handle for child in busy for handle in child.handles]
    woken = _readable(handles, max(min(patience, most_s), 0.0))
    now = time.monotonic()
    return [
        child
        for child in busy
        if not woken.isdisjoint(child.handles) or now >= child.started + timeout_s
    ]


def _readable(handles: Iterable[int], most_s: float) -> set[int]:
    """Those that can be read or have ended; waits `most_s` for the first.

    What multiprocessing has for it takes longer than many a task.
    """
    poll = select.poll()
    for handle in handles:
        poll.register(handle, select.POLLIN)
    return {handle for handle, _ in poll.poll(1000 * most_s)}


def _collected(child: _Child, timeout_s: float) -> Iterator[tuple[_Task, Result]]:
    """The tasks of a child that is ready that have ended, and their results; it is dead afterwards
    if one ended with it.
    """
    answers = True
    while answers:
        result = _collect(child, timeout_s)
        task = child.tasks.popleft()
        child.started = time.monotonic()
        lives = result.outcome in ("ok", "error")
        answers = lives and bool(child.tasks) and bool(_readable([child.pipe.fileno()], 0.0))
        yield task, result


def _collect(child: _Child, timeout_s: float) -> Result:
    """The result of the task that a child is at; it is dead afterwards unless it answered."""
    task = child.tasks[0]
    try:
        if _readable([child.pipe.fileno()], 0.0):
            data = child.pipe.recv_bytes()
            (child.cpu_s,) = _CPU.unpack_from(data)
            return _unpacked(data[_CPU.size :], task)
    except (EOFError, OSError):
        pass
    wall_s = time.monotonic() - child.started
    if child.process.is_alive() and wall_s < timeout_s:
        # Its pipe closed just before its end.
        child.process.join(timeout=1)
    outcome: Outcome = "crash"
    if child.process.is_alive():
        outcome, error = "timeout", f"took longer than {timeout_s:g} s"
    else:
        error = f"its process ended with exit code {child.process.exitcode}"
    child.kill()
    return Result(task.index, outcome, None, error, task.attempt, wall_s, 0.0)


def _unpacked(data: bytes, task: _Task) -> Result:
    try:
        result: Result = pickle.loads(data)  # from our own child
    except Exception:  # noqa: BLE001  a value of a plug-in's may do anything when it is loaded
        error = f"what it returned cannot be loaded here\n{traceback.format_exc()}"
        return Result(task.index, "error", None, error, task.attempt, 0.0, 0.0)
    return result


def _packed(result: Result) -> bytes:
    try:
        return pickle.dumps(result)
    except Exception:  # noqa: BLE001  as above, when it is saved
        error = f"what it returned cannot leave its process\n{traceback.format_exc()}"
        return pickle.dumps(replace(result, outcome="error", value=None, error=error))


def _serve(pipe: Connection) -> None:
    """Run in the child: one task after another until the parent's end of the pipe closes."""
    # Standard output is the driver's, for --json; what plug-ins print is for people.
    os.dup2(2, 1)
    threading.Thread(target=_end_with_parent, daemon=True).start()
    try:
        while True:
            function, rows = pipe.recv()
            for index, item, attempt in rows:
                data = _packed(_done(function, index, item, attempt))
                pipe.send_bytes(_CPU.pack(time.process_time()) + data)
    except (EOFError, BrokenPipeError):
        return


def _done(function: str, index: int, data: bytes, attempt: int) -> Result:
    try:
        item = pickle.loads(data)  # from our own driver
    except Exception:  # noqa: BLE001  a plug-in's may do anything here, too
        error = f"its item cannot be loaded in its process\n{traceback.format_exc()}"
        return Result(index, "error", None, error, attempt, 0.0, 0.0)
    return call(function, index, item, attempt)


def _end_with_parent() -> None:
    """End this process with its driver, even in the middle of a task."""
    parent = multiprocessing.parent_process()
    if parent is not None:
        wait([parent.sentinel])
        os._exit(1)
