"""Damaged USD, seeded: written or refused, in no time, with nothing half-done left behind."""

from __future__ import annotations

import ast
import os
import subprocess
import sys
from pathlib import Path

import pytest

TESTS = Path(__file__).parent


def fuzz(kind: str, seed: int, count: int, folder: Path) -> dict[str, int]:
    """How `count` mutations ended; fails where one was not dealt with."""
    command = [sys.executable, "-m", "support.usd_fuzz", kind, str(seed), str(count), str(folder)]
    path = os.pathsep.join([str(TESTS), *sys.path])
    ended = subprocess.run(
        command,
        env={**os.environ, "PYTHONPATH": path},
        capture_output=True,
        text=True,
        errors="replace",
        check=False,
    )
    tail = ended.stderr[-3000:]
    assert ended.returncode == 0, f"{kind}, seed {seed}, exit {ended.returncode}: {tail}"
    ends: dict[str, int] = ast.literal_eval(ended.stdout.splitlines()[-1])
    assert sum(ends.values()) == count
    return ends


@pytest.mark.parametrize(("kind", "count"), [("usda", 110), ("usdc", 40)])
def test_a_few_damaged_files(tmp_path: Path, kind: str, count: int) -> None:
    assert {"written", "asset-unreadable"} <= set(fuzz(kind, 1, count, tmp_path))


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(10, 18))
@pytest.mark.parametrize(("kind", "count"), [("usda", 650), ("usdc", 250)])
def test_many_damaged_files(tmp_path: Path, kind: str, count: int, seed: int) -> None:
    ends = fuzz(kind, seed, count, tmp_path)
    assert min(ends["written"], ends["asset-unreadable"]) > count // 20
