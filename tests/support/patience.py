"""No test goes on for ever."""

from __future__ import annotations

import signal
from collections.abc import Iterator
from contextlib import contextmanager

import pytest


@contextmanager
def patience(seconds: int = 30) -> Iterator[None]:
    """Fail what would otherwise go on for ever."""

    def lose(*_: object) -> None:
        pytest.fail(f"still at it after {seconds} s")

    previous = signal.signal(signal.SIGALRM, lose)
    signal.alarm(seconds)
    try:
        yield
    finally:
        signal.alarm(0)
        signal.signal(signal.SIGALRM, previous)
