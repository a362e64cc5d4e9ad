"""What a run loads: nothing but what it uses."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

from support.jobs import Capture, run_inline, small_job

NOOP = """
import sys
from animeme.cli import main
try:
    main(sys.argv[1:])
except SystemExit as end:
    assert end.code == 0, end.code
print(*sorted(sys.modules))
"""
# Numerics and processes of work; reviews, rehearsals and clusters; the network.
NEEDLESS = {
    "animeme.aligning",
    "animeme.animating",
    "animeme.deliveries",
    "animeme.rehearsal",
    "animeme.reviewing",
    "animeme.steps",
    "animeme.writing",
    "asyncio",
    "distributed",
    "http.client",
    "matplotlib",
    "numpy",
    "rich",
    "ssl",
}


def test_a_run_with_nothing_to_do_loads_none_of_what_would_do_it(
    tmp_path: Path, capsys: Capture
) -> None:
    job = small_job(tmp_path / "job")
    job.timed_line()
    assert run_inline(capsys, job).code == 0
    ended = subprocess.run(
        [sys.executable, "-c", NOOP, "run", job.file], capture_output=True, text=True, check=False
    )
    assert ended.returncode == 0, ended.stderr
    assert "1 of 1 lines and 1 of 1 files were there already" in ended.stderr
    loaded = set(ended.stdout.split())
    assert "animeme.runner" in loaded
    assert not loaded & NEEDLESS
