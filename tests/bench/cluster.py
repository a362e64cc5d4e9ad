"""A thousand lines on two Dask workers over TCP, one of them killed half-way; and the local pool.

The scheduler and its workers are processes of their own; where the machine allows it, each in a
network namespace of its own, joined by a bridge. Lines are those of ``../shared/data/grid-s1`` and
copies of them, each cut to its first four words (about a second) and by some samples, so that every
one has content of its own. Real stages: PocketSphinx and the shipped model, on the sample's crab.
CPU-seconds are those of all processes that take part, user and system, from the kernel's counts.
The cluster has been started before, and its machine has looked through the code once, which costs
it 1.5 CPU-seconds per version.

    python tests/bench/cluster.py --lines 1000
"""

from __future__ import annotations

import argparse
import json
import os
import shutil
import signal
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Iterator, Sequence
from contextlib import ExitStack, contextmanager, suppress
from pathlib import Path
from statistics import median
from typing import NamedTuple

import soundfile

sys.path.insert(0, str(Path(__file__).parents[1]))

from support.clusters import Cluster, wait_for
from support.jobs import digests

ROOT = Path(__file__).parents[2]
GRID = ROOT.parent / "shared" / "data" / "grid-s1" / "lines"
TICKS = os.sysconf("SC_CLK_TCK")
SETTLE_S = 8.0
WORDS = 4
MARGIN_S = 0.1


def dialogue(folder: Path, count: int) -> None:
    """Lines of their first words, none with the content of another."""
    times: dict[str, list[tuple[float, float, str]]] = json.loads(
        (GRID.parent / "word_times.json").read_text(encoding="utf-8")
    )
    names = sorted(times)
    folder.mkdir(parents=True)
    for number in range(count):
        name = names[number % len(names)]
        samples, rate_hz = soundfile.read(GRID / f"{name}.flac", dtype="int16")
        words = times[name][:WORDS]
        first = int((words[0][0] - MARGIN_S) * rate_hz) + 16 * (number // len(names))
        cut = samples[max(first, 0) : int((words[-1][1] + MARGIN_S) * rate_hz)]
        target = folder / f"line-{number:06d}"
        soundfile.write(target.with_suffix(".wav"), cut, rate_hz)
        text = " ".join(word for *_, word in words)
        target.with_suffix(".txt").write_text(text, encoding="utf-8")


class Cost(NamedTuple):
    """What a run took: seconds, CPU-seconds of all processes, those beside the stages' own."""

    wall_s: float
    cpu_s: float
    own_s: float


class Meter:
    """CPU time of processes and all that they start, those that end meanwhile included."""

    def __init__(self) -> None:
        self._seen: dict[tuple[int, int], float] = {}
        self._first: dict[tuple[int, int], float] = {}
        self._names: dict[int, str] = {}
        self._over = threading.Event()
        self._roots: list[int] = []
        self._thread = threading.Thread(target=self._watch, daemon=True)
        self._thread.start()

    def add(self, name: str, root: int, *, spent: bool = False) -> None:
        """Count this process too, from now on; with `spent`, not what it has used already."""
        self._names[root] = name
        self._roots.append(root)
        if spent:
            self.look()
            self._first = dict(self._seen)

    def _watch(self) -> None:
        while not self._over.wait(0.25):
            self.look()

    def look(self) -> None:
        """Read the kernel's counts."""
        stats: dict[int, list[str]] = {}
        children: dict[int, list[int]] = {}
        for entry in os.scandir("/proc"):
            if entry.name.isdecimal():
                with suppress(OSError):
                    text = Path(entry.path, "stat").read_text().rpartition(")")[2].split()
                    stats[int(entry.name)] = text
                    children.setdefault(int(text[1]), []).append(int(entry.name))
        waiting = [root for root in self._roots if root in stats]
        while waiting:
            process = waiting.pop()
            text = stats[process]
            self._seen[process, int(text[19])] = (int(text[11]) + int(text[12])) / TICKS
            waiting += children.get(process, ())

    @property
    def cpu_s(self) -> float:
        """Seconds so far."""
        return sum(self._seen.values()) - sum(self._first.values())

    @property
    def parts(self) -> str:
        """Seconds so far of each that was named, and of what they started."""
        found: dict[str, float] = {}
        for process, seconds in self._seen.items():
            name = self._names.get(process[0], "their processes")
            found[name] = found.get(name, 0.0) + seconds - self._first.get(process, 0.0)
        return ", ".join(f"{name} {seconds:.1f}" for name, seconds in found.items())

    def end(self) -> None:
        """Stop counting."""
        self._over.set()
        self._thread.join()


@contextmanager
def namespaces(count: int) -> Iterator[tuple[list[list[str]], str]]:
    """Words before a command for each namespace, and the first one's address on their bridge."""
    mark = f"am{os.getpid() % 10000}"
    names = [f"{mark}n{number}" for number in range(count)]
    net = f"10.213.{os.getpid() % 250}"  # another bench may run beside this one

    def ip(*words: str) -> None:
        subprocess.run(["ip", *words], check=True, capture_output=True)

    try:
        ip("link", "add", f"{mark}br", "type", "bridge")
        ip("addr", "add", f"{net}.254/24", "dev", f"{mark}br")
        ip("link", "set", f"{mark}br", "up")
        for number, name in enumerate(names, 1):
            ip("netns", "add", name)
            ip("link", "add", f"{mark}v{number}", "type", "veth", "peer", "eth0", "netns", name)
            ip("link", "set", f"{mark}v{number}", "master", f"{mark}br", "up")
            ip("-n", name, "addr", "add", f"{net}.{number}/24", "dev", "eth0")
            ip("-n", name, "link", "set", "eth0", "up")
            ip("-n", name, "link", "set", "lo", "up")
        yield [["ip", "netns", "exec", name] for name in names], f"{net}.1"
    finally:
        for number, name in enumerate(names, 1):
            subprocess.run(["ip", "link", "del", f"{mark}v{number}"], capture_output=True)
            subprocess.run(["ip", "netns", "del", name], capture_output=True)
        subprocess.run(["ip", "link", "del", f"{mark}br"], capture_output=True)


def animeme(folder: Path, env: dict[str, str], *options: str) -> subprocess.Popen[bytes]:
    """Start a run."""
    command = [str(Path(sys.executable).with_name("animeme")), "run", str(folder / "job.toml")]
    return subprocess.Popen([*command, *options], env=env, stderr=subprocess.PIPE)


def finished(process: subprocess.Popen[bytes]) -> None:
    """Wait for a run, which must end well."""
    _, err = process.communicate()
    if process.returncode not in (0, 1):
        sys.exit(err.decode())
    print("  " + err.decode().strip().splitlines()[-1], flush=True)


def done(output: Path) -> int:
    """Lines that a run has told to be done."""
    log = output / "run.jsonl"
    return log.read_text(encoding="utf-8").count('"event": "line"') if log.is_file() else 0


def local(folder: Path, env: dict[str, str], name: str) -> Cost:
    """What the local pool costs."""
    meter = Meter()
    started = time.perf_counter()
    process = animeme(folder, env, "--workers", "2", "--output", str(folder / name))
    meter.add("driver", process.pid)
    finished(process)
    wall_s = time.perf_counter() - started
    meter.end()
    return cost(meter, wall_s, folder / name)


def dask(
    folder: Path, env: dict[str, str], cluster: Cluster, name: str, *, lines: int, kill: bool
) -> tuple[Cost, int]:
    """What a cluster that is there costs, and how many lines were done when a worker was killed."""
    meter = Meter()
    for number, part in enumerate(("scheduler", "worker", "worker")):
        meter.add(part, cluster.process(number), spent=True)
    started = time.perf_counter()
    output = folder / name
    options = ("--executor", "dask", "--scheduler", cluster.address, "--output", str(output))
    process = animeme(folder, env, *options)
    meter.add("driver", process.pid)
    at = 0
    if kill:
        wait_for(lambda: done(output) >= lines / 2 or process.poll() is not None, 3600)
        at = done(output)
        cluster.kill(2)
    finished(process)
    wall_s = time.perf_counter() - started
    meter.end()
    return cost(meter, wall_s, output), at


def cost(meter: Meter, wall_s: float, output: Path) -> Cost:
    """What a run that has ended took."""
    print(f"  CPU-seconds: {meter.parts}")
    end = json.loads((output / "run.jsonl").read_text(encoding="utf-8").splitlines()[-1])
    return Cost(wall_s, meter.cpu_s, meter.cpu_s - sum(end["step_s"].values()))


def compare(folder: Path, names: Sequence[str]) -> str:
    """Whether the outputs are the same, byte for byte."""
    found = []
    for name in names:
        own = digests(folder / name)
        own.pop("run.jsonl")
        found.append(own)
    same = all(own == found[0] for own in found)
    return f"{len(found[0])} files each, {'all the same bytes' if same else 'DIFFERENT'}"


def main() -> None:
    """Build, run in each way, print the figures."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--lines", type=int, default=1000)
    parser.add_argument("--no-namespaces", action="store_true")
    parser.add_argument("--no-kill", action="store_true", help="only the cost against the pool")
    parser.add_argument("--turns", type=int, default=1, help="of both; the figure is the median's")
    chosen = parser.parse_args()
    signal.signal(signal.SIGTERM, lambda *_: sys.exit("stopped"))  # the cluster ends with us
    with tempfile.TemporaryDirectory() as name, ExitStack() as stack:
        folder = Path(name)
        dialogue(folder / "dialogue" / "en", chosen.lines)
        for file in ("crab.glb", "crab.rig.toml"):
            shutil.copy(ROOT / "sample_assets" / file, folder / file)
        (folder / "job.toml").write_text(
            '[job]\nname = "cluster"\n[dialogue]\nroot = "dialogue"\n'
            '[characters.crab]\nasset = "crab.glb"\nrig = "crab.rig.toml"\nlayout = "per-line"\n'
        )
        time.sleep(3)  # files that are quite new are read again

        def env_of(store: str) -> dict[str, str]:
            return {**os.environ, "ANIMEME_CACHE": str(folder / store)}

        wrap: list[list[str]] = []
        host, where = "127.0.0.1", "this machine's own network"
        if not chosen.no_namespaces:
            try:
                wrap, host = stack.enter_context(namespaces(3))
                where = "a network namespace each"
            except (OSError, subprocess.CalledProcessError) as error:
                print(f"no namespaces here: {error}")
        cluster = stack.enter_context(
            Cluster(folder / "cluster", env_of("workers"), wrap=wrap, host=host)
        )
        digest = "from animeme.executors.crew import code_digest; code_digest()"
        subprocess.run([sys.executable, "-c", digest], env=cluster.env, check=True)
        print(f"scheduler {cluster.address} and two workers of one thread, {where}")
        time.sleep(SETTLE_S)
        lines = chosen.lines
        outputs: list[str] = []
        pool: list[Cost] = []
        farm: list[Cost] = []
        for turn in range(chosen.turns):
            # Whoever comes second may find the machine warmer.
            for which in ("local", "dask") if turn % 2 == 0 else ("dask", "local"):
                outputs.append(f"{which}-{turn}")
                env = env_of(f"store-{outputs[-1]}")
                if which == "local":
                    pool.append(local(folder, env, outputs[-1]))
                    say("local pool, 2 processes", pool[-1], lines)
                else:
                    found, _ = dask(folder, env, cluster, outputs[-1], lines=lines, kill=False)
                    farm.append(found)
                    say("Dask, 2 workers", found, lines)
        told("Dask over the pool", pool, farm, lines)
        if not chosen.no_kill:
            env = env_of("store-killed")
            found, at = dask(folder, env, cluster, "killed", lines=lines, kill=True)
            say(f"Dask, one of the workers killed after {at} lines", found, lines)
            told("Dask with a death over the pool", pool[-1:], [found], lines)
            outputs.append("killed")
        for output in outputs:
            document = json.loads((folder / output / "report.json").read_text(encoding="utf-8"))
            print(f"  {output}: {len(document['lines'])} lines, totals {document['totals']}")
        print(f"  {compare(folder, outputs)}")


def told(what: str, pool: Sequence[Cost], farm: Sequence[Cost], lines: int) -> None:
    """Print how much more the one costs than the other; medians of the turns."""
    pairs = [*zip(pool, farm, strict=True)]
    wall = median(own.wall_s / base.wall_s for base, own in pairs) - 1
    cpu = median(own.cpu_s / base.cpu_s for base, own in pairs) - 1
    # What the stages take varies more than this, with whatever else the machine does.
    own_ms = [1000 * median(cost.own_s for cost in costs) / lines for costs in (pool, farm)]
    share = (own_ms[1] - own_ms[0]) * lines / 1000 / median(cost.cpu_s for cost in pool)
    print(f"  {what}: wall {wall:+.1%}, CPU {cpu:+.1%}")
    print(f"  beside the stages {own_ms[0]:.1f} and {own_ms[1]:.1f} ms per line: CPU {share:+.1%}")


def say(what: str, cost: Cost, lines: int) -> None:
    """Print a run's figures."""
    each = 1000 * cost.cpu_s / lines
    print(
        f"{what}: {cost.wall_s:.1f} s wall, {cost.cpu_s:.1f} CPU-seconds, "
        f"{each:.1f} ms of CPU per line, {cost.own_s:.1f} s beside the stages"
    )


if __name__ == "__main__":
    main()
