"""The command line explains itself: help, version and tracebacks."""

from __future__ import annotations

from importlib.metadata import version
from pathlib import Path

import pytest

from animeme.cli import _COMMANDS
from support.jobs import Capture, animeme


@pytest.mark.parametrize("flag", ["-h", "--help"])
@pytest.mark.parametrize("command", sorted(_COMMANDS))
def test_every_command_explains_itself_with_an_example(
    command: str, flag: str, capsys: Capture
) -> None:
    ran = animeme(capsys, command, flag)
    assert ran.code == 0
    assert f"Usage: animeme {command}" in ran.out
    assert f"Example: animeme {command} " in " ".join(ran.out.split())
    assert "--json" in ran.out
    assert ran.err == ""


def test_help_lists_every_command_and_exit_code(capsys: Capture) -> None:
    ran = animeme(capsys, "--help")
    assert ran.code == 0
    for command in _COMMANDS:
        assert f"\n  {command} " in ran.out
    assert "Exit codes: 0 all well; 1 done, but" in " ".join(ran.out.split())


def test_without_a_command_help_is_shown(capsys: Capture) -> None:
    ran = animeme(capsys)
    ran.says()
    assert ran.code == 2
    assert "Usage: animeme" in ran.out + ran.err
    assert "Commands:" in ran.out + ran.err


def test_version_is_the_distributions(capsys: Capture) -> None:
    ran = animeme(capsys, "--version")
    assert (ran.code, ran.out.strip()) == (0, f"animeme, version {version('animeme')}")


def test_a_traceback_is_shown_only_to_who_asks(tmp_path: Path, capsys: Capture) -> None:
    missing = tmp_path / "missing.toml"
    animeme(capsys, "run", missing).says("no such job file")
    ran = animeme(capsys, "--debug", "run", missing)
    assert ran.code == 2
    assert "Traceback" in ran.err
