"""Dask as it is installed here: its errors, its log, a cluster of this machine's own."""

from __future__ import annotations

import logging
from collections.abc import Iterator
from contextlib import contextmanager

from animeme.errors import InputError
from animeme.executors.child import uninterrupted


def lost() -> tuple[type[BaseException], ...]:
    """What Dask raises when the other end is not there."""
    from concurrent.futures import CancelledError

    from distributed.client import ClosedClientError, FutureCancelledError

    return OSError, TimeoutError, CancelledError, ClosedClientError, FutureCancelledError


def require_distributed() -> None:
    """Raise an InputError that says what to install, if Dask is not."""
    try:
        import distributed  # noqa: F401
    except ImportError as error:
        raise InputError(
            "extra-missing",
            f"Dask is not installed ({error})",
            place="--executor dask",
            action="Install it: pip install 'animeme[dask]'.",
        ) from error


@contextmanager
def silence() -> Iterator[None]:
    """Keep Dask's log to itself: what matters of it becomes an error of ours."""
    found = [logging.getLogger(name) for name in [*logging.root.manager.loggerDict, "distributed"]]
    own = [logger for logger in found if logger.name.partition(".")[0] == "distributed"]
    before = [(logger, logger.handlers, logger.propagate) for logger in own]
    for logger in own:  # some of its parts have handlers of their own
        logger.handlers, logger.propagate = [logging.NullHandler()], False
    try:
        yield
    finally:
        for logger, handlers, propagate in before:
            logger.handlers, logger.propagate = handlers, propagate


@contextmanager
def local_cluster(workers: int) -> Iterator[str]:
    """Start a scheduler here and workers in processes of their own; gives its address."""
    import dask
    from distributed import LocalCluster

    settings = {
        "distributed.worker.daemon": False,  # they start processes
        "distributed.worker.profile.enabled": False,
        "distributed.admin.tick.interval": "1s",
    }
    with dask.config.set(settings):
        with uninterrupted():  # Ctrl-C is ours to handle
            cluster = LocalCluster(
                n_workers=workers,
                threads_per_worker=1,
                processes=True,
                dashboard_address=":0",
                scheduler_kwargs={"dashboard": False},
                memory_limit=0,
                silence_logs=logging.CRITICAL + 1,
            )
        try:
            yield cluster.scheduler_address
        finally:
            cluster.close(timeout=10)
