"""Workers that die, hang and misbehave: what it costs is the line they were at."""

from __future__ import annotations

import json
import os
import re
import select
import signal
import subprocess
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

import pytest

from support.jobs import CONSOLE, PATIENCE_S, Ran, SmallJob, console, small_job
from support.patience import patience

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

    def align(self, speech, text, *, language, lexicon=None, anchors=(), voice=None):
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
    # The line that does not hang may have ended by then.
    last = err.decode().splitlines()[-1]
    assert re.fullmatch(r"Stopped: [01] of 2 lines are done; .* goes on from there\.", last)
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
