"""Runs that something happens to: the next goes on, ends as if nothing had been, leaves nothing."""

from __future__ import annotations

import importlib.util
from pathlib import Path

import pytest

from support.chaos import Chaos

ROUNDS = 100


@pytest.mark.slow
def test_whatever_happens_the_next_run_puts_it_right(tmp_path: Path) -> None:
    dask = importlib.util.find_spec("distributed") is not None
    with Chaos(tmp_path / "all", dask=dask) as chaos:
        chaos.rounds(ROUNDS)
    assert all(this.struck for this in chaos.told if this.fault in ("damage", "hang", "segfault"))
    # What comes too late to disturb anything shows nothing.
    assert sum(this.struck for this in chaos.told) > 0.7 * ROUNDS
    assert sum(this.taken_up for this in chaos.told) > ROUNDS
