"""What all executors keep to: every item has one result, whatever became of its worker."""

from __future__ import annotations

import multiprocessing
import os
import random
import select
import signal
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest

from animeme.executors import LATER, Executor
from animeme.executors.inline import InlineExecutor
from animeme.executors.local import LocalExecutor
from support.clusters import cluster_here, wait_for
from support.jobs import PATIENCE_S
from support.patience import patience
from support.pools import results
from support.work import Unsendable

pytestmark = pytest.mark.usefixtures("importable")


@pytest.fixture(scope="module")
def dask() -> Iterator[Executor]:
    pytest.importorskip("distributed")
    from animeme.executors.dask import DaskExecutor

    with cluster_here() as address, DaskExecutor(address) as executor:
        yield executor


@pytest.fixture(params=["inline", "one", "three", "kept", "dask"])
def executor(request: pytest.FixtureRequest) -> Iterator[Executor]:
    """Each executor; all keep one contract."""
    made: dict[str, Callable[[], Executor]] = {
        "inline": InlineExecutor,
        "one": lambda: LocalExecutor(1),
        "three": lambda: LocalExecutor(3),
        "kept": lambda: LocalExecutor(2, keeps=True),
        "dask": lambda: request.getfixturevalue("dask"),
    }
    found = made[request.param]()
    yield found
    if request.param == "kept":
        assert isinstance(found, LocalExecutor)
        found.close()


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


def test_getting_ready_changes_no_result(executor: Executor) -> None:
    executor.get_ready("support.work:refuse", "bad")
    executor.get_ready("support.work:no_such_function", None)
    found = results("double", range(5), executor=executor)
    assert [(r.outcome, r.value, r.attempt) for r in found] == [("ok", 2 * n, 1) for n in range(5)]


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
