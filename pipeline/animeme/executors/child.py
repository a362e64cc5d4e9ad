"""One process of the local pool: how it is started, the pipe to it, and what runs in it.

A child answers each task before it begins the next, so that a death or a hang is blamed on the task
that caused it. It ends with its parent: its pipe closes.
"""

from __future__ import annotations

import gc
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
from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from multiprocessing import resource_tracker
from multiprocessing.connection import Connection, wait
from multiprocessing.process import BaseProcess
from types import ModuleType
from typing import Any

from animeme.executors import Outcome, Result, call

# A task is small; threads of numerical libraries would only fight over the cores.
_SINGLE_THREADED = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS")
# What children inherit is the whole process's, and a Dask worker starts them in several threads.
_ENVIRONMENT = threading.Lock()
# A child that has been at the tasks it was given for so long gives back what it has not begun.
_LONG_S = 0.25
_GIVEN_BACK = b""
# The index of what a child does to get ready: nobody asks what comes of it.
_GETTING_READY = -1
# What a child's result begins with: its CPU seconds so far.
_CPU = struct.Struct("d")


@dataclass(frozen=True)
class Task:
    """One item of work, and how often it has been tried, this time included."""

    index: int
    item: Any
    attempt: int = 1


class Child:
    """A process, the pipe to it, and what it is doing.

    Attributes:
        process: the process.
        handles: what can be read when it has answered, or has ended.
        tasks: what it was given and has not answered; it is at the first. One by itself while it
            gets ready.
        started: when it began that, on the monotonic clock.
        cpu_s: CPU seconds it had used when it last answered.
        warm: it has loaded what its tasks need: they take their own time.
    """

    def __init__(self, context: Any) -> None:
        self._pipe, theirs = context.Pipe()
        self.process: BaseProcess = context.Process(target=_serve, args=(theirs,), daemon=True)
        self.process.start()
        theirs.close()
        self.handles = self._pipe.fileno(), self.process.sentinel
        self.tasks: deque[Task] = deque()
        self.started = 0.0
        self.cpu_s = 0.0
        self.warm = False
        self._next: tuple[str, Any] | None = None

    @property
    def busy(self) -> bool:
        """Whether somebody waits for what it does."""
        return any(task.index != _GETTING_READY for task in self.tasks)

    def give(self, function: str, tasks: Sequence[Task]) -> bool:
        """Have it do these; it has nothing to do.

        False if it has died while it was idle, nobody's fault, or was let go.
        """
        # Each by itself: what cannot be loaded is nobody's fault but its own.
        rows = [(task.index, pickle.dumps(task.item), task.attempt) for task in tasks]
        try:
            self._pipe.send((function, rows))
        except OSError:
            self.kill()
            return False
        self.tasks, self.started = deque(tasks), time.monotonic()
        return True

    def get_ready(self, function: str, item: Any) -> None:
        """Have it call a function, when it has nothing else to do.

        What comes of it is no result of `collect`; if it dies of it, `give` tells.
        """
        if self.tasks:  # its pipe holds little: what it is sent while it works could block
            self._next = function, item
        else:
            self.give(function, [Task(_GETTING_READY, item)])

    def collect(self, timeout_s: float, waiting: deque[Task]) -> Iterator[tuple[Task, Result]]:
        """The tasks that have ended of a child that is ready, and their results.

        It is dead afterwards if one ended with it, or if it died or hung while it got ready. What
        it will not begin goes back to `waiting`.
        """
        answers = True
        while answers:
            data = self._answer()
            if data == _GIVEN_BACK:
                self._give_back(waiting)
                break
            task = self.tasks.popleft()
            if data is None:
                result = self._end_of(task, timeout_s)
                self._give_back(waiting)
            else:
                (self.cpu_s,) = _CPU.unpack_from(data)
                self.started = time.monotonic()
                result = _unpacked(data[_CPU.size :], task)
            answers = bool(self.tasks) and bool(readable(self.handles[:1], 0.0))
            if task.index != _GETTING_READY:
                yield task, result
        if self._next is not None and not self.tasks:
            function, item = self._next
            self._next = None
            self.get_ready(function, item)

    def _give_back(self, waiting: deque[Task]) -> None:
        waiting.extendleft(reversed(self.tasks))
        self.tasks.clear()

    def _answer(self) -> bytes | None:
        """What it has sent; None if it has died or hangs."""
        try:
            return self._pipe.recv_bytes() if readable(self.handles[:1], 0.0) else None
        except (EOFError, OSError):
            return None

    def _end_of(self, task: Task, timeout_s: float) -> Result:
        """What became of the task that it died or hung over."""
        wall_s = time.monotonic() - self.started
        if self.process.is_alive() and wall_s < timeout_s:
            # Its pipe closed just before its end.
            self.process.join(timeout=1)
        outcome: Outcome = "crash"
        if self.process.is_alive():
            outcome, error = "timeout", f"took longer than {timeout_s:g} s"
        else:
            error = f"its process ended with exit code {self.process.exitcode}"
        self.kill()
        return Result(task.index, outcome, None, error, task.attempt, wall_s, 0.0)

    def release(self) -> None:
        """Let it end, when it has nothing to do."""
        self._pipe.close()

    def end(self) -> None:
        """As `release`, and wait for it; nobody waits until it is ready for nothing."""
        if self.tasks:
            self.process.kill()
        self._pipe.close()
        self.process.join(timeout=5)
        if self.process.is_alive():
            self.process.kill()
            self.process.join()

    def kill(self) -> None:
        """End it, whatever it is doing."""
        self.cpu_s = 0.0  # the system counts it from now on
        self.process.kill()
        self.process.join()
        self._pipe.close()


def start(count: int) -> list[Child]:
    """Start children, which Ctrl-C does not reach, and which leave the caller's script alone."""
    with _ENVIRONMENT, uninterrupted(), _single_threaded(), _scriptless():
        context = multiprocessing.get_context("spawn")
        return [Child(context) for _ in range(count)]


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
    """Let processes that are started now not import the caller's script, which takes its time."""
    script = sys.modules["__main__"]
    sys.modules["__main__"] = ModuleType("__main__")
    try:
        yield
    finally:
        sys.modules["__main__"] = script


def readable(handles: Iterable[int], most_s: float) -> set[int]:
    """Those that can be read or have ended; waits `most_s` for the first.

    What multiprocessing has for it takes longer than many a task.
    """
    poll = select.poll()
    for handle in handles:
        poll.register(handle, select.POLLIN)
    return {handle for handle, _ in poll.poll(1000 * most_s)}


def _unpacked(data: bytes, task: Task) -> Result:
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
    known: set[str] = set()
    try:
        while True:
            function, rows = pipe.recv()
            began = time.monotonic()
            for index, item, attempt in rows:
                if time.monotonic() - began > _LONG_S:
                    pipe.send_bytes(_GIVEN_BACK)
                    break
                data = _packed(_done(function, index, item, attempt))
                pipe.send_bytes(_CPU.pack(time.process_time()) + data)
                if function not in known:
                    # What a first call loads is there to stay: looking for garbage in it again and
                    # again, and at the end, takes a twentieth of a run of short tasks.
                    known.add(function)
                    gc.collect()
                    gc.freeze()
    except (EOFError, ConnectionError):
        gc.freeze()


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
