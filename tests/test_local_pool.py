"""The processes of the local pool: how they start, get ready, take tasks and end."""

from __future__ import annotations

import os
import select
import signal
import subprocess
import sys
import threading
from collections import deque
from collections.abc import Generator, Iterator
from pathlib import Path

import pytest

from animeme.executors import LATER
from animeme.executors.child import Task, readable, start, uninterrupted
from animeme.executors.local import LocalExecutor
from support.jobs import PATIENCE_S
from support.patience import patience
from support.pools import results

pytestmark = pytest.mark.usefixtures("importable")


def test_a_child_gives_back_what_waits_behind_a_long_task() -> None:
    (child,) = start(1)
    tasks = [Task(index, 0.5 if index == 1 else 0.0) for index in range(5)]
    waiting = deque([Task(5, 0.0)])
    found: list[Task] = []
    with patience():
        assert child.give("support.work:rest", tasks)
        while child.tasks:
            assert readable(child.handles, PATIENCE_S)
            found += [task for task, _ in child.collect(PATIENCE_S, waiting)]
        child.end()
    assert [task.index for task in found] == [0, 1]
    assert [task.index for task in waiting] == [2, 3, 4, 5]


def test_an_abandoned_run_leaves_no_process() -> None:
    run = iter(LocalExecutor(2).run("support.work:process_id", range(9), timeout_s=60, retries=1))
    worker = next(run).value
    assert isinstance(run, Generator)
    run.close()
    with pytest.raises(ProcessLookupError):
        os.kill(worker, 0)


def test_processes_that_were_released_end_and_others_do_what_comes_after() -> None:
    with LocalExecutor(1) as pool:
        (first,) = results("process_id", ["before"], executor=pool)
        with open(os.pidfd_open(first.value)) as handle:
            pool.release()
            with patience():
                select.select([handle], [], [])
        (second,) = results("process_id", ["after"], executor=pool)
    assert (second.outcome, second.attempt) == ("ok", 1)
    assert second.value != first.value


def test_a_process_gets_ready_before_its_first_task() -> None:
    with LocalExecutor(2) as pool:
        results("double", [1], executor=pool)
        pool.get_ready("support.work:keep", "here")
        first = results("kept", range(40), executor=pool)
        pool.get_ready("support.work:keep", "there")
        second = results("kept", range(40), executor=pool)
    assert {tuple(r.value[1]) for r in first} == {("here",)}
    assert {tuple(r.value[1]) for r in second} == {("here", "there")}
    assert {r.value[0] for r in second} <= {r.value[0] for r in first}


def test_an_executor_that_keeps_no_process_has_none_get_ready() -> None:
    pool = LocalExecutor(2)
    pool.get_ready("support.work:keep", "here")
    assert [r.value[1] for r in results("kept", [1], executor=pool)] == [[]]


@pytest.mark.parametrize("how", ["exit", "kill", "quit"])
def test_a_death_while_getting_ready_is_nobodys_fault(how: str) -> None:
    with LocalExecutor(2) as pool:
        pool.get_ready("support.work:die", how)
        found = results("double", range(4), executor=pool, retries=0)
        pool.get_ready("support.work:die", how)
        found += results("double", range(4), executor=pool, retries=0)
    assert [(r.outcome, r.attempt) for r in found] == [("ok", 1)] * 8


def test_a_task_is_to_blame_for_its_own_death_when_it_should_get_ready_next() -> None:
    with LocalExecutor(1) as pool:

        def names() -> Iterator[str]:
            yield "kill"
            pool.get_ready("support.work:keep", "here")
            (child,) = pool._children
            child.process.join(PATIENCE_S)  # it is dead, and nobody has looked
            pool.get_ready("support.work:keep", "here")
            yield "good"

        with patience():
            run = pool.run("support.work:die", names(), timeout_s=PATIENCE_S, retries=0)
            found = sorted((result.index, result.outcome) for result in run)
    assert found == [(0, "crash"), (1, "ok")]


def test_processes_get_ready_between_results_without_mixing_them_up() -> None:
    items = [0.0] * 60 + [0.4] + [0.0] * 60
    found = []
    with LocalExecutor(1) as pool, patience():
        for result in pool.run("support.work:rest", items, timeout_s=PATIENCE_S, retries=0):
            pool.get_ready("support.work:keep", result.index)
            found.append((result.index, result.outcome))
    assert sorted(found) == [(index, "ok") for index in range(len(items))]


def test_processes_get_ready_while_others_die() -> None:
    with LocalExecutor(2) as pool, patience():
        found = []
        for result in pool.run(
            "support.work:die", ["good", "kill"] * 4, timeout_s=PATIENCE_S, retries=0
        ):
            pool.get_ready("support.work:keep", result.index)
            found.append((result.index, result.outcome))
    assert sorted(found) == [(n, ("ok", "crash")[n % 2]) for n in range(8)]


def test_results_that_have_come_are_given_before_the_next_item_is_looked_for() -> None:
    found: dict[int, int] = {}
    with LocalExecutor(2) as pool:

        def items() -> Iterator[object]:
            yield 1
            readable([handle for child in pool._children for handle in child.handles], PATIENCE_S)
            yield LATER
            assert found == {0: 2}
            yield 2

        with patience():
            run = pool.run("support.work:double", items(), timeout_s=PATIENCE_S, retries=0)
            for result in run:
                found[result.index] = result.value
    assert found == {0: 2, 1: 4}


def test_getting_ready_for_something_large_blocks_nobody() -> None:
    with LocalExecutor(1) as pool:

        def names() -> Iterator[str]:
            yield "bad"
            pool.get_ready("support.work:keep", "x" * 1_000_000)

        with patience():
            run = pool.run("support.work:hang", names(), timeout_s=2.0, retries=0)
            assert [result.outcome for result in run] == ["timeout"]


def test_nobody_waits_for_what_gets_ready_when_it_is_not_needed(tmp_path: Path) -> None:
    with LocalExecutor(2) as pool:
        pool.get_ready("support.work:touch_late", str(tmp_path / "late"))
    assert not [*tmp_path.iterdir()]


def test_nobody_complains_when_what_got_ready_is_not_needed() -> None:
    script = (
        "from animeme.executors.child import readable\n"
        "from animeme.executors.local import LocalExecutor\n"
        "with LocalExecutor(2) as pool:\n"
        "    pool.get_ready('support.work:keep', 'x')\n"
        "    for child in pool._children:\n"
        f"        readable(child.handles, {PATIENCE_S})\n"
        "    pool.release()\n"
        "    for child in pool._children:\n"
        f"        child.process.join({PATIENCE_S})\n"
    )
    ended = subprocess.run(
        [sys.executable, "-c", script],
        capture_output=True,
        text=True,
        timeout=PATIENCE_S,
        check=False,
    )
    assert (ended.returncode, ended.stderr) == (0, "")


def test_processes_that_never_get_ready_are_replaced() -> None:
    with LocalExecutor(2) as pool:
        pool.get_ready("support.work:hang", "never")
        found = results("double", range(4), executor=pool, timeout_s=2.0, retries=0)
    assert [(r.outcome, r.attempt) for r in found] == [("ok", 1)] * 4


def test_a_script_needs_no_guard_and_is_run_once(tmp_path: Path) -> None:
    script = tmp_path / "script.py"
    script.write_text(
        "from animeme.executors.local import LocalExecutor\n"
        "print('begins')\n"
        "run = LocalExecutor(2).run('math:sqrt', [4.0, 9.0], timeout_s=60, retries=0)\n"
        "print(sorted(result.value for result in run))\n"
    )
    ended = subprocess.run(
        [sys.executable, script], capture_output=True, text=True, timeout=PATIENCE_S, check=False
    )
    assert (ended.stdout, ended.stderr) == ("begins\n[2.0, 3.0]\n", "")


def test_a_run_leaves_the_environment_as_it_was(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("OMP_NUM_THREADS", "3")
    monkeypatch.delenv("OPENBLAS_NUM_THREADS", raising=False)
    before = dict(os.environ)
    results("double", [1])
    assert dict(os.environ) == before


def test_ctrl_c_waits_while_processes_start_whichever_thread_hears_it() -> None:
    over, reached = threading.Event(), []

    def begin() -> None:
        with uninterrupted():
            os.kill(os.getpid(), signal.SIGINT)
            over.wait(0.05)
            reached.append(signal.pthread_sigmask(signal.SIG_BLOCK, ()))

    other = threading.Thread(target=over.wait)
    other.start()
    try:
        with pytest.raises(KeyboardInterrupt):
            begin()
    finally:
        over.set()
        other.join()
    assert reached == [{signal.SIGINT}]
    assert signal.getsignal(signal.SIGINT) is signal.default_int_handler
