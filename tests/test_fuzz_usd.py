"""Damaged USD, seeded: written or refused, in no time, with nothing half-done left behind."""

from __future__ import annotations

import ast
import os
import re
import signal
import subprocess
import sys
from pathlib import Path

import pytest

TESTS = Path(__file__).parent


def fuzz(kind: str, seed: int, count: int, folder: Path, first: int = 0) -> dict[str, int]:
    """How `count` mutations ended; fails where one was not dealt with.

    Native code that a binary file takes down is not ours to mend: a run opens assets in workers
    first (tests/test_deadly_asset.py). Such a mutation counts as "crashed".
    """
    command = [sys.executable, "-m", "support.usd_fuzz", kind, str(seed), str(count), str(folder)]
    command.append(str(first))
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
    if kind == "usdc" and ended.returncode == -signal.SIGSEGV:
        case = int(re.findall(r"^case (\d+)$", ended.stderr, re.MULTILINE)[-1])
        rest = fuzz(kind, seed, count, folder, case + 1)
        return rest | {"crashed": rest.get("crashed", 0) + 1}
    assert ended.returncode == 0, f"{kind}, seed {seed}, exit {ended.returncode}: {tail}"
    ends: dict[str, int] = ast.literal_eval(ended.stdout.splitlines()[-1])
    assert sum(ends.values()) == count - first
    return ends


@pytest.mark.parametrize(("kind", "count"), [("usda", 60), ("usdc", 25)])
def test_a_few_damaged_files(tmp_path: Path, kind: str, count: int) -> None:
    assert {"written", "asset-unreadable"} <= set(fuzz(kind, 1, count, tmp_path))


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(10, 18))
@pytest.mark.parametrize(("kind", "count"), [("usda", 650), ("usdc", 250)])
def test_many_damaged_files(tmp_path: Path, kind: str, count: int, seed: int) -> None:
    ends = fuzz(kind, seed, count, tmp_path)
    assert ends.get("crashed", 0) <= count // 100
    assert ends.get("crashed") or min(ends["written"], ends["asset-unreadable"]) > count // 20
