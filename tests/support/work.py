"""Tasks for executors to run; children import them by name."""

from __future__ import annotations

import os
import signal
import time
from pathlib import Path
from typing import Any


def double(item: int) -> int:
    return 2 * item


def process_id(item: Any) -> int:
    return os.getpid()


def rest(item: float) -> int:
    """Sleep for some seconds; return the process's id."""
    time.sleep(item)
    return os.getpid()


_kept: list[Any] = []


def keep(item: Any) -> None:
    """Keep something in this process."""
    _kept.append(item)


def kept(item: Any) -> tuple[int, list[Any]]:
    """Tell the process's id, and what was kept in it."""
    return os.getpid(), _kept


def refuse(item: str) -> str:
    """Raise on everything but "good"."""
    if item != "good":
        raise LookupError(f"no such thing as {item}")
    return item


def hang(item: str) -> str:
    """Return "good" at once and never return anything else."""
    if item != "good":
        time.sleep(3600)
    return item


def die(item: str) -> str:
    """End the process, as the item says; return "good"."""
    if item == "exit":
        os._exit(7)
    if item == "kill":
        os.kill(os.getpid(), signal.SIGKILL)
    if item == "quit":
        raise SystemExit(4)
    return item


def die_once(item: tuple[int, str]) -> int:
    """End the process if the item names a file that is not there yet; make it first."""
    number, name = item
    marker = Path(name) if name else None
    if marker is not None and not marker.exists():
        marker.touch()
        os.kill(os.getpid(), signal.SIGKILL)
    return number


def touch(item: str) -> None:
    Path(item).touch()


def touch_late(item: str) -> None:
    time.sleep(2)
    touch(item)


class Unsendable:
    """Travels to another process only to fail there."""

    def __init__(self, first: int, second: int) -> None:
        self.sum = first + second

    def __reduce__(self) -> tuple[Any, ...]:
        return Unsendable, (self.sum,)


def odd_value(item: str) -> Any:
    """Give what cannot be pickled, what cannot be unpickled, or the item itself."""
    if item == "unpicklable":
        return lambda: item
    if item == "unloadable":
        return Unsendable(1, 2)
    return item
