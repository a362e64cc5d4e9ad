"""Results of tasks of `support.work`, whoever does them."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from animeme.executors import Executor, Result
from animeme.executors.local import LocalExecutor
from support.jobs import PATIENCE_S
from support.patience import patience


def results(
    function: str,
    items: Sequence[Any],
    *,
    executor: Executor | None = None,
    timeout_s: float = PATIENCE_S,
    retries: int = 1,
) -> list[Result]:
    """Results of tasks of `support.work`, by index; each item has exactly one."""
    chosen = executor or LocalExecutor(2)
    with patience():
        found = list(
            chosen.run(f"support.work:{function}", items, timeout_s=timeout_s, retries=retries)
        )
    assert sorted(result.index for result in found) == list(range(len(items)))
    return sorted(found, key=lambda result: result.index)
