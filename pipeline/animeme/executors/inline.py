"""One task after another, in this process: for debugging and for callers with their own workers."""

from __future__ import annotations

import sys
from collections.abc import Iterable, Iterator
from contextlib import redirect_stdout
from typing import Any

from animeme.executors import LATER, Result, call


class InlineExecutor:
    """Runs tasks here; a crash takes this process with it, and nothing can time out."""

    cpu_s = 0.0
    overlaps = False

    def run(
        self, function: str, items: Iterable[Any], *, timeout_s: float, retries: int
    ) -> Iterator[Result]:
        """Yield results in order; see `animeme.executors.Executor`."""
        for index, item in enumerate(item for item in items if item is not LATER):
            # Standard output is the caller's; what plug-ins print is for people.
            with redirect_stdout(sys.stderr):
                try:
                    result = call(function, index, item, 1)
                except SystemExit as quit_:
                    error = f"it tried to end the process with exit code {quit_.code}"
                    result = Result(index, "crash", None, error, 1, 0.0, 0.0)
            yield result

    def get_ready(self, function: str, item: Any) -> None:
        """Do nothing: what tasks need is loaded when they need it."""

    def release(self) -> None:
        """Do nothing: there is no process but the caller's."""
