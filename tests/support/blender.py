"""Blender as an independent judge, where there is one.

It is no dependency: `bpy` is a gigabyte, wants one exact version of Python, and a NumPy that is
too old for us. So it has an environment of its own, by ``make blender``, or the one whose Python
``ANIMEME_BLENDER_PYTHON`` names.
"""

from __future__ import annotations

import json
import os
import subprocess
from dataclasses import asdict, dataclass
from pathlib import Path

import pytest

READER = Path(__file__).with_name("blender_reader.py")
PYTHON = Path(__file__).parents[2] / ".venv-blender" / "bin" / "python"
Values = dict[str, dict[str, list[float]]]


@dataclass(frozen=True)
class Request:
    """What Blender is asked: one file, one of its animations (glTF), and when."""

    file: str
    times_s: list[float]
    rate_hz: float
    animation: str = ""


def shape_keys(requests: list[Request], folder: Path) -> list[Values]:
    """Object → shape key → its value at each time, for each request; skips without Blender.

    Of a glTF, an object is called after its node, "/nodes/3", a key after the index of its target.
    """
    results = answers(requests, folder)
    assert [result for result in results if isinstance(result, str)] == []
    return [result for result in results if not isinstance(result, str)]


def answers(requests: list[Request], folder: Path) -> list[Values | str]:
    """The same, with the sentence in which Blender says why it cannot import a file."""
    python = os.environ.get("ANIMEME_BLENDER_PYTHON") or str(PYTHON)
    if not Path(python).is_file():
        pytest.skip("no Blender: run `make blender`, or name a Python in ANIMEME_BLENDER_PYTHON")
    asked, answered = folder / "requests.json", folder / "results.json"
    asked.write_text(json.dumps([asdict(request) for request in requests]), "utf-8")
    command = [python, "-I", str(READER), str(asked), str(answered)]
    ended = subprocess.run(command, capture_output=True, text=True, errors="replace", check=False)
    assert answered.is_file(), ended.stderr[-2000:] + ended.stdout[-2000:]
    results: list[Values | str] = json.loads(answered.read_text("utf-8"))
    return results
