"""A Dask cluster of separate processes over TCP, whose parts can be killed and come back."""

from __future__ import annotations

import logging
import os
import signal
import socket
import subprocess
import sys
import time
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path

DASK = Path(sys.executable).with_name("dask")
# What Dask does beside its work, as docs/batch.md has it.
THRIFTY = {
    "DASK_DISTRIBUTED__ADMIN__TICK__INTERVAL": "1s",
    "DASK_DISTRIBUTED__WORKER__PROFILE__ENABLED": "False",
}


class Cluster:
    """One scheduler and its workers, each the leader of a process group.

    Args:
        folder: for what they write.
        env: more of their environment.
        workers: how many.
        wrap: words before each command: of the scheduler, then of each worker.
        host: where the scheduler listens.
        nanny: let each worker be looked after by a nanny.
    """

    def __init__(
        self,
        folder: Path,
        env: Mapping[str, str],
        *,
        workers: int = 2,
        wrap: Sequence[Sequence[str]] = (),
        host: str = "127.0.0.1",
        nanny: bool = False,
    ) -> None:
        self.folder = folder
        folder.mkdir(parents=True, exist_ok=True)
        self.env = {**os.environ, **THRIFTY, **env}
        self._wrap = [*wrap, *[()] * (workers + 1)][: workers + 1]
        with socket.socket() as probe:
            probe.bind(("127.0.0.1", 0))
            port = probe.getsockname()[1]
        self.address = f"tcp://{host}:{port}"
        own = f"--host {host} --port {port} --no-dashboard".split()
        self._commands = [["scheduler", *own]]
        for number in range(1, workers + 1):
            own = f"{self.address} --nworkers 1 --nthreads 1 --no-dashboard".split()
            own += ["--nanny" if nanny else "--no-nanny"]
            own += ["--local-directory", str(folder / str(number))]
            self._commands.append(["worker", *own])
        self.parts: list[subprocess.Popen[bytes] | None] = [None] * (workers + 1)
        self.groups: set[int] = set()

    def __enter__(self) -> Cluster:
        self.revive()
        return self

    def __exit__(self, *_: object) -> None:
        for number in reversed(range(len(self.parts))):
            self.kill(number)

    @property
    def scheduler(self) -> int:
        """Process id of the scheduler."""
        return self.process(0)

    def process(self, number: int) -> int:
        """Process id of the scheduler (0) or a worker (from 1)."""
        part = self.parts[number]
        assert part is not None
        return part.pid

    def revive(self) -> None:
        """Start whatever does not live, as a service manager would."""
        for number, part in enumerate(self.parts):
            if part is None or part.poll() is not None:
                with (self.folder / f"{number}.log").open("ab") as log:
                    self.parts[number] = subprocess.Popen(
                        [*self._wrap[number], str(DASK), *self._commands[number]],
                        env=self.env,
                        stdout=log,
                        stderr=log,
                        start_new_session=True,
                        cwd=self.folder,
                    )
                self.groups.add(self.process(number))

    def kill(self, number: int) -> None:
        """SIGKILL to the scheduler (0) or a worker (from 1), and to nothing else of its group."""
        part = self.parts[number]
        if part is not None:
            part.kill()
            part.wait()

    def strays(self) -> list[int]:
        """Living processes of parts that are dead."""
        living = {part.pid for part in self.parts if part is not None and part.poll() is None}
        found = {group: members(group) for group in self.groups - living}
        self.groups = {*living, *(group for group, left in found.items() if left)}
        return [process for left in found.values() for process in left]

    def idle(self) -> bool:
        """Whether no worker has processes at work."""
        return not any(
            children(part.pid)
            for part in self.parts[1:]
            if part is not None and part.poll() is None
        )


@contextmanager
def cluster_here() -> Iterator[str]:
    """Address of a scheduler that has one worker with two threads, all in this process."""
    from distributed import LocalCluster

    with LocalCluster(
        n_workers=1,
        threads_per_worker=2,
        processes=False,
        protocol="tcp://",
        dashboard_address=":0",
        scheduler_kwargs={"dashboard": False},
        memory_limit=0,
        silence_logs=logging.CRITICAL,
    ) as cluster:
        yield cluster.scheduler_address


def children(process: int) -> list[int]:
    """Living processes that a process has started, but for multiprocessing's own."""
    found = []
    for entry in Path("/proc").glob("[0-9]*"):
        with suppress(OSError, ValueError):
            state, parent = (entry / "stat").read_text().rpartition(")")[2].split()[:2]
            tracker = b"resource_tracker" in (entry / "cmdline").read_bytes()
            if int(parent) == process and state not in "ZX" and not tracker:
                found.append(int(entry.name))
    return found


def members(group: int) -> list[int]:
    """Living processes of a process group."""
    found = []
    for entry in Path("/proc").glob("[0-9]*"):
        with suppress(OSError, ValueError):
            state, _, own = (entry / "stat").read_text().rpartition(")")[2].split()[:3]
            if int(own) == group and state not in "ZX":
                found.append(int(entry.name))
    return found


def strike(process: int) -> None:
    """SIGKILL, if it is still there."""
    with suppress(ProcessLookupError):
        os.kill(process, signal.SIGKILL)


def wait_for(what: object, seconds: float) -> bool:
    """Wait until a function gives something true; what it gave last."""
    until = time.monotonic() + seconds
    while not (found := what()) and time.monotonic() < until:  # type: ignore[operator]
        time.sleep(0.02)
    return bool(found)
