"""Runs that something happens to: the next goes on, ends as if nothing had been, leaves nothing."""

from __future__ import annotations

import importlib.util
from pathlib import Path

import pytest

from support.chaos import Chaos
from support.jobs import Capture, SmallJob, run_inline

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


def test_what_a_dead_worker_has_half_written_does_not_stay(job: SmallJob, capsys: Capture) -> None:
    kept = job.output / "en" / ".keep-me"
    for path in (job.output / ".0123abcd", kept.with_name(".89abcdef.glb"), kept):
        path.parent.mkdir(parents=True, exist_ok=True)
        path.touch()
    run_inline(capsys, job)  # sees that nothing hidden is left but what it does not know
    assert kept.exists()
