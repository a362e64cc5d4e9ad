"""A supervised pool of local processes.

A death or a hang of one is blamed on the task that caused it, and costs that task only.
"""

from __future__ import annotations

import os
import threading
import time
from collections import deque
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field, replace
from itertools import islice
from typing import Any, Self

from animeme.executors import LATER, Result
from animeme.executors.child import Child, Task, readable, start

# How far ahead of the work tasks are drawn, and how many before children are looked after.
_MOST_WAITING = 10_000
_DRAWN_AT_ONCE = 50
# A child is given tasks for about so long at once, and so many at most; meanwhile the driver rests.
_TOGETHER_S = 0.05
_MOST_TOGETHER = 16
_MOST_REST_S = 0.01
# A long task is remembered for some short ones.
_FADING = 0.9
# What a child takes to start, about.
_START_S = 0.4
# How long few tasks wait for a result before another child starts: the first child's start comes
# before its first.
_PATIENCE_S = 1.6
_MANY = 20
# How many children get ready before anyone knows how much there is to do.
_READY = 2


def default_workers() -> int:
    """How many processors this process may use."""
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


class _Tasks:
    """What has to be done: drawn from where it comes from while children work.

    Args:
        items: of the tasks; what takes its time to give one does so beside the children.
    """

    def __init__(self, items: Iterable[Any]) -> None:
        self._left = iter(items)
        self._count = 0
        self.waiting: deque[Task] = deque()
        self.open = True

    def draw(self, most: int) -> None:
        """Have up to `most` more of them waiting: as many as there are without a `LATER`."""
        for item in islice(self._left, most):
            if item is LATER:
                return
            self.waiting.append(Task(self._count, item))
            self._count += 1
            most -= 1
        self.open = most == 0


@dataclass
class _Pace:
    """How fast tasks are done.

    Attributes:
        came: when the last result did, on the monotonic clock.
        task_s: what a task takes, if most are as the longest of the last; 0 if not known yet.
    """

    came: float = field(default_factory=time.monotonic)
    task_s: float = 0.0

    def take(self, child: Child, result: Result) -> None:
        """Take in a result."""
        self.came = time.monotonic()
        if child.warm:
            self.task_s = max(result.wall_s, _FADING * self.task_s)
        child.warm = True

    def share(self, waiting: int, children: int) -> int:
        """How many of the waiting tasks a child is given at once; long ones one by one."""
        many = int(_TOGETHER_S / self.task_s) if self.task_s else 1
        return min(waiting, max(1, min(many, _MOST_TOGETHER, waiting // (2 * children))))

    def rest(self, children: Iterable[Child]) -> None:
        """Leave the processor to children that have more than one task: several results are taken
        in at once for less.
        """
        left = min((len(child.tasks) for child in children if child.tasks), default=1) - 1
        if left > 0:
            time.sleep(min(left * self.task_s / 2, _MOST_REST_S))

    def calls_for_more(self, tasks: _Tasks, children: int, most: int) -> bool:
        """Whether those that are there would be at the waiting tasks longer than others take to
        start.

        Args:
            tasks: what waits, and whether more is to come.
            children: how many are there.
            most: how many there could be.
        """
        many, processors = len(tasks.waiting), default_workers()
        if processors > min(children + many, most) or time.monotonic() - self.came >= _PATIENCE_S:
            return True
        if not self.task_s:
            return many >= _MANY
        # Looking for tasks needs a processor as well.
        scarce = tasks.open and children + 1 >= processors
        return many * self.task_s > children * (_PATIENCE_S if scarce else _START_S)


class LocalExecutor:
    """Runs tasks in `workers` spawned processes.

    Used as a context manager it keeps its processes, and what they have loaded, from one run to the
    next. Its processes do not import the caller's script, as those of multiprocessing do: tasks
    name what they need. While one starts, the module ``__main__`` is out of sight in this process.

    Args:
        workers: how many.
        keeps: as if it had been entered as a context manager; `close` ends it.
    """

    overlaps = True

    def __init__(self, workers: int, *, keeps: bool = False) -> None:
        self.workers = workers
        self._children: list[Child] = []
        self._keeps = keeps
        self._stopped = threading.Event()

    def __enter__(self) -> Self:
        self._keeps = True
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def get_ready(self, function: str, item: Any) -> None:
        """Have the processes that it keeps call a function; see `animeme.executors.Executor`.

        If there are fewer than two, others are started for it.
        """
        if not self._keeps or self.stopped:
            return
        missing = min(_READY, self.workers, default_workers()) - len(self._children)
        if missing > 0:
            self._children += start(missing)
        for child in self._children:
            child.get_ready(function, item)

    def release(self) -> None:
        """Let the processes that it keeps end; `close` waits for that."""
        for child in self._children:
            child.release()

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
        children, waiting, pace = self._children, tasks.waiting, _Pace()
        for child in children:
            child.warm = False
        while not self._stopped.is_set():
            busy = sum(child.busy for child in children)
            if not waiting and not busy:
                if not tasks.open:
                    return
                tasks.draw(1)
                continue
            more = min(self.workers, busy + len(waiting)) - len(children)
            if more > 0 and (
                not children or pace.calls_for_more(tasks, len(children), self.workers)
            ):
                children += start(more if children or len(waiting) >= _MANY else 1)
            if self._stopped.is_set():
                return  # `stop` may have come too early to see the newest child
            if not self._hand_out(function, waiting, pace):
                continue
            ahead = tasks.open and len(waiting) < _MOST_WAITING
            if not ahead:
                pace.rest(children)
            most_s = 0.0 if ahead else _START_S if waiting and more > 0 else timeout_s
            ready = _ready(children, timeout_s, most_s)
            if ahead and not ready:
                # While some have nothing to do, what is found for them is not held up.
                idle = not waiting and sum(child.busy for child in children) < self.workers
                tasks.draw(1 if idle else _DRAWN_AT_ONCE)
            for child in ready:
                for task, result in child.collect(timeout_s, waiting):
                    pace.take(child, result)
                    if self._stopped.is_set():
                        return  # what it ended with is nobody's fault
                    if result.outcome in ("crash", "timeout"):
                        children.remove(child)
                        if result.attempt <= retries:
                            waiting.append(replace(task, attempt=task.attempt + 1))
                            continue
                    yield result

    def _hand_out(self, function: str, waiting: deque[Task], pace: _Pace) -> bool:
        """Give idle children their next tasks; False if one of them was dead."""
        for child in [child for child in self._children if not child.tasks]:
            share = pace.share(len(waiting), len(self._children))
            if share and not child.give(function, [*islice(waiting, share)]):
                self._children.remove(child)
                return False
            for _ in range(share):
                waiting.popleft()
        return True

    def _end(self) -> None:
        self.release()
        for child in self._children:
            child.end()
        self._children.clear()


def _ready(children: list[Child], timeout_s: float, most_s: float) -> list[Child]:
    """Children that answered, died, or ran out of time; waits `most_s` for the first."""
    now = time.monotonic()
    busy = [child for child in children if child.tasks]
    patience = min((child.started + timeout_s - now for child in busy), default=0.0)
    handles = [handle for child in busy for handle in child.handles]
    woken = readable(handles, max(min(patience, most_s), 0.0))
    now = time.monotonic()
    return [
        child
        for child in busy
        if not woken.isdisjoint(child.handles) or now >= child.started + timeout_s
    ]
