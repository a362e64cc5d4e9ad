"""Wrong command lines: refused with what was meant to be there."""

from __future__ import annotations

import pytest

from support.bad_input import expect_refused
from support.jobs import Capture, SmallJob, animeme


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        pytest.param(("run", "JOB", "--workers", "0"), ("--workers", "x>=1"), id="no-workers"),
        pytest.param(("run", "JOB", "--workers", "two"), ("--workers", "'two'"), id="word"),
        pytest.param(("run", "JOB", "--executor", "cloud"), ("'cloud'", "inline"), id="executor"),
        pytest.param(("run", "JOB", "--fail-on", "doubt"), ("'doubt'", "warning"), id="fail-on"),
        pytest.param(("run", "JOB", "--otput", "x"), ("--otput", "--output"), id="option"),
        pytest.param(("run",), ("Missing argument 'JOB'", "--help"), id="no-job"),
        pytest.param(("rnu", "JOB"), ("'rnu'", "--help"), id="command"),
        pytest.param(("--verbos",), ("--verbos", "--help"), id="group-option"),
    ],
)
def test_a_wrong_command_line_is_refused(
    arguments: tuple[str, ...], words: tuple[str, ...], job: SmallJob, capsys: Capture
) -> None:
    file = str(job.write())
    ran = animeme(capsys, *(file if part == "JOB" else part for part in arguments))
    expect_refused(job, ran, *words)
