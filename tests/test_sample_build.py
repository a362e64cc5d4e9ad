"""The sample is what its code builds, byte for byte."""

from __future__ import annotations

import importlib.util
import os
import subprocess
import sys
from pathlib import Path

import pytest

from conftest import SAMPLE

ESPEAK = importlib.util.find_spec("espeakng_loader") is not None


@pytest.mark.parametrize(
    "part",
    [
        "ada",
        "crab",
        pytest.param(
            "dialogue",
            marks=pytest.mark.skipif(not ESPEAK, reason="needs the extra 'espeak'"),
        ),
    ],
)
def test_a_new_build_gives_the_committed_bytes(part: str, tmp_path: Path) -> None:
    """In a process of its own with a hash seed of its own."""
    command = [sys.executable, str(SAMPLE / "build.py"), "--only", part, "--output", str(tmp_path)]
    subprocess.run(command, check=True, env={**os.environ, "PYTHONHASHSEED": "4711"})
    built = [path for path in sorted(tmp_path.rglob("*")) if path.is_file()]
    assert len(built) == (36 if part == "dialogue" else 2)
    for path in built:
        committed = SAMPLE / path.relative_to(tmp_path)
        assert path.read_bytes() == committed.read_bytes(), (
            f"{committed} is not what build.py makes"
        )
