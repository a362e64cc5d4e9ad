"""Tasks on a Dask cluster: one that runs already, or one of this machine's own.

Tasks go out in chunks worth some seconds, and each result comes back as it ends. What a chunk had
not told when its worker died goes out again; so does everything when the scheduler dies, whose
memory of our work dies with it. Workers read and write files by their paths, so each is asked
first whether it sees what this machine sees, and has the same code.
"""

from __future__ import annotations

import hashlib
import importlib
import os
import pickle
import queue
import secrets
import time
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import ExitStack, contextmanager, suppress
from pathlib import Path
from typing import TYPE_CHECKING, Any, Self

from animeme.errors import InputError
from animeme.executors import LATER, Result, crew
from animeme.executors.chunks import AHEAD, Batch
from animeme.executors.clusters import local_cluster, lost, require_distributed, silence
from animeme.files import unwritable

if TYPE_CHECKING:
    from distributed import Client, Future

# How long a run waits for a scheduler or a worker to come, or to come back.
PATIENCE_S = 120.0
_ASK_EVERY_S = 1.0
_NOTHING = pickle.dumps([])


class DaskExecutor:
    """Runs tasks on a Dask cluster; it is connected to, or started, when there is work.

    Used as a context manager it keeps the connection, and the processes of the workers, from one
    run to the next. Scripts that start a cluster need the usual ``if __name__ == "__main__":``
    guard of multiprocessing.

    Args:
        scheduler: its address; None starts a cluster of this machine's own.
        workers: how many that one has.
        sees: paths that every worker must see; of files, with the same content.
        marks: names of files to put where every worker must see them, for the length of a run.
        code: gives the digest that the code of every worker must have; None looks it up.
        patience_s: how long to wait for a scheduler or a worker to come, or to come back.
    """

    overlaps = False

    def __init__(
        self,
        scheduler: str | None = None,
        workers: int = 1,
        *,
        sees: Sequence[Path] = (),
        marks: Sequence[Path] = (),
        code: Callable[[], str] | None = None,
        patience_s: float = PATIENCE_S,
    ) -> None:
        self.scheduler = scheduler
        self.workers = workers
        self.sees = tuple(sees)
        self.marks = tuple(marks)
        self.patience_s = patience_s
        self.cpu_s = 0.0
        self._run = secrets.token_hex(8)
        self._code_of, self._code = code, ""
        self._keeps = False
        self._open = ExitStack()
        self._address = scheduler or ""
        self._client: Client | None = None
        self._misfits: dict[str, InputError] = {}
        self._heard: queue.SimpleQueue[Any] = queue.SimpleQueue()
        self._slots, self._asked = 0, 0.0
        self._manned = time.monotonic()

    def __enter__(self) -> Self:
        self._keeps = True
        return self

    def __exit__(self, *_: object) -> None:
        self._keeps = False
        self._close()

    def run(
        self, function: str, items: Iterable[Any], *, timeout_s: float, retries: int
    ) -> Iterator[Result]:
        """Yield results as they come; see `animeme.executors.Executor`.

        Raises:
            InputError: there is no scheduler or no worker, for longer than `patience_s`, or a
                worker is not fit for this run.
        """
        given = [item for item in items if item is not LATER]
        if not given:
            return
        try:
            self._start()
            with self._terms() as terms:
                batch = Batch(given, function, timeout_s, retries)
                try:
                    yield from self._results(batch, terms)
                except BaseException:
                    self._stop(batch)
                    raise
        finally:
            if not self._keeps:
                self._close()

    def get_ready(self, function: str, item: Any) -> None:
        """Do nothing: its processes get ready over the first of many tasks."""

    def release(self) -> None:
        """Do nothing: its processes end with the connection."""

    def _results(self, batch: Batch, terms: crew.Terms) -> Iterator[Result]:
        self._manned = time.monotonic()
        while batch.left:
            try:
                self._send(batch, terms)
            except lost():
                self._reconnect(batch)
                continue
            for message in self._messages():
                if isinstance(message, tuple):
                    key, status, error = message
                    blamed = batch.end(key, status, error)
                    if blamed is not None:
                        yield blamed
                elif message.get("turn") == batch.turn:
                    self._manned = time.monotonic()
                    self.cpu_s += message.get("cpu_s", 0.0)
                    yield from batch.fresh(pickle.loads(message.get("results", _NOTHING)))
                    if "misfit" in message:
                        batch.excused.add(message["chunk"])
                        self._exclude(message["worker"], pickle.loads(message["misfit"]))
            if batch.forgotten or self._connected().status != "running":
                self._reconnect(batch)
            elif time.monotonic() - self._manned > self.patience_s:
                raise self._away("worker", "no Dask worker is there", batch)

    def _messages(self) -> Iterator[Any]:
        """What has been heard; waits a moment for the first."""
        with suppress(queue.Empty):
            yield self._heard.get(timeout=_ASK_EVERY_S)
            while True:
                yield self._heard.get_nowait()

    def _send(self, batch: Batch, terms: crew.Terms) -> None:
        """Keep every thread of the cluster at work."""
        client = self._connected()
        if time.monotonic() - self._asked > _ASK_EVERY_S:
            threads = client.nthreads()
            fit = [address for address in threads if address not in self._misfits]
            if self._misfits and threads and not fit:
                raise next(iter(self._misfits.values()))
            self._slots = sum(threads[address] for address in fit)
            self._asked = time.monotonic()
            if self._slots:
                self._manned = self._asked
        while batch.waiting and len(batch.sent) < AHEAD * self._slots:
            indices = batch.take(self._slots)
            chunk = crew.Chunk(
                terms,
                client.id,
                batch.turn,
                batch.function,
                tuple((index, pickle.dumps(batch.items[index])) for index in indices),
                batch.timeout_s,
                batch.retries,
            )
            key = f"animeme-{batch.turn}-{batch.count}"
            batch.count += 1
            batch.sent[key] = indices, None
            future = client.submit(crew.work, chunk, key=key, pure=False, workers=self._allowed())
            batch.sent[key] = indices, future
            future.add_done_callback(self._ended)

    def _ended(self, future: Future) -> None:
        status = future.status
        error = future.exception() if status == "error" else None
        self._heard.put((future.key, status, error))

    def _allowed(self) -> list[str] | None:
        """Workers that may be used, None for all."""
        if not self._misfits:
            return None
        return [address for address in self._connected().nthreads() if address not in self._misfits]

    def _connected(self) -> Client:
        assert self._client is not None
        return self._client

    def _start(self) -> None:
        """Connect, unless that has been done, and see whether the workers are fit."""
        if self._client is not None:
            return
        require_distributed()
        self._open.enter_context(silence())
        if self.scheduler is None:
            self._address = self._open.enter_context(local_cluster(self.workers))
        until = time.monotonic() + self.patience_s
        self._connect(until, None)
        client = self._connected()
        while not client.nthreads():
            if time.monotonic() > until:
                raise self._away("worker", "no Dask worker has come", None)
            time.sleep(0.1)
        self._check(client)

    def _check(self, client: Client) -> None:
        """See that every worker is fit for this run.

        Raises:
            InputError: one is not; says why, and what to do.
        """
        module = crew.__name__
        lacking = client.run(importlib.import_module, module, on_error="return")
        for address, found in lacking.items():
            if isinstance(found, ImportError):
                misfit = crew.Misfit(
                    "worker-code",
                    f"it has no animeme ({found})",
                    "Install the same version of animeme[dask] on every machine.",
                )
                self._exclude(address, misfit)
        with self._terms() as terms:
            there = [address for address in lacking if address not in self._misfits]
            found = client.run(crew.fit, terms, workers=there, on_error="return") if there else {}
        for address, answer in found.items():
            if isinstance(answer, crew.Misfit):
                self._exclude(address, answer)
            elif isinstance(answer, Exception) and not isinstance(answer, OSError):
                said = f"{type(answer).__name__}: {answer}"
                self._exclude(address, crew.Misfit("worker-code", said, "Start it again."))
        if self._misfits:
            raise next(iter(self._misfits.values()))

    def _exclude(self, address: str, misfit: crew.Misfit) -> None:
        place = f"Dask worker {address}"
        error = InputError(misfit.code, misfit.problem, place=place, action=misfit.action)
        self._misfits[address] = error
        self._asked = 0.0

    def _connect(self, until: float, batch: Batch | None) -> None:
        from distributed import Client
        from distributed.comm import resolve_address

        try:
            resolve_address(self._address)
        except (ValueError, OSError) as error:
            raise self._away(
                "scheduler", f"is no address that can be used ({error})", None
            ) from error
        while True:
            wait_s = min(10.0, max(until - time.monotonic(), 1.0))
            try:
                self._client = Client(
                    self._address, timeout=wait_s, set_as_default=False, name="animeme"
                )
                self._client.subscribe_topic(self._client.id, self._hear)
                return
            except lost() as error:
                if time.monotonic() > until:
                    problem = "no Dask scheduler answers there"
                    raise self._away("scheduler", problem, batch) from error
                time.sleep(0.2)

    def _hear(self, event: tuple[float, Any]) -> None:
        message = event[1]
        if isinstance(message, dict) and "turn" in message:
            self._heard.put(message)

    def _reconnect(self, batch: Batch) -> None:
        """Begin again with a scheduler that knows nothing of us."""
        until = time.monotonic() + self.patience_s
        batch.recall()
        self._leave()
        self._misfits.clear()
        self._connect(until, batch)
        self._slots, self._asked = 0, 0.0
        self._manned = time.monotonic()

    def _away(self, who: str, problem: str, batch: Batch | None) -> InputError:
        if batch is not None:
            problem = f"{problem} any more, for {self.patience_s:g} s"
        done = f"{len(batch.items) - batch.left} of {len(batch.items)} tasks " if batch else ""
        go_on = f"{done}are done; run again, and it goes on from there." if batch else ""
        start = "Start `dask scheduler` and `dask worker`, and check the address"
        return InputError(
            f"{who}-away",
            problem,
            place=self._address or "local Dask cluster",
            action=f"{start}: {go_on}" if go_on else f"{start}.",
        )

    @contextmanager
    def _terms(self) -> Iterator[crew.Terms]:
        """What workers are asked to see, put in place for as long as they are."""
        if not self._code:
            self._code = (self._code_of or crew.code_digest)()
        seen = [(os.path.abspath(path), _digest(path)) for path in self.sees]
        made = [mark for mark in self.marks if mark.parent.is_dir()]
        try:
            for mark in made:
                _put(mark)
                seen.append((os.path.abspath(mark), _digest(mark)))
            yield crew.Terms(self._run, self._code, os.getcwd(), tuple(seen))
        finally:
            for mark in made:
                with suppress(OSError):
                    mark.unlink()

    def _stop(self, batch: Batch) -> None:
        """Have nothing more done, and wait until nothing is."""
        client = self._client
        if client is None or client.status != "running":
            return
        with suppress(*lost()):
            client.cancel([future for _, future in batch.sent.values() if future is not None])
            client.run(crew.dismiss, self._run, on_error="ignore")
        self._run = secrets.token_hex(8)

    def _leave(self) -> None:
        client, self._client = self._client, None
        if client is None:
            return
        with suppress(*lost(), RuntimeError):
            client.close(timeout=2)

    def _close(self) -> None:
        """Give back what was taken: processes, connection, cluster."""
        client = self._client
        try:
            if client is not None and client.status == "running":
                with suppress(*lost()):
                    client.run(crew.dismiss, self._run, on_error="ignore")
        finally:
            self._leave()
            self._open.close()
            self._misfits.clear()


def _put(mark: Path) -> None:
    try:
        mark.write_text(secrets.token_hex(16))
    except OSError as error:
        raise unwritable(mark.parent, error) from error


def _digest(path: Path) -> str:
    return hashlib.sha256(path.read_bytes()).hexdigest() if path.is_file() else ""
