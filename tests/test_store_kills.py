"""Runs that are killed: the next goes on, ends as if nothing had been, and leaves no rubbish."""

from __future__ import annotations

import os
import random
import shutil
import signal
import subprocess
import time
from pathlib import Path

import pytest

from support.jobs import CONSOLE, PATIENCE_S, SmallJob, console, digests, small_job

LINES = ("en/boat", "en/five", "en/moon", "de/boat", "es/five")


def results(job: SmallJob) -> dict[str, str]:
    found = digests(job.output)
    found.pop("run.jsonl", None)
    return found


def killed(job: SmallJob, after_lines: int, victim: str) -> None:
    """Begin a run, and kill it or one of its workers when so many lines are done."""
    command = [str(CONSOLE), "run", str(job.file), "--workers", "2"]
    log = job.output / "run.jsonl"
    with subprocess.Popen(
        command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL, start_new_session=True
    ) as process:
        until = time.monotonic() + PATIENCE_S
        while process.poll() is None and time.monotonic() < until:
            if log.is_file() and log.read_text(encoding="utf-8").count('"line"') > after_lines:
                break
            time.sleep(0.005)
        if victim == "driver":
            process.kill()
        elif victim == "Ctrl-C":
            os.killpg(process.pid, signal.SIGINT)
        else:
            children = Path(f"/proc/{process.pid}/task/{process.pid}/children").read_text().split()
            for child in children[-1:]:
                os.kill(int(child), signal.SIGKILL)
        process.wait(timeout=PATIENCE_S)
    until = time.monotonic() + PATIENCE_S
    while _members(process.pid) and time.monotonic() < until:
        time.sleep(0.01)
    assert _members(process.pid) == []


def _members(group: int) -> list[str]:
    """Living processes of a group."""
    found = []
    for entry in Path("/proc").glob("[0-9]*"):
        try:
            state, _, own = (entry / "stat").read_text().rpartition(")")[2].split()[:3]
        except (OSError, ValueError):
            continue
        if int(own) == group and state not in "ZX":
            found.append(entry.name)
    return found


def damaged_round(job: SmallJob, seed: int) -> None:
    chance = random.Random(seed)
    shutil.rmtree(job.output, ignore_errors=True)
    victim = chance.choice(["driver", "driver", "worker", "Ctrl-C"])
    killed(job, chance.randrange(len(LINES) + 1), victim)


@pytest.mark.slow
@pytest.mark.parametrize("victim", ["driver", "Ctrl-C"])
def test_the_run_after_one_that_was_killed_goes_on(
    victim: str, tmp_path: Path, cache: Path
) -> None:
    job = small_job(tmp_path / "job", *LINES[:3])
    job.write()
    assert console("run", job.file, "--no-cache", "--workers", 1).code == 0
    undisturbed = results(job)
    shutil.rmtree(job.output)
    killed(job, 1, victim)
    ran = console("run", job.file, "--workers", 1)
    assert ran.code == 0
    assert results(job) == undisturbed
    lines = [event for event in job.log() if event["event"] == "line"]
    assert any(e["outcome"] == "known" or len(e["found"]) == 3 for e in lines)
    job.assert_tidy()
    assert not [*(cache / "store" / "tmp").glob("*")]


@pytest.mark.slow
def test_whatever_is_killed_the_bytes_are_the_same(tmp_path: Path, cache: Path) -> None:
    job = small_job(tmp_path / "job", *LINES)
    job.write()
    assert console("run", job.file, "--no-cache").code == 0
    undisturbed = results(job)
    for seed in range(100):
        if seed % 5 == 0:
            shutil.rmtree(cache, ignore_errors=True)
        damaged_round(job, seed)
        assert console("run", job.file).code == 0, seed
        assert results(job) == undisturbed, seed
        job.assert_tidy()
        assert not [*(cache / "store" / "tmp").glob("*")], seed
