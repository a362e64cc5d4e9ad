"""Executors by the names that people call them."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Literal, get_args

from animeme.executors import Executor
from animeme.executors.inline import InlineExecutor
from animeme.executors.local import LocalExecutor, default_workers

Kind = Literal["local", "inline", "dask"]
KINDS: tuple[Kind, ...] = get_args(Kind)


def require(kind: str, workers: int | None, scheduler: str | None) -> None:
    """Make sure that there is such an executor.

    Raises:
        ValueError: there is none; says why.
    """
    if kind not in KINDS:
        raise ValueError(f"executor must be one of {', '.join(KINDS)}, not {kind!r}")
    if workers is not None and workers < 1:
        raise ValueError(f"workers must be at least 1, not {workers}")
    if scheduler is not None and kind != "dask":
        raise ValueError("a scheduler is of use to the executor 'dask' alone")
    if scheduler is not None and workers is not None:
        raise ValueError("a scheduler has workers of its own: leave out how many")


@contextmanager
def opened(
    kind: Kind,
    workers: int | None,
    scheduler: str | None,
    *,
    sees: Sequence[Path] = (),
    marks: Sequence[Path] = (),
    code: Callable[[], str] | None = None,
) -> Iterator[Executor]:
    """The executor called `kind`, for one piece of work.

    Args:
        kind: its name.
        workers: how many processes, all processors if None.
        scheduler: address of a Dask scheduler, None for a cluster of this machine's own.
        sees: paths that workers on other machines must see.
        marks: names of files to put where they must see them, for as long as they work.
        code: gives the digest of the code that they must have; None looks it up.
    """
    count = workers or default_workers()
    if kind == "inline":
        yield InlineExecutor()
    elif kind == "local":
        with LocalExecutor(count) as pool:
            yield pool
    else:
        from animeme.executors.dask import DaskExecutor  # takes its time

        with DaskExecutor(scheduler, count, sees=sees, marks=marks, code=code) as cluster:
            yield cluster


def place(kind: str, workers: int | None, scheduler: str | None) -> str:
    """Where work is done, in people's words."""
    if scheduler is not None:
        return f"the Dask cluster at {scheduler}"
    count = 1 if kind == "inline" else workers or default_workers()
    return f"{count} processors"
