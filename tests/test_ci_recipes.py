"""The recipes for continuous integration, as far as they run without its servers."""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import sys
import textwrap
from pathlib import Path

import pytest

from conftest import ROOT
from support.good_delivery import Good

RECIPES = ROOT / ".ci" / "validate"


def run_step() -> str:
    """The last script of the action, which validates."""
    text = (RECIPES / "action.yml").read_text(encoding="utf-8")
    return textwrap.dedent(text.rpartition("run: |\n")[2])


@pytest.mark.slow
@pytest.mark.skipif(shutil.which("bash") is None, reason="there is no bash")
def test_the_script_of_the_action(tiny: Good, tmp_path: Path) -> None:
    broken = tmp_path / "in two words" / "broken.glb"
    broken.parent.mkdir()
    broken.write_bytes(b"glTF")
    base = {
        "PROFILE": "delivery", "FAIL_ON": "error", "SARIF": str(tmp_path / "a.sarif"),
        "DIALOGUE": "", "AGAINST": str(tiny.source), "BASELINE": "",
    }  # fmt: skip
    path = f"{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}"
    for paths, code in ((tiny.asset, 0), (f"{tiny.asset} $(touch hacked) {broken.parent}", 2)):
        ran = subprocess.run(
            ["bash", "-e", "-c", run_step()],
            env={**os.environ, **base, "PATHS": str(paths), "PATH": path},
            cwd=tmp_path,
            capture_output=True,
            timeout=60,
            check=False,
        )
        assert ran.returncode == code, ran.stderr
    assert (tmp_path / "a.sarif").is_file()
    assert not (tmp_path / "hacked").exists()


def test_recipes_name_options_that_there_are() -> None:
    from animeme.cli.validate import command

    known = {option for p in command.params for option in p.opts}
    for recipe in (*RECIPES.iterdir(), ROOT / ".pre-commit-hooks.yaml"):
        text = recipe.read_text(encoding="utf-8")
        validates = [line for line in text.splitlines() if "pip" not in line]
        assert set(re.findall(r"(?<![\w-])--[a-z-]+\b", "\n".join(validates))) <= known, recipe
