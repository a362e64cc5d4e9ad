"""How far a run has come: right from the start, on one line, and when somebody stops it."""

from __future__ import annotations

import os
import re
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from animeme.cli import progress as told
from animeme.work import Progress
from support.jobs import CONSOLE, PATIENCE_S, Capture, SmallJob, console, small_job


class Clock:
    """A clock that is set by hand."""

    now = 1000.0

    def monotonic(self) -> float:
        return self.now


@pytest.fixture
def clock(monkeypatch: pytest.MonkeyPatch) -> Clock:
    clock = Clock()
    monkeypatch.setattr(told, "time", clock)
    return clock


def test_the_rate_is_that_of_the_work_done_in_this_run(clock: Clock) -> None:
    teller = told.Teller()
    assert teller.said() == ""
    teller(Progress("lines", 900, 1000, 3, 900))
    assert teller.said() == "lines: 900/1000, 3 failed", "nobody knows yet how long it takes"
    clock.now += 2
    teller(Progress("lines", 904, 1000, 3, 900))
    assert teller.said() == "lines: 904/1000, 3 failed, 2.0/s, 48 s left"
    clock.now += 2
    assert teller.said() == "lines: 904/1000, 3 failed, 1.0/s, 2 min left", "nothing ends"
    teller(Progress("lines", 1000, 1000, 4, 900))
    assert teller.said() == "lines: 1000/1000, 4 failed"
    teller(Progress("assets", 0, 8, 4))
    assert teller.said() == "assets: 0/8, 4 failed"
    clock.now += 60
    teller(Progress("assets", 1, 8, 4))
    assert teller.said() == "assets: 1/8, 4 failed, 1.0/min, 7 min left"
    assert list(teller.last) == ["lines", "assets"]


def test_the_rate_forgets_how_it_began(clock: Clock) -> None:
    teller = told.Teller()
    teller(Progress("lines", 0, 1000, 0))
    for done in range(1, 101):  # 20 s of starting up, then ten a second
        clock.now += 20.1 if done == 1 else 0.1
        teller(Progress("lines", done, 1000, 0))
    assert "3.3/s" in teller.said()
    for done in range(101, 501):
        clock.now += 0.1
        teller(Progress("lines", done, 1000, 0))
    assert "10.0/s, 50 s left" in teller.said()


@pytest.mark.parametrize(
    ("seconds", "text"),
    [(0.2, "1 s"), (59.4, "59 s"), (90, "2 min"), (3599, "1 h 00 min"), (11100, "3 h 05 min")],
)
def test_durations(seconds: float, text: str) -> None:
    assert told.duration(seconds) == text


def test_without_a_terminal_lines_go_on_while_nothing_ends(
    capsys: Capture, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(told, "PLAIN_EVERY_S", 0.01)
    with told.progress() as teller:
        teller(Progress("lines", 2, 9, 1, 2))
        teller(Progress("lines", 4, 9, 1, 2))
        until = time.monotonic() + PATIENCE_S
        err = ""
        while "left" not in err and time.monotonic() < until:
            err += capsys.readouterr().err
        teller(Progress("lines", 9, 9, 1, 2))
    err += capsys.readouterr().err
    assert err.startswith("lines: 2/9, 1 failed\n")
    assert re.search(r"lines: 4/9, 1 failed, .*/(s|min), .* left\n", err)
    assert err.endswith("lines: 9/9, 1 failed\n")


def stopped(job: SmallJob, number: int, *options: str) -> tuple[int, str]:
    """Begin a run, and send it a signal when two lines are done; how it ended, what it said."""
    command = [str(CONSOLE), "run", str(job.file), "--workers", "1", *options]
    log = job.output / "run.jsonl"
    with subprocess.Popen(
        command, stderr=subprocess.PIPE, stdout=subprocess.DEVNULL, start_new_session=True
    ) as process:
        until = time.monotonic() + PATIENCE_S
        while process.poll() is None and time.monotonic() < until:
            if log.is_file() and log.read_text(encoding="utf-8").count('"event": "line"') > 1:
                break
            time.sleep(0.005)
        os.killpg(process.pid, number)  # as a terminal does: to the workers too
        err = process.communicate(timeout=PATIENCE_S)[1].decode()
    return process.returncode, err


def test_a_ctrl_c_is_heard_though_python_ignores_it_where_things_are_thrown_away() -> None:
    script = (
        "import os, signal, time, weakref\n"
        "from animeme.cli import _prepare_process\n"
        "class Thing: pass\n"
        "for _ in range(2): _prepare_process()\n"
        "thing = Thing()\n"
        "seen = weakref.ref(thing, lambda _: os.kill(os.getpid(), signal.SIGINT))\n"
        "other = weakref.ref(thing, lambda _: 1 / 0)\n"
        "try:\n"
        "    del thing\n"
        f"    time.sleep({PATIENCE_S})\n"
        "except KeyboardInterrupt:\n"
        "    print('heard')\n"
    )
    command = [sys.executable, "-c", script]
    ended = subprocess.run(command, capture_output=True, text=True, check=False)
    assert ended.stdout == "heard\n"
    assert ended.stderr.count("Traceback") == 1, "other errors are told as ever, once"
    assert "ZeroDivisionError" in ended.stderr


@pytest.mark.slow
@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_a_run_that_is_stopped_says_what_is_done_and_the_next_goes_on(
    number: int, tmp_path: Path
) -> None:
    keys = ("en/boat", "en/five", "en/moon", "de/boat", "es/boat", "es/five")
    job = small_job(tmp_path / "job", *keys)
    job.write()
    code, err = stopped(job, number)
    assert code == 128 + number
    said = re.search(r"Stopped: (\d) of 6 lines are done; the same command goes on from there", err)
    assert said, err
    assert "Traceback" not in err
    job.assert_tidy()
    done = int(said[1])
    assert 1 <= done < 6
    ran = console("run", job.file, "--workers", 1)
    assert ran.code == 0
    known = re.search(r"(\d) of 6 lines and", ran.err)
    assert known
    assert int(known[1]) >= done
    assert set(job.statuses().values()) == {"ok"}
