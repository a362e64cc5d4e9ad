"""Ten thousand lines: what the engine costs, first run and re-runs.

Lines are those of ``../shared/data/grid-s1`` under new names in two languages' folders, each cut by
some samples, so that every one has content of its own. So that the engine's own cost shows, phones
and curves come from a trivial aligner and a trivial model (equal parts for the letters of the text;
one curve), as a studio's plug-ins: these figures say nothing about alignment or models.

    python tests/bench/batch.py --lines 10000 --workers 2
    python tests/bench/batch.py simulated --lines 10000     # or a million: no stage does anything
    python tests/bench/batch.py pipeline                    # 700 lines and a real head
    python tests/bench/batch.py pairs --pairs 7             # the same, with one worker and with two

``simulated`` puts small files where lines' alignments and assets would be, in this process and
without workers: what is left is planning, keys, the index, the ledger and the reports. Its
recordings are a few bytes that nobody decodes.
"""

from __future__ import annotations

import argparse
import json
import os
import resource
import shutil
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path
from typing import Any

import soundfile

from animeme.executors import LATER, Result
from animeme.files import write_bytes
from animeme.job import read_job
from animeme.preflight import prepare
from animeme.runner import planned, run_job
from animeme.store.memory import memory
from animeme.tasks import (
    AssetItem,
    AssetOutcome,
    LineItem,
    LineOutcome,
    context_of,
    deliver,
    delivered,
)

ROOT = Path(__file__).parents[2]
SHARED = ROOT.parent / "shared"
GRID = SHARED / "data" / "grid-s1" / "lines"
HEAD = SHARED / "assets" / "ict" / "ict_multimesh_speech.glb"
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


class Simulated:
    """An executor whose stages take no time: it says that all is done, and puts files there."""

    cpu_s = 0.0
    overlaps = False

    def run(
        self, function: str, items: Iterable[Any], *, timeout_s: float, retries: int
    ) -> Iterator[Result]:
        name = function.rpartition(":")[2]
        for index, item in enumerate(item for item in items if item is not LATER):
            value = {"make_line": self._line, "write_asset": self._asset}.get(name, id)(item)
            yield Result(index, "ok", value, "", 1, 0.0, 0.0)

    def get_ready(self, function: str, item: Any) -> None:
        """Do nothing."""

    def release(self) -> None:
        """Do nothing."""

    def _line(self, item: LineItem) -> LineOutcome:
        context = context_of(item.spool)
        assert context.output is not None
        files = deliver(context.output, item.line, b"{}\n", b"")
        key = item.keys.align
        curves = tuple((target, key, key) for target in item.targets)
        return LineOutcome(1.0, (), alignment=key, curves=curves, final=True, delivered=files)

    def _asset(self, item: AssetItem) -> AssetOutcome:
        write_bytes(Path(item.output), b"glTF", durable=False)
        files = delivered([item.output])
        return AssetOutcome((item.output,), (), delivered=files, final=True)


def simulated(count: int, layout: str) -> None:
    """Plan, memory and index of a job whose stages do nothing; then re-runs by the command."""
    with tempfile.TemporaryDirectory() as made:
        folder = Path(made)
        job = job_in(folder, layout, aligner="pocketsphinx", model="dam")
        for language in ("en", "de"):
            (folder / "job" / "dialogue" / language).mkdir(parents=True)
        for number in range(count):
            stem = f"{folder}/job/dialogue/{('en', 'de')[number % 2]}/{number:07d}"
            for suffix, text in ((".wav", "recording"), (".txt", "line")):
                with open(stem + suffix, "w") as stream:
                    stream.write(f"{text} {number}")
        os.environ["ANIMEME_CACHE"] = str(folder / "cache")
        time.sleep(1)
        usage_s = time.process_time()
        with memory(folder / "cache" / "store") as remembered:
            prepare(read_job(job), remembered)
            print(f"looking at the job: {time.process_time() - usage_s:.2f} CPU-s")
            usage_s = time.process_time()
            plan, _ = planned(read_job(job), remembered)
            planning_s = time.process_time() - usage_s
            print(f"planning: {planning_s:.2f} CPU-s, peak memory {peak_mb():.0f} MB", flush=True)
            del plan
            usage_s = time.process_time()
            report = run_job(read_job(job), Simulated(), remembered)
        engine_s = time.process_time() - usage_s
        print(f"first run: {1000 * engine_s / count:.3f} ms of CPU per line without its stages, ")
        print(f"  {report.count('ok')} of {count} ok, peak memory {peak_mb():.0f} MB")
        for name in ("index", "store"):
            each = size(folder / "cache" / name) / count / 1000
            print(f"  {name}: {each:.2f} kB per line", flush=True)
        for _ in range(3 if count < 100_000 else 1):
            say("nothing changed", run(job, env=dict(os.environ)), count)


def peak_mb() -> float:
    """Most memory that this process has had, in MB."""
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024


def pipeline(workers: Sequence[int]) -> None:
    """700 lines with the ICT head, against a loop that only aligns them."""
    own = {"OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1"}
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    loop = [sys.executable, str(Path(__file__).with_name("alignment.py")), "--loop"]
    subprocess.run(loop, env={**os.environ, **own}, check=True, capture_output=True)
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    loop_s = after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime
    print(f"two-pass loop: {loop_s:.1f} CPU-s", flush=True)
    for layout in ("per-line", "animation-only"):
        for count in workers:
            done = of_grid(layout, count)
            print(
                f"{layout}, {count} workers: {done['cpu_s']:.1f} CPU-s, {done['wall_s']:.1f} s "
                f"wall, {done['cpu_s'] / loop_s:.2f} of the loop; steps {done['step_s']}",
                flush=True,
            )


def pairs(count: int) -> None:
    """How many times as fast two workers are: pairs of runs, each the other way round."""
    found = []
    for number in range(count):
        order = (1, 2) if number % 2 == 0 else (2, 1)
        done = {workers: of_grid("animation-only", workers) for workers in order}
        one, two = done[1], done[2]
        found.append(one["wall_s"] / two["wall_s"])
        print(
            f"one worker {one['wall_s']:.2f} s, two {two['wall_s']:.2f} s: {found[-1]:.2f} times "
            f"as fast; the same alignments took {one['step_s']['align']:.1f} and "
            f"{two['step_s']['align']:.1f} s of CPU",
            flush=True,
        )
    print(f"median {statistics.median(found):.2f}")


def of_grid(layout: str, workers: int) -> dict[str, Any]:
    """The first run of 700 lines with the ICT head."""
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        job = folder / "job" / "job.toml"
        (folder / "job" / "dialogue" / "en").mkdir(parents=True)
        for path in [*GRID.glob("*.flac"), *GRID.glob("*.txt")]:
            shutil.copy(path, folder / "job" / "dialogue" / "en")
        job.write_text(
            '[job]\nname = "bench"\n[dialogue]\nroot = "dialogue"\n[characters.head]\n'
            f'asset = "{HEAD}"\nlayout = "{layout}"\n'
        )
        env = {**os.environ, "ANIMEME_CACHE": str(folder / "cache")}
        return run(job, "--workers", str(workers), env=env)


def main() -> None:
    """Print the figures that were asked for."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument(
        "part", nargs="?", choices=["lines", "simulated", "pipeline", "pairs"], default="lines"
    )
    parser.add_argument("--lines", type=int, default=10_000)
    parser.add_argument("--workers", type=int, default=2)
    parser.add_argument("--layout", choices=["per-character", "per-line"], default="per-line")
    parser.add_argument("--pairs", type=int, default=7)
    chosen = parser.parse_args()
    if chosen.part == "simulated":
        simulated(chosen.lines, chosen.layout)
    elif chosen.part == "pipeline":
        pipeline((1, 2))
    elif chosen.part == "pairs":
        pairs(chosen.pairs)
    else:
        lines(chosen)


def job_in(folder: Path, layout: str, *, aligner: str, model: str) -> Path:
    """A job with ada in a folder, its dialogue beside it."""
    (folder / "job").mkdir(parents=True, exist_ok=True)
    shutil.copy(ROOT / "sample_assets" / "ada.glb", folder / "job" / "ada.glb")
    job = folder / "job" / "job.toml"
    job.write_text(
        f'[job]\nname = "bench"\n[dialogue]\nroot = "dialogue"\n[align]\naligner = "{aligner}"\n'
        f'[model]\nname = "{model}"\n[characters.ada]\nasset = "ada.glb"\n'
        f'layout = "{layout}"\n'
    )
    return job


def lines(chosen: argparse.Namespace) -> None:
    """Build, run, re-run, change a dozen lines, re-run; print the figures."""
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        env = {**os.environ, "ANIMEME_CACHE": str(folder / "cache")}
        paths = [str(site(folder / "site")), os.environ.get("PYTHONPATH", "")]
        env["PYTHONPATH"] = ":".join(filter(None, paths))
        dialogue(folder / "job" / "dialogue", chosen.lines)
        job = job_in(folder, chosen.layout, aligner="trivial", model="flap")
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
        for word in ("again", "once more", "at last"):
            for number in range(12):
                path = folder / "job" / "dialogue" / "en" / f"line-{2 * number:06d}.txt"
                path.write_text(f"{word} {path.read_text()}")
            changed = run(job, *options, env=env)
            say("12 lines changed", changed, chosen.lines)
            print(f"  of it in their stages: {sum(changed['step_s'].values()):.2f} s CPU")


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
