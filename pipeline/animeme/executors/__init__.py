"""Ways to run tasks, behind one protocol; all give the same results."""

from __future__ import annotations

import importlib
import time
import traceback
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from typing import Any, Final, Literal, Protocol

Outcome = Literal["ok", "error", "crash", "timeout"]
# What items are drawn from may give it between them: an executor looks after its work meanwhile.
LATER: Final = object()


@dataclass(frozen=True)
class Result:
    """How one task ended.

    Attributes:
        index: of the item, in the order they were given.
        outcome: "ok"; "error" if the function raised; "crash" if its process died; "timeout".
        value: what the function returned, None unless "ok".
        error: what happened, for a log; "" if "ok".
        attempt: 1 for the first.
        wall_s, cpu_s: of that attempt; CPU time is 0 where its process died.
        host: name of the machine, "" for this one.
    """

    index: int
    outcome: Outcome
    value: Any
    error: str
    attempt: int
    wall_s: float
    cpu_s: float
    host: str = ""


class Executor(Protocol):
    """Runs one function over many items.

    Attributes:
        overlaps: it draws items while it works on others.
    """

    overlaps: bool

    @property
    def cpu_s(self) -> float:
        """CPU time so far of its processes that are still alive, this one aside."""
        ...

    def run(
        self, function: str, items: Iterable[Any], *, timeout_s: float, retries: int
    ) -> Iterator[Result]:
        """Yield a result per item as it ends, in any order.

        Args:
            function: importable name, ``package.module:function``.
            items: picklable arguments; drawn one by one, where an executor can work meanwhile. A
                `LATER` among them is none: it says that the next may take a while to come.
            timeout_s: the longest one item may take; not every executor can enforce it.
            retries: how often an item whose process died or hung is tried again.
        """
        ...

    def get_ready(self, function: str, item: Any) -> None:
        """Have processes that it keeps call a function while they have nothing else to do.

        What that loads, tasks find loaded. What comes of the call is nobody's business.

        Args:
            function: as of `run`.
            item: its picklable argument.
        """
        ...

    def release(self) -> None:
        """Let its processes end while the caller goes on: no more work is in sight."""
        ...


def call(function: str, index: int, item: Any, attempt: int) -> Result:
    """Run one task in this process and time it; an exception becomes an "error" result."""
    wall, cpu = time.perf_counter(), time.process_time()
    outcome: Outcome = "ok"
    value, error = None, ""
    try:
        value = resolve(function)(item)
    except Exception:  # noqa: BLE001  whatever a plug-in raises must not stop the batch
        outcome, error = "error", traceback.format_exc()
    return Result(
        index,
        outcome,
        value,
        error,
        attempt,
        time.perf_counter() - wall,
        time.process_time() - cpu,
    )


def resolve(function: str) -> Any:
    """The function called ``package.module:function``."""
    module, _, name = function.partition(":")
    return getattr(importlib.import_module(module), name)
