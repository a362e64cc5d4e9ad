"""Runs on a Dask cluster: who may take part, and what is said when nobody can."""

from __future__ import annotations

import os
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

import animeme
from animeme.errors import InputError
from animeme.executors import crew, processes
from support.clusters import Cluster, children, cluster_here, wait_for
from support.jobs import Capture, SmallJob, console, digests, small_job
from support.jobs import animeme as command
from support.patience import patience

pytest.importorskip("distributed")

from animeme.executors.dask import DaskExecutor


@pytest.fixture(scope="module")
def address() -> Iterator[str]:
    with cluster_here() as address:
        yield address


def refusal(executor: DaskExecutor) -> InputError:
    with pytest.raises(InputError) as refused:
        list(executor.run("support.work:double", [1], timeout_s=60, retries=0))
    assert executor._client is None
    return refused.value


def results(job: SmallJob, output: Path) -> dict[str, str]:
    found = digests(output)
    del found["run.jsonl"]
    return found


def test_without_dask_a_run_says_what_to_install(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "distributed", None)
    error = refusal(DaskExecutor())
    assert (error.code, error.place) == ("extra-missing", "--executor dask")
    assert "pip install 'animeme[dask]'" in error.action


@pytest.mark.parametrize(
    ("options", "words"),
    [
        (("--scheduler", "tcp://a:1"), "--executor dask"),
        (("--executor", "dask", "--scheduler", "tcp://a:1", "--workers", "2"), "--workers"),
        (("--workers", "2", "--scheduler", "tcp://a:1", "--executor", "dask"), "--workers"),
        (("--executor", "dask", "--shard", "1/2"), "--shard"),
    ],
)
def test_options_that_do_not_go_together_are_refused(
    options: tuple[str, ...], words: str, job: SmallJob, capsys: Capture
) -> None:
    ran = command(capsys, "run", job.write(), *options)
    ran.says(words)
    assert ran.code == 2


@pytest.mark.parametrize(
    "arguments",
    [{"executor": "slurm"}, {"scheduler": "tcp://a:1"}, {"executor": "dask", "shard": "1/2"}],
)
def test_arguments_that_make_no_sense_are_refused(arguments: dict[str, str], job: SmallJob) -> None:
    with pytest.raises(ValueError, match=r"executor|scheduler|shard"):
        animeme.run(job.write(), **arguments)  # type: ignore[arg-type]


@pytest.mark.parametrize("where", ["tcp://127.0.0.1:9", "127.0.0.1:9"])
def test_a_scheduler_that_does_not_answer_is_named(where: str) -> None:
    error = refusal(DaskExecutor(where, patience_s=0.1))
    assert (error.code, error.place) == ("scheduler-away", where)


@pytest.mark.parametrize("where", ["carrier-pigeon://loft:1", "tcp://127.0.0.1"])
def test_an_address_that_is_none_is_named(where: str) -> None:
    error = refusal(DaskExecutor(where, patience_s=0.1))
    assert (error.code, error.place) == ("scheduler-away", where)
    assert "address" in error.problem


def test_a_worker_with_other_code_is_refused(address: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(crew, "code_digest", lambda folder="": "what nobody has")
    error = refusal(DaskExecutor(address))
    assert error.code == "worker-code"
    assert error.place.startswith("Dask worker tcp://")


def test_a_worker_that_sees_other_files_is_refused(
    address: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(crew, "SEEN_WITHIN_S", 0.0)
    monkeypatch.setattr(crew, "code_digest", lambda folder="": "not asked for yet")
    monkeypatch.setattr(crew, "_sees", lambda path, digest: path != str(tmp_path / "job.toml"))
    (tmp_path / "job.toml").touch()
    (tmp_path / "store").mkdir()
    marks = [tmp_path / "store" / "mark"]
    error = refusal(DaskExecutor(address, sees=[tmp_path / "job.toml"], marks=marks))
    assert error.code == "worker-blind"
    assert str(tmp_path / "job.toml") in error.problem
    assert not marks[0].exists()


@pytest.mark.slow
def test_processes_that_are_at_rest_for_long_end_and_come_back(
    address: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(processes, "IDLE_S", 1.0)
    monkeypatch.setenv("PYTHONPATH", str(Path(__file__).parent), prepend=os.pathsep)
    with DaskExecutor(address) as executor:
        for _ in range(2):
            ran = executor.run("support.work:double", [1], timeout_s=60, retries=0)
            assert [result.value for result in ran] == [2]
            assert children(os.getpid())  # the cluster is in this process
            assert wait_for(lambda: not children(os.getpid()), 30)


@pytest.mark.slow
def test_a_worker_without_the_files_is_refused_and_one_with_them_does_the_same(
    tmp_path: Path,
) -> None:
    blind = ["unshare", "--mount", "sh", "-c", 'mount -t tmpfs none "$0" && exec "$@"']
    job = small_job(tmp_path / "job", "en/boat", "de/five")
    job.write()
    wrap = [[], [*blind, str(job.folder)]]
    if subprocess.run([*wrap[1], "true"], check=False).returncode:
        pytest.skip("no mount namespaces here")
    options = ("run", job.file, "--executor", "dask", "--scheduler")
    with Cluster(tmp_path / "cluster", {}, workers=1, wrap=wrap) as cluster:
        ran = console(*options, cluster.address)
    ran.says("Dask worker tcp://", "does not see", str(job.folder), "worker-blind")
    assert ran.code == 2
    with Cluster(tmp_path / "cluster", {}, workers=1) as cluster:
        assert console(*options, cluster.address).code == 0
    assert console("run", job.file, "--no-cache", "--output", tmp_path / "local").code == 0
    assert results(job, job.output) == results(job, tmp_path / "local")


@pytest.mark.slow
def test_a_worker_that_may_start_no_processes_is_refused(tmp_path: Path) -> None:
    job = small_job(tmp_path / "job", "en/boat")
    nanny = {"DASK_DISTRIBUTED__WORKER__DAEMON": "True"}
    with Cluster(tmp_path / "cluster", nanny, workers=1, nanny=True) as cluster:
        ran = console("run", job.write(), "--executor", "dask", "--scheduler", cluster.address)
    ran.says("DASK_DISTRIBUTED__WORKER__DAEMON=False", "--no-nanny")
    assert ran.code == 2


@pytest.mark.slow
def test_a_cluster_of_this_machine_does_the_same(tmp_path: Path) -> None:
    job = small_job(tmp_path / "job", "en/boat", "de/five")
    job.write()
    ran = console("run", job.file, "--executor", "dask", "--workers", 2)
    assert (ran.code, "Traceback" in ran.err) == (0, False)
    assert console("run", job.file, "--no-cache", "--output", tmp_path / "local").code == 0
    assert results(job, job.output) == results(job, tmp_path / "local")


@pytest.mark.slow
@pytest.mark.parametrize(("part", "code"), [(0, "scheduler-away"), (1, "worker-away")])
def test_when_nobody_comes_back_a_run_says_how_far_it_came(
    part: int, code: str, tmp_path: Path
) -> None:
    path = (str(Path(__file__).parent), os.environ.get("PYTHONPATH", ""))
    env = {"PYTHONPATH": os.pathsep.join(path)}
    with Cluster(tmp_path, env, workers=1) as cluster, patience(120):
        executor = DaskExecutor(cluster.address, patience_s=20.0)
        items = ["good", "good", "long"]
        run = executor.run("support.work:hang", items, timeout_s=600, retries=0)
        assert [next(run).value, next(run).value] == ["good", "good"]
        cluster.kill(part)
        with pytest.raises(InputError) as lost:
            next(run)
    assert (lost.value.code, lost.value.place) == (code, cluster.address)
    assert "for 20 s" in lost.value.problem
    assert "2 of 3 tasks are done; run again" in lost.value.action
