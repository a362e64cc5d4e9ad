"""The processes that do a run's tasks on a worker of a Dask cluster."""

from __future__ import annotations

import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager

from animeme.executors.local import LocalExecutor

# Processes of a run whose driver is silent for so long have ended by themselves.
IDLE_S = 15.0


class Processes:
    """Supervised processes, each for one thread of a worker, kept from chunk to chunk.

    Attributes:
        fit: (run, what was looked at) that this worker has been found fit for.
    """

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._idle: list[tuple[str, LocalExecutor, float]] = []
        self._busy: list[tuple[str, LocalExecutor]] = []
        self._stopped: set[str] = set()
        self.fit: set[tuple[str, object]] = set()
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
            self.fit -= {known for known in self.fit if known[0] == run}
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
