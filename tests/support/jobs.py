"""Small real jobs in a folder of their own, and what every run must leave behind."""

from __future__ import annotations

import hashlib
import json
import os
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cache
from pathlib import Path
from typing import Any

import pytest

from animeme import registry
from animeme import run as run_job
from animeme.cli import main

SAMPLE = Path(__file__).resolve().parents[2] / "sample_assets"
CONSOLE = Path(sys.executable).with_name("animeme")
# Far beyond what any of these runs takes; a run that reaches it hangs.
PATIENCE_S = 60.0
Capture = pytest.CaptureFixture[str]


@dataclass(frozen=True)
class Ran:
    """How a command ended."""

    code: int
    out: str
    err: str

    def says(self, *words: str) -> None:
        """Assert that people were told each of `words`, and never shown Python's own words."""
        assert "Traceback" not in self.err
        for word in words:
            assert word in self.err


@dataclass
class SmallJob:
    """A job folder with the sample's crab in it; every section can be changed before a run.

    Attributes:
        folder: holds everything.
        sections: TOML table → its keys.
    """

    folder: Path
    sections: dict[str, dict[str, Any]] = field(default_factory=dict)

    @property
    def file(self) -> Path:
        return self.folder / "job.toml"

    @property
    def output(self) -> Path:
        return self.folder / "out"

    @property
    def dialogue(self) -> Path:
        return self.folder / "dialogue"

    def asset(self, name: str) -> Path:
        """A copy of one of the sample's files in the job's folder."""
        return Path(shutil.copy(SAMPLE / name, self.folder / name))

    def line(self, key: str, *, like: str = "en/boat") -> Path:
        """Add a line with the recording and transcript of a sample line; gives its recording."""
        for suffix in (".wav", ".txt"):
            target = self.dialogue / f"{key}{suffix}"
            target.parent.mkdir(parents=True, exist_ok=True)
            shutil.copy(SAMPLE / "dialogue" / f"{like}{suffix}", target)
        return self.dialogue / f"{key}.wav"

    def timed_line(self, key: str = "en/boat") -> None:
        """Add the sample's boat with its timings: aligning would take longer than all else."""
        self.line(key).with_suffix(".json").write_text(boat_timings(), encoding="utf-8")

    def write(self) -> Path:
        """Write the job file and give its path."""
        text = ""
        for table, keys in self.sections.items():
            header = ".".join(json.dumps(part) for part in table.split("."))
            text += f"[{header}]\n"
            text += "".join(
                f"{json.dumps(key)} = {json.dumps(value, ensure_ascii=False)}\n"
                for key, value in keys.items()
            )
        self.file.write_text(text, encoding="utf-8")
        return self.file

    def report(self) -> dict[str, Any]:
        document: dict[str, Any] = json.loads(
            (self.output / "report.json").read_text(encoding="utf-8")
        )
        return document

    def statuses(self, character: str = "crab") -> dict[str, str]:
        """Line → how it ended."""
        return {
            entry["line"]: entry["status"]
            for entry in self.report()["lines"]
            if entry["character"] == character
        }

    def findings(self, line: str, character: str = "crab") -> list[dict[str, Any]]:
        found: list[dict[str, Any]] = next(
            entry["findings"]
            for entry in self.report()["lines"]
            if (entry["line"], entry["character"]) == (line, character)
        )
        return found

    def log(self) -> list[dict[str, Any]]:
        """Events of ``run.jsonl``."""
        text = (self.output / "run.jsonl").read_text(encoding="utf-8")
        return [json.loads(line) for line in text.splitlines()]

    def animations(self, file: str = "en/crab.glb") -> set[str]:
        """Names of the animations in a delivered file."""
        path = self.output / file
        return set(registry.format_of(path).read_animations(path))

    def sources(self) -> dict[str, str]:
        """SHA-256 of everything in the folder but the output."""
        return digests(self.folder, without=self.output)

    def assert_tidy(self) -> None:
        """No temporary file is left anywhere in the folder."""
        left = [path for path in self.folder.rglob(".*") if not path.name.startswith(".keep")]
        assert left == []


@cache
def boat_timings() -> str:
    """The alignment of the sample's boat, made once per process."""
    with tempfile.TemporaryDirectory() as folder:
        job = small_job(Path(folder), "en/boat")
        run_job(job.write(), executor="inline")
        return (job.output / "alignments" / "en" / "boat.json").read_text(encoding="utf-8")


def small_job(folder: Path, *lines: str) -> SmallJob:
    """A job of the sample's crab (glTF, its own rig) that speaks `lines` of the sample."""
    folder.mkdir(parents=True, exist_ok=True)
    job = SmallJob(
        folder,
        {
            "job": {"name": "small", "output": "out"},
            "dialogue": {"root": "dialogue"},
            "characters.crab": {"asset": "crab.glb", "rig": "crab.rig.toml"},
        },
    )
    job.asset("crab.glb")
    job.asset("crab.rig.toml")
    for line in lines or ("en/boat",):
        job.line(line, like=line)
    return job


def digests(folder: Path, *, without: Path | None = None) -> dict[str, str]:
    """SHA-256 of every file below `folder`, by relative path."""
    return {
        path.relative_to(folder).as_posix(): hashlib.sha256(path.read_bytes()).hexdigest()
        for path in sorted(folder.rglob("*"))
        if path.is_file() and not (without and path.is_relative_to(without))
    }


def animeme(capsys: pytest.CaptureFixture[str], *arguments: object) -> Ran:
    """Run a command in this process, as its console script would."""
    capsys.readouterr()
    with pytest.raises(SystemExit) as ended:
        main([str(argument) for argument in arguments])
    out, err = capsys.readouterr()
    assert isinstance(ended.value.code, int)
    return Ran(ended.value.code, out, err)


def run_inline(
    capsys: pytest.CaptureFixture[str], job: SmallJob, *options: object, sources_kept: bool = True
) -> Ran:
    """Write and run a job in this process; its sources must come out of it as they were."""
    file = job.write()
    before = job.sources()
    ran = animeme(capsys, "run", file, "--executor", "inline", *options)
    job.assert_tidy()
    if sources_kept:
        assert job.sources() == before
    return ran


def console(*arguments: object, env: Mapping[str, str] | None = None) -> Ran:
    """Run the console script in a process of its own."""
    ended = subprocess.run(
        [CONSOLE, *map(str, arguments)],
        env={**os.environ, **(env or {})},
        capture_output=True,
        timeout=PATIENCE_S,
        check=False,
    )
    return Ran(ended.returncode, ended.stdout.decode("utf-8"), ended.stderr.decode("utf-8"))
