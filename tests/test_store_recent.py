"""Lines that are known by what their files look like, and what is noticed all the same."""

from __future__ import annotations

import os
import sqlite3
import time
from collections.abc import Callable
from pathlib import Path

import pytest

from support.bad_input import BAD, GOOD
from support.jobs import Capture, SmallJob, run_inline
from support.stores import EVERY_STEP, made


def looks(cache: Path) -> dict[str, bool]:
    """Line → whether the next run may know it by what it looks like."""
    with sqlite3.connect(next(cache.rglob("*.sqlite"))) as database:
        rows = database.execute("SELECT name, seen FROM recent WHERE scope LIKE 'lines of %'")
        return {name: bool(seen) for name, seen in rows}


@pytest.fixture
def settled(job: SmallJob, cache: Path, capsys: Capture) -> SmallJob:
    """A job that was run since its files are old enough to be told by their looks."""
    for _ in range(5):
        assert run_inline(capsys, job).code == 0
        if all(looks(cache).values()):
            return job
        time.sleep(0.5)
    pytest.fail("files do not settle")


def test_a_line_stays_known_run_after_run(settled: SmallJob, cache: Path, capsys: Capture) -> None:
    job = settled
    for _ in range(3):
        assert run_inline(capsys, job).code == 0
        assert made(job) == {GOOD: set(), BAD: set()}
        assert looks(cache) == {GOOD: True, BAD: True}


def other_text(job: SmallJob) -> None:
    """Change a transcript, neither its size nor its time."""
    path = job.dialogue / f"{BAD}.txt"
    was = path.stat()
    path.write_text(path.read_text(encoding="utf-8").replace("fine", "five", 1), encoding="utf-8")
    os.utime(path, ns=(was.st_atime_ns, was.st_mtime_ns))
    assert path.stat().st_size == was.st_size


def other_recording(job: SmallJob) -> None:
    path = job.dialogue / f"{BAD}.wav"
    data = bytearray(path.read_bytes())
    data[4001] ^= 1
    path.write_bytes(data)


def timings_beside(job: SmallJob) -> None:
    alignment = job.output / f"alignments/{BAD}.json"
    (job.dialogue / f"{BAD}.json").write_bytes(alignment.read_bytes())


@pytest.mark.parametrize("change", [other_text, other_recording, timings_beside])
def test_a_change_of_a_file_is_noticed(
    change: Callable[[SmallJob], None], settled: SmallJob, capsys: Capture
) -> None:
    change(settled)
    run_inline(capsys, settled)
    again = made(settled)
    assert again[GOOD] == set()
    assert again[BAD]
    assert again[BAD] <= EVERY_STEP


def test_what_was_delivered_is_put_back(settled: SmallJob, capsys: Capture) -> None:
    job = settled
    alignment = job.output / f"alignments/{BAD}.json"
    sound = alignment.read_bytes()
    alignment.write_bytes(sound.replace(b"1", b"2"))
    assert run_inline(capsys, job).code == 0
    assert made(job) == {GOOD: set(), BAD: set()}
    assert alignment.read_bytes() == sound
