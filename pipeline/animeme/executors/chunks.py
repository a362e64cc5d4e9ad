"""Which tasks of a run are under way on a cluster, and which go out next."""

from __future__ import annotations

import pickle
import secrets
import traceback
from collections import Counter, deque
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any

from animeme.executors import Result

if TYPE_CHECKING:
    from distributed import Future

# A chunk costs some 10 ms on its way; one much longer comes late to the end of a run.
CHUNK_S = 10.0
LEAST_S = 0.25
MOST_ITEMS = 1000
# Chunks per thread that are under way: one being done, one at hand.
AHEAD = 2
# Chunks that end without a word are sent so often before their first task is blamed.
MOST_SENT = 3


@dataclass
class Batch:
    """The tasks of one call of `run`.

    Attributes:
        items, function, timeout_s, retries: as given.
        waiting: indices of tasks that are not under way.
        sent: key of a chunk → indices of its tasks, and its future.
        left: how many tasks have no result.
        excused: keys of chunks whose worker was not fit, which is no fault of their tasks.
        forgotten: a scheduler says that it knows nothing of a chunk.
        count: of chunks so far.
        turn: tells what is heard of this call from what is heard of others.
    """

    items: list[Any]
    function: str
    timeout_s: float
    retries: int
    waiting: deque[int] = field(init=False)
    sent: dict[str, tuple[list[int], Future | None]] = field(default_factory=dict)
    left: int = field(init=False)
    excused: set[str] = field(default_factory=set)
    forgotten: bool = False
    count: int = 0
    turn: str = field(default_factory=lambda: secrets.token_hex(4))
    _ended: bytearray = field(init=False)
    _silent: Counter[int] = field(default_factory=Counter)
    _wall_s: float = 0.0
    _timed: int = 0

    def __post_init__(self) -> None:
        self.left = len(self.items)
        self.waiting = deque(range(self.left))
        self._ended = bytearray(self.left)

    def take(self, slots: int) -> list[int]:
        """Indices for the next chunk: worth `CHUNK_S`, towards the end down to `LEAST_S`."""
        size = 1
        if self._timed:
            mean_s = max(self._wall_s / self._timed, 1e-6)
            share = max(-(-len(self.waiting) // (AHEAD * slots)), int(LEAST_S / mean_s))
            size = min(int(CHUNK_S / mean_s), share, MOST_ITEMS)
        return [self.waiting.popleft() for _ in range(min(max(size, 1), len(self.waiting)))]

    def fresh(self, results: Iterable[Result]) -> Iterator[Result]:
        """Those of the results that are the first of their tasks, with their values loaded."""
        for result in results:
            if not self._ended[result.index]:
                self._ended[result.index] = 1
                self.left -= 1
                self._wall_s, self._timed = self._wall_s + result.wall_s, self._timed + 1
                yield _loaded(result)

    def end(self, key: str, status: str, error: BaseException | None) -> Result | None:
        """Take in that a chunk is over; gives a result for a task that is to blame."""
        if key not in self.sent:
            return None
        indices, _ = self.sent.pop(key)
        lacking = [index for index in indices if not self._ended[index]]
        if status in ("cancelled", "lost"):
            self.forgotten = True
        self.waiting.extendleft(reversed(lacking))
        innocent = key in self.excused or status not in ("error", "finished")
        if innocent or len(lacking) < len(indices):
            return None
        first = lacking[0]
        # Dask itself sends a chunk whose worker died to another, three times.
        self._silent[first] += MOST_SENT if status == "error" else 1
        if self._silent[first] < MOST_SENT:
            return None
        self.waiting.popleft()
        self._ended[first] = 1
        self.left -= 1
        why = f"the Dask workers that did it ended: {error or 'they told nothing'}"
        return Result(first, "crash", None, why, self._silent[first], 0.0, 0.0)

    def recall(self) -> None:
        """Take back everything that is under way."""
        lacking = [i for indices, _ in self.sent.values() for i in indices if not self._ended[i]]
        self.waiting = deque(sorted({*lacking, *self.waiting}))
        self.sent.clear()
        self.forgotten = False


def _loaded(result: Result) -> Result:
    if result.outcome != "ok":
        return result
    try:
        return replace(result, value=pickle.loads(result.value))  # from our own worker
    except Exception:  # noqa: BLE001  a value of a plug-in's may do anything when it is loaded
        error = f"what it returned cannot be loaded here\n{traceback.format_exc()}"
        return replace(result, outcome="error", value=None, error=error)
