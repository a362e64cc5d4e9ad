"""Workers that die, hang and misbehave: what it costs is the line they were at."""

from __future__ import annotations

import json
import os
import random
import select
import signal
import subprocess
from collections.abc import Generator, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pytest

from animeme.executors import Executor, Result
from animeme.executors.inline import InlineExecutor
from animeme.executors.local import LocalExecutor
from support.jobs import CONSOLE, PATIENCE_S, Ran, SmallJob, console, small_job

TESTS = Path(__file__).parent

# --- a studio's plug-in, and the runs it is in --------------------------------------------------

STUDIO = '''
"""An aligner that does to its process what the line's name says."""

import os
import resource
import signal
import time

from animeme_stages.align.aligner import PocketSphinxAligner

resource.setrlimit(resource.RLIMIT_CORE, (0, 0))


class Deadly(PocketSphinxAligner):
    name = "deadly"

    def align(self, speech, text, *, language, lexicon=None, anchors=()):
        kind = speech.source.stem
        if kind == "exits":
            os._exit(7)
        if kind == "aborts":
            os.abort()
        if kind == "is-killed":
            os.kill(os.getpid(), signal.SIGKILL)
        if kind == "quits":
            raise SystemExit(0)
        if kind == "raises":
            raise LookupError("the studio's [/server] is away")
        if kind == "prints":
            print("the studio says hello")
        if kind == "hangs":
            with open(os.environ["FAKE_STUDIO_FIFO"], "w") as fifo:
                fifo.write("hanging")
            time.sleep(3600)
        return super().align(
            speech, text, language=language, lexicon=lexicon, anchors=anchors
        )
'''
BROKEN = 'raise RuntimeError("the licence server is down")\n'


def studio(folder: Path, name: str, entry_points: str, modules: dict[str, str]) -> Path:
    """A distribution as pip would have installed it into `folder`."""
    info = folder / f"{name.replace('-', '_')}-1.0.dist-info"
    info.mkdir(parents=True)
    (info / "METADATA").write_text(f"Metadata-Version: 2.1\nName: {name}\nVersion: 1.0\n")
    (info / "RECORD").touch()
    (info / "entry_points.txt").write_text(entry_points)
    for module, text in modules.items():
        (folder / f"{module}.py").write_text(text)
    return folder


@pytest.fixture(scope="session")
def fake_studio(tmp_path_factory: pytest.TempPathFactory) -> Path:
    entry_points = (
        "[animeme.aligners]\ndeadly = fake_studio:Deadly\nbroken = fake_studio_broken:Nothing\n"
    )
    modules = {"fake_studio": STUDIO, "fake_studio_broken": BROKEN}
    return studio(tmp_path_factory.mktemp("site"), "fake-studio", entry_points, modules)


def deadly_job(folder: Path, *lines: str, aligner: str = "deadly") -> SmallJob:
    """A job with one sound line and one of each name in `lines`."""
    job = small_job(folder, "en/boat")
    for line in lines:
        job.line(f"en/{line}")
    job.sections["align"] = {"aligner": aligner}
    job.write()
    return job


def group_members(group: int) -> list[int]:
    """Living processes of a process group."""
    members = []
    for entry in Path("/proc").iterdir():
        try:
            # The name in parentheses may hold anything; state, parent and group follow it.
            state, _, own = (entry / "stat").read_text().rpartition(")")[2].split()[:3]
        except (OSError, ValueError):
            continue
        if entry.name.isdigit() and int(own) == group and state not in "ZX":
            members.append(int(entry.name))
    return members


def assert_all_end(group: int) -> None:
    """Every process of a group ends by itself."""
    try:
        for process in group_members(group):
            try:
                handle = os.pidfd_open(process)
            except ProcessLookupError:
                continue
            with open(handle):
                ended, _, _ = select.select([handle], [], [], 5)
            assert ended, f"process {process} outlives its run"
    finally:
        if group_members(group):
            os.killpg(group, signal.SIGKILL)


@contextmanager
def started(*arguments: object, env: dict[str, str]) -> Iterator[subprocess.Popen[bytes]]:
    """The console script, as the leader of a process group that is empty afterwards."""
    process = subprocess.Popen(
        [CONSOLE, *map(str, arguments)],
        env={**os.environ, **env},
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        start_new_session=True,
    )
    with process:
        try:
            yield process
        finally:
            process.kill()
            assert_all_end(process.pid)


def supervised(*arguments: object, env: dict[str, str]) -> Ran:
    """Run the console script to its end, and see that no process outlives it."""
    with started(*arguments, env=env) as process:
        out, err = process.communicate(timeout=PATIENCE_S)
    return Ran(process.returncode, out.decode(), err.decode())


@dataclass(frozen=True)
class Disaster:
    job: SmallJob
    ran: Ran


@pytest.fixture(scope="session")
def disaster(tmp_path_factory: pytest.TempPathFactory, fake_studio: Path) -> Disaster:
    """One run in which workers die in every way."""
    lines = ("aborts", "exits", "is-killed", "quits", "raises", "well")
    job = deadly_job(tmp_path_factory.mktemp("disaster") / "job", *lines)
    before = job.sources()
    ran = supervised("run", job.file, "--workers", 2, env={"PYTHONPATH": str(fake_studio)})
    assert job.sources() == before
    return Disaster(job, ran)


def test_a_run_whose_workers_die_does_the_other_lines(disaster: Disaster) -> None:
    job = disaster.job
    assert job.animations() == {"boat", "well"}
    good = [line for line, status in job.statuses().items() if status == "ok"]
    assert good == ["en/boat", "en/well"]
    assert sorted(path.stem for path in job.output.glob("alignments/en/*")) == ["boat", "well"]
    job.assert_tidy()


def test_a_run_whose_workers_die_ends_as_a_fault_of_ours(disaster: Disaster) -> None:
    assert disaster.ran.code == 3
    assert disaster.job.report()["exit_code"] == 3


def test_a_run_whose_workers_die_tells_people_which_lines_it_lost(disaster: Disaster) -> None:
    disaster.ran.says("en/aborts", "en/exits", "en/is-killed", "en/quits", "en/raises")
    disaster.ran.says("exit code 7", "the studio's [/server] is away", "run.jsonl")


@pytest.mark.parametrize("line", ["aborts", "exits", "is-killed", "quits"])
def test_a_line_that_kills_its_worker_fails_after_a_second_try(
    line: str, disaster: Disaster
) -> None:
    (finding,) = disaster.job.findings(f"en/{line}")
    assert finding["code"] == "worker-crash"
    assert finding["ours"]
    assert finding["place"].endswith(f"{line}.wav")
    assert "run.jsonl" in finding["action"]
    (event,) = [e for e in disaster.job.log() if e.get("line") == f"en/{line}"]
    assert (event["outcome"], event["attempt"], event["status"]) == ("crash", 2, "failed")


def test_a_line_whose_plugin_raises_fails_at_once(disaster: Disaster) -> None:
    (finding,) = disaster.job.findings("en/raises")
    assert finding["code"] == "worker-error"
    assert finding["ours"]
    assert "LookupError: the studio's [/server] is away" in finding["message"]
    (event,) = [e for e in disaster.job.log() if e.get("line") == "en/raises"]
    assert (event["outcome"], event["attempt"]) == ("error", 1)
    assert "fake_studio.py" in event["error"]


def test_without_workers_a_plugin_that_quits_fails_its_line(
    tmp_path: Path, fake_studio: Path
) -> None:
    job = deadly_job(tmp_path / "job", "quits")
    ran = console("run", job.file, "--executor", "inline", env={"PYTHONPATH": str(fake_studio)})
    ran.says("en/quits")
    assert ran.code == 3
    assert job.statuses() == {"en/boat": "ok", "en/quits": "failed"}


def test_what_a_plugin_prints_stays_out_of_the_json(tmp_path: Path, fake_studio: Path) -> None:
    job = deadly_job(tmp_path / "job", "prints")
    ran = supervised("run", job.file, "--json", env={"PYTHONPATH": str(fake_studio)})
    assert ran.code == 0
    assert json.loads(ran.out)["job"] == "small"
    assert "the studio says hello" in ran.err


def test_a_plugin_that_cannot_be_loaded_stops_the_run_before_it_starts(
    tmp_path: Path, fake_studio: Path
) -> None:
    job = deadly_job(tmp_path / "job", aligner="broken")
    env = {"PYTHONPATH": str(fake_studio)}
    ran = supervised("run", job.file, env=env)
    ran.says("'broken'", "fake-studio", "RuntimeError: the licence server is down", "Mend")
    assert ran.code == 2
    assert not job.output.exists()

    job.sections["align"] = {"aligner": "deadly"}
    assert supervised("run", job.write(), env=env).code == 0


def test_a_plugin_that_nobody_asks_for_may_be_broken(tmp_path: Path, fake_studio: Path) -> None:
    job = deadly_job(tmp_path / "job", aligner="pocketsphinx")
    assert supervised("run", job.file, env={"PYTHONPATH": str(fake_studio)}).code == 0


def test_doctor_names_the_distribution_whose_plugin_is_broken(fake_studio: Path) -> None:
    ran = console("doctor", "--json", env={"PYTHONPATH": str(fake_studio)})
    assert ran.code == 3
    plugins = {plugin["name"]: plugin for plugin in json.loads(ran.out)["plugins"]}
    assert plugins["broken"]["distribution"] == "fake-studio"
    assert "the licence server is down" in plugins["broken"]["problem"]
    assert plugins["deadly"]["problem"] == ""


def test_two_distributions_that_claim_one_name_are_both_named(
    tmp_path: Path, fake_studio: Path
) -> None:
    other = studio(
        tmp_path / "site",
        "rival-studio",
        "[animeme.aligners]\ndeadly = rival:Deadly\n",
        {"rival": "class Deadly: ..."},
    )
    job = deadly_job(tmp_path / "job")
    ran = supervised("run", job.file, env={"PYTHONPATH": f"{fake_studio}:{other}"})
    ran.says("'deadly'", "fake-studio", "rival-studio", "Uninstall one")
    assert ran.code == 2
    assert not job.output.exists()


@contextmanager
def hanging_run(folder: Path, site: Path) -> Iterator[tuple[SmallJob, subprocess.Popen[bytes]]]:
    """A run of which one worker hangs in a line right now."""
    job = deadly_job(folder / "job", "hangs")
    fifo = folder / "fifo"
    os.mkfifo(fifo)
    env = {"PYTHONPATH": str(site), "FAKE_STUDIO_FIFO": str(fifo)}
    with started("run", job.file, "--workers", 2, env=env) as process:
        with patience():  # nobody writes if the run ends before the line hangs
            assert fifo.read_text() == "hanging"
        yield job, process


def test_a_run_that_is_interrupted_stops_at_once_and_tidies_up(
    tmp_path: Path, fake_studio: Path
) -> None:
    """Ctrl-C goes to the whole process group."""
    with hanging_run(tmp_path, fake_studio) as (job, process):
        os.killpg(process.pid, signal.SIGINT)
        _, err = process.communicate(timeout=PATIENCE_S)
    assert process.returncode == 130
    assert err.decode().splitlines()[-1] == "Stopped."
    assert "Traceback" not in err.decode()
    job.assert_tidy()


def test_a_run_that_is_terminated_stops_at_once_and_tidies_up(
    tmp_path: Path, fake_studio: Path
) -> None:
    """Schedulers and CI end what takes too long with SIGTERM."""
    with hanging_run(tmp_path, fake_studio) as (job, process):
        process.terminate()
        process.wait(timeout=PATIENCE_S)
        assert_all_end(process.pid)
    assert process.returncode in (128 + signal.SIGTERM, -signal.SIGTERM)
    job.assert_tidy()


def test_the_workers_of_a_killed_run_end_with_it(tmp_path: Path, fake_studio: Path) -> None:
    with hanging_run(tmp_path, fake_studio) as (_, process):
        process.kill()
        process.wait(timeout=PATIENCE_S)
        assert_all_end(process.pid)


# --- the executor by itself ---------------------------------------------------------------------


@pytest.fixture(autouse=True)
def importable(monkeypatch: pytest.MonkeyPatch) -> None:
    """Let children import the tasks."""
    monkeypatch.setenv("PYTHONPATH", str(TESTS))


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


EXECUTORS = [
    pytest.param(InlineExecutor(), id="inline"),
    pytest.param(LocalExecutor(1), id="one"),
    pytest.param(LocalExecutor(3), id="three"),
]


@pytest.mark.parametrize("executor", EXECUTORS)
def test_every_item_gives_its_value(executor: Executor) -> None:
    found = results("double", range(20), executor=executor)
    assert [result.value for result in found] == [2 * number for number in range(20)]
    assert {(r.outcome, r.error, r.attempt) for r in found} == {("ok", "", 1)}
    assert all(result.wall_s >= 0 and result.cpu_s >= 0 for result in found)


@pytest.mark.parametrize("executor", EXECUTORS)
def test_no_items_give_no_results(executor: Executor) -> None:
    assert results("double", [], executor=executor) == []


@pytest.mark.parametrize("executor", EXECUTORS)
def test_what_a_task_raises_becomes_its_result(executor: Executor) -> None:
    bad, good = results("refuse", ["bad", "good"], executor=executor)
    assert (bad.outcome, bad.value, bad.attempt) == ("error", None, 1)
    assert bad.error.strip().endswith("LookupError: no such thing as bad")
    assert "work.py" in bad.error
    assert (good.outcome, good.value) == ("ok", "good")


@pytest.mark.parametrize("executor", EXECUTORS)
def test_a_function_that_is_not_there_is_an_error_of_every_item(executor: Executor) -> None:
    found = results("no_such_function", [1, 2], executor=executor)
    assert [result.outcome for result in found] == ["error", "error"]
    assert "no_such_function" in found[0].error


def test_one_worker_gives_results_in_order() -> None:
    with patience():
        run = LocalExecutor(1).run("support.work:double", range(9), timeout_s=60, retries=1)
        assert [result.index for result in run] == list(range(9))


def test_a_worker_does_many_tasks() -> None:
    found = results("process_id", range(20))
    assert 1 <= len({result.value for result in found}) <= 2
    assert os.getpid() not in {result.value for result in found}


def test_a_hanging_task_is_given_up_after_its_retries() -> None:
    (hung,) = results("hang", ["long"], timeout_s=0.5)
    assert (hung.outcome, hung.value, hung.attempt) == ("timeout", None, 2)
    assert "0.5 s" in hung.error


def test_a_hanging_task_costs_only_itself() -> None:
    found = results("hang", ["good", "long", "good", "good"], timeout_s=3.0, retries=0)
    assert [result.outcome for result in found] == ["ok", "timeout", "ok", "ok"]


@pytest.mark.parametrize(
    ("how", "code"), [("exit", "7"), ("kill", str(-signal.SIGKILL)), ("quit", "4")]
)
def test_a_task_that_ends_its_process_is_tried_again_and_then_given_up(how: str, code: str) -> None:
    found = results("die", ["good", how, "good", "good"])
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
    item: str, capfd: pytest.CaptureFixture[str]
) -> None:
    found = results("odd_value", ["good", item, "good"])
    assert [result.outcome for result in found] == ["ok", "error", "ok"]
    assert "Traceback" not in capfd.readouterr().err


def test_an_abandoned_run_leaves_no_process() -> None:
    run = iter(LocalExecutor(2).run("support.work:process_id", range(9), timeout_s=60, retries=1))
    worker = next(run).value
    assert isinstance(run, Generator)
    run.close()
    with pytest.raises(ProcessLookupError):
        os.kill(worker, 0)


def test_a_run_leaves_the_environment_as_it_was(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("OMP_NUM_THREADS", "3")
    monkeypatch.delenv("OPENBLAS_NUM_THREADS", raising=False)
    before = dict(os.environ)
    results("double", [1])
    assert dict(os.environ) == before
