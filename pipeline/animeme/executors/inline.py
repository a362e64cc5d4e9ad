"""One task after another, in this process: for debugging and for callers with their own workers."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from typing import Any

from animeme.executors import Result, call


class InlineExecutor:
    """Runs tasks here; a crash takes this process with it, and nothing can time out."""

    def run(
        self, function: str, items: Iterable[Any], *, timeout_s: float, retries: int
    ) -> Iterator[Result]:
        """Yield results in order; see `animeme.executors.Executor`."""
        for index, item in enumerate(items):
            yield call(function, index, item, 1)
