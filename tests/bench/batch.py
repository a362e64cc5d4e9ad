"""Ten thousand lines: what the engine costs, first run and re-runs.

Lines are those of ``../shared/data/grid-s1`` under new names in two languages' folders, each cut by
some samples, so that every one has content of its own. So that the engine's own cost shows, phones
and curves come from a trivial aligner and a trivial model (equal parts for the letters of the text;
one curve), as a studio's plug-ins: these figures say nothing about alignment or models.

    python tests/bench/batch.py --lines 10000 --workers 2
"""

from __future__ import annotations

import argparse
import json
import os
import resource
import shutil
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import Any

import soundfile

ROOT = Path(__file__).parents[2]
GRID = ROOT.parent / "shared" / "data" / "grid-s1" / "lines"
PLUGINS = """
import numpy as np

from animeme.contracts import Alignment
from animeme.curves import CurveSet
from animeme.phones import Phone, PhoneTrack, contiguous


class Trivial:
    name = "trivial"

    def languages(self):
        return frozenset({"en", "de"})

    def align(self, speech, text, *, language, lexicon=None, anchors=(), voice=None):
        letters = [letter for letter in text if letter.isalpha()][:20]
        step = speech.duration_s / (len(letters) + 1)
        symbols = ["AA" if letter in "aeiou" else "M" for letter in letters]
        phones = [Phone(s, n * step, (n + 1) * step) for n, s in enumerate(symbols)]
        return Alignment(PhoneTrack(language, "arpabet", contiguous(phones, speech.duration_s)))


class Flap:
    name = "flap"
    controls = ("jawOpen",)

    @classmethod
    def default(cls):
        return cls()

    def synthesize(self, track, *, rate_hz):
        times = np.array([0.0, *(phone.end_s for phone in track.phones)])
        weights = np.array([0.0, *(0.5 * (phone.symbol == "AA") for phone in track.phones)])
        return CurveSet(times, self.controls, weights[:, None])

    def remarks(self, track):
        return ()
"""
ENTRY_POINTS = """[animeme.aligners]
trivial = bench_plugins:Trivial
[animeme.models]
flap = bench_plugins:Flap
"""


def site(folder: Path) -> Path:
    """The trivial plug-ins, as pip would have installed them."""
    info = folder / "bench_plugins-1.0.dist-info"
    info.mkdir(parents=True)
    (info / "METADATA").write_text("Metadata-Version: 2.1\nName: bench-plugins\nVersion: 1.0\n")
    (info / "entry_points.txt").write_text(ENTRY_POINTS)
    (folder / "bench_plugins.py").write_text(PLUGINS)
    return folder


def dialogue(folder: Path, count: int) -> None:
    """Lines in two languages' folders, none with the content of another."""
    sources = sorted(GRID.glob("*.flac"))
    for language in ("en", "de"):
        (folder / language).mkdir(parents=True)
    for number in range(count):
        source = sources[number % len(sources)]
        samples, rate_hz = soundfile.read(source, dtype="int16")
        cut = 16 * (number // len(sources)) + 1
        target = folder / ("en", "de")[number % 2] / f"line-{number:06d}"
        soundfile.write(target.with_suffix(".wav"), samples[cut : cut + rate_hz], rate_hz)
        shutil.copyfile(source.with_suffix(".txt"), target.with_suffix(".txt"))


def run(job: Path, *options: str, env: dict[str, str]) -> dict[str, Any]:
    """Wall and CPU seconds of a run, start-up included, and what it says of itself."""
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    started = time.perf_counter()
    command = [Path(sys.executable).with_name("animeme"), "run", job, *options]
    ended = subprocess.run(command, env=env, capture_output=True, check=False)
    wall_s = time.perf_counter() - started
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    if ended.returncode:
        sys.exit(ended.stderr.decode())
    cpu_s = after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime
    log = (job.parent / "out" / "run.jsonl").read_text(encoding="utf-8").splitlines()
    events = [json.loads(line) for line in log]
    return {**events[-1], "wall_s": wall_s, "cpu_s": cpu_s}  # start-up included


def main() -> None:
    """Build, run, re-run, change a dozen lines, re-run; print the figures."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--lines", type=int, default=10_000)
    parser.add_argument("--workers", type=int, default=2)
    parser.add_argument("--layout", choices=["per-character", "per-line"], default="per-line")
    chosen = parser.parse_args()
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        env = {**os.environ, "ANIMEME_CACHE": str(folder / "cache")}
        paths = [str(site(folder / "site")), os.environ.get("PYTHONPATH", "")]
        env["PYTHONPATH"] = ":".join(filter(None, paths))
        dialogue(folder / "job" / "dialogue", chosen.lines)
        shutil.copy(ROOT / "sample_assets" / "ada.glb", folder / "job" / "ada.glb")
        job = folder / "job" / "job.toml"
        job.write_text(
            '[job]\nname = "bench"\n[dialogue]\nroot = "dialogue"\n[align]\naligner = "trivial"\n'
            '[model]\nname = "flap"\n[characters.ada]\nasset = "ada.glb"\n'
            f'layout = "{chosen.layout}"\n'
        )
        options = ("--workers", str(chosen.workers))
        time.sleep(3)  # files that are quite new are read again
        first = run(job, *options, env=env)
        say("first run", first, chosen.lines)
        steps = sum(first["step_s"].values())
        print(f"  CPU seconds per step, over all workers: {first['step_s']}")
        print(f"  engine: {1000 * (first['cpu_s'] - steps) / chosen.lines:.2f} ms of CPU per line")
        print(f"  cache: {size(folder / 'cache') / chosen.lines / 1000:.1f} kB per line")
        for _ in range(3):
            say("nothing changed", run(job, *options, env=env), chosen.lines)
        for number in range(12):
            path = folder / "job" / "dialogue" / "en" / f"line-{2 * number:06d}.txt"
            path.write_text(path.read_text() + " again")
        say("12 lines changed", run(job, *options, env=env), chosen.lines)


def say(what: str, run_: dict[str, Any], lines: int) -> None:
    """Print a run's figures."""
    print(
        f"{what}: {run_['wall_s']:.2f} s wall, {run_['cpu_s']:.2f} s CPU, "
        f"{run_['known_lines']} of {lines} lines and {run_['known_files']} of {run_['files']} "
        "files were there",
        flush=True,
    )


def size(folder: Path) -> int:
    """Bytes of all files below a folder."""
    return sum(path.stat().st_size for path in folder.rglob("*") if path.is_file())


if __name__ == "__main__":
    main()
