"""Rounds of disaster: a run that something happens to, then one that nothing does.

Whatever happened, the second run's files are those of a run that nothing ever happened to, it does
no line again that the first had told to be done, and nothing is left lying or running about.
"""

from __future__ import annotations

import json
import os
import random
import resource
import shutil
import signal
import sqlite3
import subprocess
import sys
import time
from collections import Counter
from collections.abc import Callable, Mapping
from contextlib import closing
from dataclasses import dataclass, field
from functools import cached_property
from itertools import product
from pathlib import Path
from typing import Any

import soundfile

from support.clusters import Cluster, children, members, strike, wait_for
from support.jobs import CONSOLE, PATIENCE_S, SmallJob, digests
from support.plugins import install

LINES = ("en/boat", "en/five", "en/moon", "de/boat", "de/five", "de/moon")
FULL = ("full store", "full cache", "full output")
FAULTS = ("worker", "driver", "Ctrl-C", *FULL, "damage", "hang", "segfault")
DASK_FAULTS = (*FAULTS, "Dask worker", "all Dask workers", "scheduler")
# A run in which a stage hangs waits for it no longer than that.
HURRIED = (
    "import sys; from animeme import work; work.LINE_TIMEOUT_S = 2.0; "
    "from animeme.cli import main; main(sys.argv[1:])"
)
LIMIT_S = 2 * PATIENCE_S
AMPLE = "64m"
SCRATCH = "dask-scratch-space"  # which Dask keeps to itself, and for as long as it lives


def chaotic_job(folder: Path) -> SmallJob:
    """Six lines of a third of a second, and stages that cost next to nothing."""
    job = SmallJob(
        folder,
        {
            "job": {"name": "chaos", "output": "out"},
            "dialogue": {"root": "dialogue"},
            "align": {"aligner": "chaotic"},
            "model": {"name": "flap"},
            "characters.crab": {"asset": "crab.glb", "rig": "crab.rig.toml", "layout": "per-line"},
        },
    )
    folder.mkdir(parents=True)
    for name in ("crab.glb", "crab.rig.toml"):
        job.asset(name)
    for number, line in enumerate(LINES):
        audio = job.line(line, like=line)
        samples, rate_hz = soundfile.read(audio, dtype="int16")
        soundfile.write(audio, samples[: rate_hz // 3 + number], rate_hz)
    job.write()
    return job


@dataclass
class Round:
    """What a round does.

    Attributes:
        number: of the round.
        executor: of the run that something happens to.
        fault: what happens.
        chance: for all that is left to it.
        struck: whether it happened before the run was over.
        exit_code: of the first run.
        taken_up: how many lines the second found done.
    """

    number: int
    executor: str
    fault: str
    chance: random.Random
    struck: bool = False
    exit_code: int = 0
    taken_up: int = 0

    def __str__(self) -> str:
        return f"round {self.number}: {self.fault}, {self.executor}"


@dataclass
class Chaos:
    """A job, a store and perhaps a cluster that go through rounds of disaster.

    Attributes:
        folder: for everything.
        seed: the same seed, the same rounds.
        dask: whether there is a Dask cluster too.
    """

    folder: Path
    seed: int = 0
    dask: bool = True
    told: list[Round] = field(default_factory=list)

    def __post_init__(self) -> None:
        self.job = chaotic_job(self.folder / "job")
        self.orders = self.folder / "orders"
        self.cache = self.folder / "cache"
        self.mount = self.folder / "small"
        self.temporary = [self.folder / "tmp", self.folder / "cluster-tmp"]
        for folder in (self.orders, self.mount, *self.temporary):
            folder.mkdir()
        path = os.pathsep.join(
            filter(None, (str(install("chaotic", self.folder / "site")), _python_path()))
        )
        self.env = {
            **os.environ,
            "PYTHONPATH": path,
            "ANIMEME_CACHE": str(self.cache),
            "CHAOS": str(self.orders),
            "TMPDIR": str(self.temporary[0]),
        }
        own = {**self.env, "TMPDIR": str(self.temporary[1])}
        self.cluster = Cluster(self.folder / "cluster", own)

    def __enter__(self) -> Chaos:
        ran, _ = self.run("inline", "--no-cache")
        assert ran == 0
        self.undisturbed = _results(self.job.output)
        assert len(self.undisturbed) > len(LINES)
        return self

    def __exit__(self, *_: object) -> None:
        self._unmount()
        self.cluster.__exit__()

    def rounds(self, count: int, tell: Callable[[Round], object] = lambda _: None) -> None:
        """Go through so many rounds; every kind of disaster comes as often as any other.

        Raises:
            AssertionError: something is lost, different, left over, or done again.
        """
        kinds = [("local", fault) for fault in FAULTS]
        kinds += [("dask", fault) for fault in DASK_FAULTS] if self.dask else []
        order: list[tuple[str, str]] = []
        for number in range(count):
            chance = random.Random(f"{self.seed} {number}")
            if not order:
                order = chance.sample(kinds, len(kinds))
            this = Round(number, *order.pop(), chance)
            self.told.append(this)
            self.round(this)
            tell(this)
        assert wait_for(self.cluster.idle, 30), "processes of dead runs are still at work"

    def round(self, this: Round) -> None:
        """One run that something happens to, and one that nothing does."""
        chance = this.chance
        if chance.random() < 0.7:
            self.forget()
        shutil.rmtree(self.job.output, ignore_errors=True)
        options, output = self._places(this)
        if this.fault == "damage":
            self.run(chance.choice(("inline", "local")), *options)
            if chance.random() < 0.5:
                shutil.rmtree(output)
            self._damage(this)
        elif this.fault in ("hang", "segfault"):
            often = chance.choice(("once", "always"))
            for line in chance.sample(LINES, chance.randint(1, 2)):
                (self.orders / line.rpartition("/")[2]).write_text(f"{this.fault} {often}")
        if this.fault != "damage":
            this.exit_code, err = self.run(this.executor, *options, this=this)
            # A process that loses its driver while it starts has Python say so.
            assert this.fault == "driver" or "Traceback" not in err, f"{this}: {err}"
            # A fault of ours is what plug-ins do to their processes, and nothing else.
            faulty = this.exit_code == 3 and this.fault not in ("hang", "segfault")
            assert not faulty, f"{this}: {err}"
        for order in self.orders.iterdir():
            order.unlink()
        if this.fault in FULL:
            # Without its index a run does all that it has to, only the next takes longer.
            this.struck = this.exit_code != 0 or this.fault == "full cache"
            self._enlarge()
        log = _log(output)
        assert max(_times(log).values(), default=1) == 1, f"{this}: {log}"
        ok = {e["line"] for e in log if e["event"] == "line" and e["status"] == "ok"}
        done = ok if this.fault != "damage" else set()
        again = chance.choice(("inline", "inline", "local", "dask" if self.dask else "local"))
        code, err = self.run(again, *options)
        assert code == 0, f"{this}, then {again}: {err}"
        self.inspect(this, output, done)
        self._unmount()

    def inspect(self, this: Round, output: Path, done: set[str]) -> None:
        """See that a second run has put right what happened to the first.

        Raises:
            AssertionError: it has not; says what is wrong.
        """
        found = _results(output)
        differ = {name for name in {*found, *self.undisturbed}
                  if found.get(name) != self.undisturbed.get(name)}  # fmt: skip
        assert not differ, f"{this}: {sorted(differ)}"
        log = _log(output)
        times = _times(log)
        assert times == dict.fromkeys(LINES, 1), f"{this}: {times}"
        made = {event["line"] for event in log if event.get("made")}
        assert not made & done, f"{this}: {made & done} were done twice"
        this.taken_up = len(LINES) - len(made)
        left = [path for place in (self.job.folder, output) for path in place.rglob(".*")]
        stores = (self.cache / "store", self.mount / "store", self.mount / "cache" / "store")
        for place in (*(store / "tmp" for store in stores), *self.temporary):
            left += [path for path in place.rglob("*") if SCRATCH not in path.parts]
        assert not left, f"{this}: {left}"
        ended = wait_for(lambda: not self.cluster.strays(), 10)
        assert ended, f"{this}: processes outlive their Dask worker: {self.cluster.strays()}"

    def _places(self, this: Round) -> tuple[list[str], Path]:
        """Options of both runs, and their output folder."""
        self.env["ANIMEME_CACHE"] = str(self.cache)
        if this.fault not in FULL:
            return [], self.job.output
        used = self._room[this.fault.removeprefix("full ")]
        self.limit = int(used * this.chance.uniform(0.02, 0.98))
        if self.can_mount:
            command = ["mount", "-t", "tmpfs", "-o", f"size={max(self.limit, 8192)}", "chaos"]
            subprocess.run([*command, self.mount], check=True)
        if this.fault == "full store":
            return ["--cache", str(self.mount / "store")], self.job.output
        if this.fault == "full cache":
            self.env["ANIMEME_CACHE"] = str(self.mount / "cache")
            return [], self.job.output
        return ["--output", str(self.mount / "out")], self.mount / "out"

    @cached_property
    def can_mount(self) -> bool:
        """Whether we may make small disks; else files are kept small, which is not quite it."""
        command = ["mount", "-t", "tmpfs", "chaos", str(self.mount)]
        mounted = subprocess.run(command, capture_output=True, check=False).returncode == 0
        self._unmount()
        return mounted

    @cached_property
    def _room(self) -> Mapping[str, int]:
        """Bytes that an undisturbed run's store, cache and output take on a disk."""
        self.forget()
        self.run("inline")
        folders = {"store": self.cache / "store", "cache": self.cache, "output": self.job.output}
        used = {name: _room(folder) for name, folder in folders.items()}
        self.forget()
        shutil.rmtree(self.job.output)
        return used

    def forget(self) -> None:
        """Empty the store and its index, but for what takes long and says nothing of lines."""
        shutil.rmtree(self.cache / "store", ignore_errors=True)
        for path in (self.cache / "index").glob("*.sqlite"):
            with closing(sqlite3.connect(path)) as index, index:
                index.execute(
                    "DELETE FROM notes WHERE key NOT LIKE 'imports:%' "
                    "AND key NOT LIKE 'brought-by:%'"
                )

    def _enlarge(self) -> None:
        if self.can_mount:
            subprocess.run(["mount", "-o", f"remount,size={AMPLE}", self.mount], check=True)

    def _unmount(self) -> None:
        if os.path.ismount(self.mount):
            subprocess.run(["umount", "--lazy", self.mount], check=True)
        for left in self.mount.iterdir():
            shutil.rmtree(left)

    def _damage(self, this: Round) -> None:
        """Cut, change or take away some of what is in the store."""
        chance = this.chance
        files = sorted(path for path in (self.cache / "store").glob("??/*") if path.is_file())
        assert files
        others = {path: path.read_bytes() for path in files}
        for path in chance.sample(files, chance.randint(1, len(files))):
            data = bytearray(others[path])
            what = chance.choice(("cut", "flip", "empty", "gone", "other"))
            if what == "cut":
                del data[chance.randrange(len(data)) :]
            elif what == "flip":
                data[chance.randrange(len(data))] ^= 1 << chance.randrange(8)
            elif what == "empty":
                data.clear()
            elif what == "other":
                data = bytearray(others[chance.choice(files)])
            if what == "gone":
                path.unlink()
            else:
                path.write_bytes(data)
        this.struck = True

    def run(self, executor: str, *options: str, this: Round | None = None) -> tuple[int, str]:
        """Exit code and words of a run, that perhaps something happens to; its processes end."""
        command = [str(CONSOLE), "run", str(self.job.file), "--executor", executor, *options]
        if this is not None and this.fault == "hang":
            command[:1] = [sys.executable, "-c", HURRIED]
        command += ["--workers", "2"] if executor == "local" else []
        if executor == "dask":
            self.cluster.revive()
            command += ["--scheduler", self.cluster.address]
        full = this is not None and this.fault in FULL
        with subprocess.Popen(
            command,
            env=self.env,
            stdout=subprocess.DEVNULL,
            stderr=subprocess.PIPE,
            start_new_session=True,
            preexec_fn=self._limited if full and not self.can_mount else None,
        ) as process:
            try:
                if this is not None:
                    self._disturb(this, process)
                until = time.monotonic() + LIMIT_S
                while executor == "dask" and process.poll() is None and time.monotonic() < until:
                    self.cluster.revive()
                    time.sleep(0.1)
                _, err = process.communicate(timeout=LIMIT_S)
            finally:
                process.kill()
        alone = wait_for(lambda: not members(process.pid), 10)
        assert alone, f"{this}: processes outlive their run: {members(process.pid)}"
        return process.returncode, err.decode()

    def _limited(self) -> None:
        resource.setrlimit(resource.RLIMIT_FSIZE, (self.limit // 4, self.limit // 4))

    def _disturb(self, this: Round, process: subprocess.Popen[bytes]) -> None:
        """Let happen to a run what is to happen, when it is so far."""
        blow = self._blow(this, process)
        if blow is None:
            this.struck = True
            return
        log = self.job.output / "run.jsonl"
        lines = this.chance.randrange(len(LINES) + 1)

        def so_far() -> bool:
            began = log.is_file() and log.read_text(encoding="utf-8").count('"line"') > lines
            return began or process.poll() is not None

        wait_for(so_far, LIMIT_S)
        time.sleep(this.chance.choice((0.0, this.chance.uniform(0.0, 0.3))))
        if process.poll() is None:
            this.struck = True
            blow()
        if this.fault in ("Dask worker", "all Dask workers", "scheduler"):
            time.sleep(this.chance.uniform(0.0, 1.0))

    def _blow(self, this: Round, process: subprocess.Popen[bytes]) -> Callable[[], None] | None:
        def workers() -> None:
            parents = [process.pid]
            if this.executor == "dask":
                parents = [self.cluster.process(1), self.cluster.process(2)]
            found = [child for parent in parents for child in children(parent)]
            if found:
                strike(this.chance.choice(found))

        def dask_workers() -> None:
            for number in (1, 2):
                self.cluster.kill(number)

        return {
            "worker": workers,
            "driver": process.kill,
            "Ctrl-C": lambda: os.killpg(process.pid, signal.SIGINT),
            "Dask worker": lambda: self.cluster.kill(this.chance.choice((1, 2))),
            "all Dask workers": dask_workers,
            "scheduler": lambda: self.cluster.kill(0),
        }.get(this.fault)

    def summary(self) -> str:
        """How often what happened."""
        rows = []
        for executor, fault in product(("local", "dask"), DASK_FAULTS):
            own = [r for r in self.told if (r.executor, r.fault) == (executor, fault)]
            if own:
                struck = sum(r.struck for r in own)
                codes = sorted({r.exit_code for r in own})
                taken = sum(r.taken_up for r in own) / len(own)
                rows.append(
                    f"{executor:5} {fault:16} {len(own):4} rounds, {struck:4} struck, exit codes "
                    f"{codes}; {taken:.1f} of {len(LINES)} lines taken up afterwards"
                )
        return "\n".join(rows)


def _python_path() -> str:
    return os.environ.get("PYTHONPATH", "")


def _results(output: Path) -> dict[str, str]:
    found = digests(output)
    found.pop("run.jsonl", None)
    return found


def _log(output: Path) -> list[dict[str, Any]]:
    """Events of a run, but for a last one that is cut off."""
    events = []
    log = output / "run.jsonl"
    for line in log.read_text(encoding="utf-8").splitlines() if log.is_file() else ():
        try:
            events.append(json.loads(line))
        except ValueError:
            break
    return events


def _times(log: list[dict[str, Any]]) -> Counter[str]:
    """How often each line was told, but for those whose curves were lost when they were wanted."""
    told = Counter(event["line"] for event in log if event["event"] == "line")
    return told - Counter(line for e in log if e["event"] == "lost" for line in e["lines"])


def _room(folder: Path) -> int:
    """Bytes that the files below a folder take on a disk of pages of 4 kB."""
    files = [path for path in folder.rglob("*") if path.is_file()]
    return sum(-(-path.stat().st_size // 4096) * 4096 for path in files)
