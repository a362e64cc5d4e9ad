"""The recipes of docs/operations.md, as they are written there."""

from __future__ import annotations

import configparser
import os
import re
import shlex
import socket
import subprocess
from pathlib import Path

import click
import pytest

from animeme.cli import cli
from conftest import ROOT
from support.jobs import CONSOLE, PATIENCE_S, SmallJob, digests, small_job

TEXT = (ROOT / "docs" / "operations.md").read_text(encoding="utf-8")
BLOCKS = re.findall(r"^```(\w+)\n(.*?)^```", TEXT, re.MULTILINE | re.DOTALL)
SLURM = {"SLURM_ARRAY_TASK_ID": "1", "SLURM_ARRAY_TASK_COUNT": "2", "SLURM_CPUS_PER_TASK": "1"}


def script(name: str) -> str:
    """The block that follows the mention of a file."""
    found = re.search(rf"^`{re.escape(name)}`.*?^```\w+\n(.*?)^```", TEXT, re.M | re.S)
    assert found, name
    return found[1]


def commands() -> list[str]:
    """Every call of animeme in a block or in running text."""
    code = [body.replace("\\\n", " ") for kind, body in BLOCKS if kind in ("sh", "yaml", "console")]
    lines = [line for body in code for line in body.splitlines()]
    lines += re.findall(r"`(animeme [^`]+)`", TEXT.replace("\n", " "))
    found = (re.search(r"(?:^|[\s|`])animeme (\w.*)", line) for line in lines)
    calls = (m[1] for m in found if m and "pip install" not in m.string)
    return sorted({re.split(r"\s(?:2?>>?|\|\||&&|\|)\s?", call)[0] for call in calls})


@pytest.mark.parametrize("call", commands())
def test_every_command_is_one(call: str, monkeypatch: pytest.MonkeyPatch) -> None:
    for name, value in SLURM.items():
        call = call.replace(f"${name}", value)
    call = call.replace("${SCHEDULER:-tcp://farm:8786}", "tcp://farm:8786")
    words = shlex.split(call.replace("${STORE:-/mnt/farm/animeme}", "store"))
    command: click.Command = cli
    context = click.Context(cli)
    while isinstance(command, click.Group):
        found = command.get_command(context, words[0])
        assert found is not None, call
        command, words = found, words[1:]
    known = {option for p in command.params for option in (*p.opts, *p.secondary_opts)}
    assert {word.partition("=")[0] for word in words if word.startswith("--")} <= known
    if words and not words[-1].startswith("--"):  # running text may leave out arguments
        command.make_context(command.name, words)


def test_there_are_commands_to_look_at() -> None:
    assert len(commands()) > 12


def test_yaml_can_be_read() -> None:
    yaml = pytest.importorskip("yaml")
    read = [yaml.safe_load(body) for kind, body in BLOCKS if kind == "yaml"]
    assert len(read) == 3
    steps = read[0]["jobs"]["animate"]["steps"]
    assert all(("uses" in step) != ("run" in step) for step in steps)
    assert read[2]["animate"]["artifacts"]["reports"]["junit"] == "out/junit.xml"


def test_units_name_what_they_start() -> None:
    for name, section in (
        ("animeme-night.service", "Service"),
        ("animeme-night.timer", "Timer"),
        ("animeme-scheduler.service", "Service"),
        ("animeme-worker.service", "Service"),
    ):
        unit = configparser.ConfigParser(strict=name == "animeme-night.timer")
        unit.optionxform = str  # type: ignore[assignment, method-assign]
        unit.read_string(script(name))
        assert section in unit
    assert "night.sh" in script("animeme-night.service")


def put(folder: Path, name: str) -> Path:
    path = folder / name
    path.write_text(script(name), encoding="utf-8")
    return path


def sh(path: Path, **variables: str) -> subprocess.CompletedProcess[str]:
    env = {**os.environ, "PATH": f"{CONSOLE.parent}:{os.environ['PATH']}", **variables}
    return subprocess.run(
        ["/bin/sh", str(path)], cwd=path.parent, env=env, text=True, capture_output=True,
        timeout=PATIENCE_S, check=False,
    )  # fmt: skip


@pytest.fixture
def two_lines(tmp_path: Path) -> SmallJob:
    job = small_job(tmp_path / "job", "en/boat", "de/boat")
    job.write()
    return job


@pytest.mark.slow
def test_the_script_of_the_night(two_lines: SmallJob) -> None:
    night = put(two_lines.folder, "night.sh")
    good = sh(night)
    assert (good.returncode, good.stdout, good.stderr) == (0, "", "")
    assert "2 of 2 lines" not in (two_lines.folder / "night.log").read_text(encoding="utf-8")
    (two_lines.dialogue / "de/boat.txt").unlink()
    bad = sh(night)
    assert bad.returncode == 1
    assert "de/boat" in bad.stdout


def started(name: str, port: int, folder: Path) -> subprocess.Popen[bytes]:
    """A unit's command, as systemd would start it, on this machine and a port of its own."""
    unit = script(name)
    environment = dict(re.findall(r"^Environment=(\w+)=(.*)$", unit, re.M))
    (command,) = re.findall(r"^ExecStart=/opt/animeme/bin/(.*)$", unit, re.M)
    command = command.replace("farm:8786", f"127.0.0.1:{port}").replace("8786", str(port))
    command = command.replace("--nthreads 8", "--nthreads 1").replace("/var/tmp", str(folder))
    words = [str(CONSOLE.with_name("dask")), *shlex.split(command)[1:]]
    return subprocess.Popen(words, env={**os.environ, **environment}, cwd=folder)


@pytest.mark.slow
def test_the_units_and_the_script_of_a_cluster(two_lines: SmallJob, tmp_path: Path) -> None:
    pytest.importorskip("distributed")
    with socket.create_server(("127.0.0.1", 0)) as server:
        port = server.getsockname()[1]
    units = ("animeme-scheduler.service", "animeme-worker.service")
    services = [started(name, port, tmp_path) for name in units]
    try:
        address, store = f"tcp://127.0.0.1:{port}", str(tmp_path / "farm")
        ended = sh(put(two_lines.folder, "farm.sh"), SCHEDULER=address, STORE=store)
        assert ended.returncode == 0, ended.stderr
    finally:
        for service in reversed(services):
            service.terminate()
            service.wait(PATIENCE_S)
    assert set(two_lines.statuses().values()) == {"ok"}


@pytest.mark.slow
def test_the_scripts_of_the_farm(two_lines: SmallJob, tmp_path: Path) -> None:
    shard, merge = put(two_lines.folder, "shard.sh"), put(two_lines.folder, "merge.sh")
    store = str(tmp_path / "farm")
    for number in ("1", "2"):
        ended = sh(shard, STORE=store, **{**SLURM, "SLURM_ARRAY_TASK_ID": number})
        assert ended.returncode == 0, ended.stderr
        assert not two_lines.output.exists()
    ended = sh(merge, STORE=store, **SLURM)
    assert ended.returncode == 0
    assert "2 of 2 lines" in ended.stderr
    merged = digests(two_lines.output)
    alone = subprocess.run(
        [CONSOLE, "run", two_lines.file, "--no-cache", "--workers", "1"], check=False
    )
    assert alone.returncode == 0
    whole = digests(two_lines.output)
    del merged["run.jsonl"], whole["run.jsonl"]
    assert merged == whole
