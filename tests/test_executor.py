"""Executors by themselves: every item has one result, whatever became of its worker."""

from __future__ import annotations

import multiprocessing
import os
import random
import select
import signal
import subprocess
import sys
import threading
from collections import deque
from collections.abc import Generator, Iterator, Sequence
from pathlib import Path
from typing import Any

import pytest

from animeme.executors import LATER, Executor, Result
from animeme.executors.child import Task, readable, start, uninterrupted
from animeme.executors.inline import InlineExecutor
from animeme.executors.local import LocalExecutor
from support.clusters import cluster_here, wait_for
from support.jobs import PATIENCE_S
from support.patience import patience
from support.work import Unsendable

TESTS = Path(__file__).parent


@pytest.fixture(autouse=True)
def importable(monkeypatch: pytest.MonkeyPatch) -> None:
    """Let children import the tasks."""
    monkeypatch.setenv("PYTHONPATH", str(TESTS))


def results(
    function: str,
    items: Sequence[Any],
    *,
    executor: Executor | None = None,
    timeout_s: float = PATIENCE_S,
    retries: int = 1,
) -> list[Result]:
    """Results of tasks of `support.work`, by index; each item has exactly one."""
    chosen = executor or LocalExecutor(2)
    with patience():
        found = list(
            chosen.run(f"support.work:{function}", items, timeout_s=timeout_s, retries=retries)
        )
    assert sorted(result.index for result in found) == list(range(len(items)))
    return sorted(found, key=lambda result: result.index)


@pytest.fixture(scope="module")
def dask() -> Iterator[Executor]:
    pytest.importorskip("distributed")
    from animeme.executors.dask import DaskExecutor

    with cluster_here() as address, DaskExecutor(address) as executor:
        yield executor


@pytest.fixture(params=["inline", "one", "three", "dask"])
def executor(request: pytest.FixtureRequest) -> Executor:
    """Each executor; all keep one contract."""
    if request.param == "dask":
        found: Executor = request.getfixturevalue("dask")
        return found
    made: dict[str, Executor] = {
        "inline": InlineExecutor(),
        "one": LocalExecutor(1),
        "three": LocalExecutor(3),
    }
    return made[request.param]


@pytest.fixture(params=["local", "dask"])
def supervised(request: pytest.FixtureRequest) -> Executor:
    """Each executor that outlives its tasks."""
    found: Executor = (
        request.getfixturevalue("dask") if request.param == "dask" else LocalExecutor(2)
    )
    return found


def test_every_item_gives_its_value(executor: Executor) -> None:
    found = results("double", range(20), executor=executor)
    assert [result.value for result in found] == [2 * number for number in range(20)]
    assert {(r.outcome, r.error, r.attempt) for r in found} == {("ok", "", 1)}
    assert all(result.wall_s >= 0 and result.cpu_s >= 0 for result in found)


def test_no_items_give_no_results(executor: Executor) -> None:
    assert results("double", [], executor=executor) == []


def test_what_a_task_raises_becomes_its_result(executor: Executor) -> None:
    bad, good = results("refuse", ["bad", "good"], executor=executor)
    assert (bad.outcome, bad.value, bad.attempt) == ("error", None, 1)
    assert bad.error.strip().endswith("LookupError: no such thing as bad")
    assert "work.py" in bad.error
    assert (good.outcome, good.value) == ("ok", "good")


def test_a_function_that_is_not_there_is_an_error_of_every_item(executor: Executor) -> None:
    found = results("no_such_function", [1, 2], executor=executor)
    assert [result.outcome for result in found] == ["error", "error"]
    assert "no_such_function" in found[0].error


def test_one_worker_gives_results_in_order() -> None:
    with patience():
        run = LocalExecutor(1).run("support.work:double", range(9), timeout_s=60, retries=1)
        assert [result.index for result in run] == list(range(9))


@pytest.mark.parametrize("chosen", [InlineExecutor(), LocalExecutor(2)], ids=["inline", "local"])
def test_work_begins_before_all_of_it_is_known(tmp_path: Path, chosen: Executor) -> None:
    first = tmp_path / "first"

    def names() -> Iterator[str]:
        yield str(first)
        assert wait_for(first.exists, PATIENCE_S)
        yield str(tmp_path / "second")

    with patience():
        run = chosen.run("support.work:touch", names(), timeout_s=PATIENCE_S, retries=1)
        assert {(result.index, result.outcome) for result in run} == {(0, "ok"), (1, "ok")}


def test_what_says_that_the_next_may_take_a_while_is_no_item(executor: Executor) -> None:
    items = [LATER, 1, 2, LATER, LATER, 3, LATER]
    with patience():
        run = executor.run("support.work:double", items, timeout_s=PATIENCE_S, retries=1)
        assert {(result.index, result.value) for result in run} == {(0, 2), (1, 4), (2, 6)}


@pytest.mark.parametrize("chosen", [InlineExecutor(), LocalExecutor(2)], ids=["inline", "local"])
def test_results_come_in_while_the_next_item_takes_its_while(chosen: Executor) -> None:
    found: list[int] = []

    def numbers() -> Iterator[Any]:
        yield 1
        while not found:
            yield LATER
        yield 2

    with patience():
        run = chosen.run("support.work:double", numbers(), timeout_s=PATIENCE_S, retries=1)
        for result in run:
            found.append(result.value)  # noqa: PERF401  one by one, while the run goes on
    assert found == [2, 4]


def test_what_is_to_be_done_is_not_drawn_long_before(tmp_path: Path) -> None:
    drawn = 0

    def numbers() -> Iterator[int]:
        nonlocal drawn
        while drawn < 100_000:
            drawn += 1
            yield drawn

    with patience():
        run = LocalExecutor(1).run("support.work:double", numbers(), timeout_s=60, retries=1)
        assert next(iter(run)).value == 2
        assert drawn < 20_000
        run.close()  # type: ignore[attr-defined]


def test_what_cannot_be_drawn_ends_the_run_and_its_workers() -> None:
    def numbers() -> Iterator[int]:
        yield 1
        raise LookupError("no more of them")

    before = {*multiprocessing.active_children()}
    with patience(), pytest.raises(LookupError, match="no more"):
        list(LocalExecutor(2).run("support.work:process_id", numbers(), timeout_s=60, retries=1))
    assert {*multiprocessing.active_children()} <= before


def test_a_worker_does_many_tasks(supervised: Executor) -> None:
    found = results("process_id", range(20), executor=supervised)
    assert 1 <= len({result.value for result in found}) <= 2
    assert os.getpid() not in {result.value for result in found}


def test_a_hanging_task_is_given_up_after_its_retries(supervised: Executor) -> None:
    (hung,) = results("hang", ["long"], executor=supervised, timeout_s=0.5)
    assert (hung.outcome, hung.value, hung.attempt) == ("timeout", None, 2)
    assert "0.5 s" in hung.error


def test_a_hanging_task_costs_only_itself(supervised: Executor) -> None:
    items = ["good", "long", "good", "good"]
    found = results("hang", items, executor=supervised, timeout_s=3.0, retries=0)
    assert [result.outcome for result in found] == ["ok", "timeout", "ok", "ok"]


def test_others_do_not_wait_for_a_hanging_task() -> None:
    with patience():
        items = ["good", "long", "good", "good"]
        run = LocalExecutor(2).run("support.work:hang", items, timeout_s=10.0, retries=0)
        assert [result.index for result in run][-1] == 1


@pytest.mark.parametrize(
    ("how", "code"), [("exit", "7"), ("kill", str(-signal.SIGKILL)), ("quit", "4")]
)
def test_a_task_that_ends_its_process_is_tried_again_and_then_given_up(
    how: str, code: str, supervised: Executor
) -> None:
    found = results("die", ["good", how, "good", "good"], executor=supervised)
    assert [result.outcome for result in found] == ["ok", "crash", "ok", "ok"]
    assert found[1].attempt == 2
    assert found[1].error.endswith(f"exit code {code}")


@pytest.mark.parametrize("retries", [0, 2])
def test_a_crash_is_retried_as_often_as_allowed(retries: int) -> None:
    (crash,) = results("die", ["exit"], retries=retries)
    assert (crash.outcome, crash.attempt) == ("crash", retries + 1)


def test_random_kills_lose_nothing(tmp_path: Path) -> None:
    victims = set(random.Random(7).sample(range(200), 10))
    items = [(n, str(tmp_path / str(n)) if n in victims else "") for n in range(200)]
    found = results("die_once", items)
    assert [result.value for result in found] == list(range(200))
    assert {result.index for result in found if result.attempt == 2} == victims


@pytest.mark.parametrize("workers", [1, 2])
def test_a_worker_that_is_killed_between_two_tasks_costs_nothing(workers: int) -> None:
    with patience(10):
        run = iter(
            LocalExecutor(workers).run("support.work:process_id", range(3), timeout_s=60, retries=1)
        )
        first = next(run)
        with open(os.pidfd_open(first.value)) as handle:
            os.kill(first.value, signal.SIGKILL)
            select.select([handle], [], [])
        rest = list(run)
    assert [(result.outcome, result.attempt) for result in rest] == [("ok", 1), ("ok", 1)]


@pytest.mark.parametrize("item", ["unpicklable", "unloadable"])
def test_a_value_that_cannot_travel_is_an_error_of_its_item(
    item: str, supervised: Executor, capfd: pytest.CaptureFixture[str]
) -> None:
    found = results("odd_value", ["good", item, "good"], executor=supervised)
    assert [result.outcome for result in found] == ["ok", "error", "ok"]
    assert "Traceback" not in capfd.readouterr().err


def test_an_item_that_cannot_travel_is_an_error_of_its_own(
    supervised: Executor, capfd: pytest.CaptureFixture[str]
) -> None:
    items = ["good", "good", Unsendable(1, 2), *["good"] * 20]
    found = results("process_id", items, executor=supervised)
    assert [result.index for result in found if result.outcome != "ok"] == [2]
    assert (found[2].outcome, found[2].attempt) == ("error", 1)
    assert "Traceback" not in capfd.readouterr().err


def test_tasks_that_wait_behind_one_that_ends_its_process_are_not_blamed() -> None:
    items = [*["good"] * 100, "exit", *["good"] * 100]
    found = results("die", items, executor=LocalExecutor(1), retries=0)
    assert [result.index for result in found if result.outcome != "ok"] == [100]
    assert {result.attempt for result in found} == {1}


def test_tasks_that_wait_behind_one_that_hangs_are_not_blamed() -> None:
    items = [*["good"] * 100, "long", *["good"] * 100]
    found = results("hang", items, executor=LocalExecutor(1), timeout_s=2.0, retries=0)
    assert [result.index for result in found if result.outcome != "ok"] == [100]
    assert found[100].outcome == "timeout"


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


def test_getting_ready_changes_no_result(executor: Executor) -> None:
    executor.get_ready("support.work:refuse", "bad")
    executor.get_ready("support.work:no_such_function", None)
    found = results("double", range(5), executor=executor)
    assert [(r.outcome, r.value, r.attempt) for r in found] == [("ok", 2 * n, 1) for n in range(5)]


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


def test_getting_ready_for_something_large_blocks_nobody() -> None:
    with LocalExecutor(1) as pool:

        def names() -> Iterator[str]:
            yield "bad"
            pool.get_ready("support.work:keep", "x" * 1_000_000)

        with patience():
            run = pool.run("support.work:hang", names(), timeout_s=2.0, retries=0)
            assert [result.outcome for result in run] == ["timeout"]


@pytest.mark.parametrize("function", ["keep", "hang"])
def test_nobody_waits_or_complains_when_what_got_ready_is_not_needed(function: str) -> None:
    script = (
        "import time\n"
        "from animeme.executors.local import LocalExecutor\n"
        "with LocalExecutor(2) as pool:\n"
        f"    pool.get_ready('support.work:{function}', 'x')\n"
        "    time.sleep(1.5)\n"
    )
    ended = subprocess.run(
        [sys.executable, "-c", script],
        capture_output=True,
        text=True,
        timeout=PATIENCE_S,
        check=False,
        env={**os.environ, "PYTHONPATH": str(Path(__file__).parent)},
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
