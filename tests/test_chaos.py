"""Runs that something happens to: the next goes on, ends as if nothing had been, leaves nothing."""

from __future__ import annotations

import importlib.util
import json
import os
import random
import re
import shutil
import signal
import subprocess
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from support.chaos import FULL, LINES, Chaos, Round
from support.jobs import Capture, SmallJob, run_inline

ROUNDS = 100
THIS = Round(0, "local", "driver", random.Random(0))
# What happens in any case; a blow may come when all is over.
CERTAIN = (*FULL, "damage", "hang", "segfault")


@pytest.mark.slow
def test_whatever_happens_the_next_run_puts_it_right(tmp_path: Path) -> None:
    dask = importlib.util.find_spec("distributed") is not None
    with Chaos(tmp_path / "all", dask=dask) as chaos:
        chaos.rounds(ROUNDS)
    assert all(this.struck for this in chaos.told if this.fault in CERTAIN)
    # What comes too late to disturb anything shows nothing.
    assert sum(this.struck for this in chaos.told) > 0.7 * ROUNDS
    assert sum(this.taken_up for this in chaos.told) > ROUNDS


@pytest.fixture(scope="module")
def anywhere(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Chaos]:
    with Chaos(tmp_path_factory.mktemp("calm") / "all", dask=False) as chaos:
        yield chaos


@pytest.fixture
def calm(anywhere: Chaos) -> Iterator[Chaos]:
    """A run that nothing is wrong with."""
    anywhere.forget()
    assert anywhere.run("local")[0] == 0
    anywhere.inspect(THIS, anywhere.job.output, set())
    yield anywhere
    shutil.rmtree(anywhere.job.output)
    for place in (*anywhere.temporary, anywhere.job.folder):
        for left in [*place.glob(".*"), *place.glob("*-left")]:
            left.unlink()


def rewrite(chaos: Chaos, change: Callable[[list[str]], object]) -> None:
    """Change what was told of the run."""
    log = chaos.job.output / "run.jsonl"
    lines = log.read_text().splitlines(keepends=True)
    change(lines)
    log.write_text("".join(lines))


def of_a_line(text: str) -> bool:
    return json.loads(text)["event"] == "line"


BREAKS: dict[str, Callable[[Chaos], object]] = {
    "report.json": lambda chaos: (chaos.job.output / "report.json").write_text("{}"),
    "boat.glb": lambda chaos: next(chaos.job.output.rglob("boat.glb")).unlink(),
    "surplus": lambda chaos: (chaos.job.output / "surplus").touch(),
    ".half": lambda chaos: (chaos.job.output / ".half").touch(),
    "beside": lambda chaos: (chaos.job.folder / ".beside").touch(),
    "store/tmp": lambda chaos: (chaos.cache / "store" / "tmp" / "0123").touch(),
    "animeme-left": lambda chaos: (chaos.temporary[0] / "animeme-left").touch(),
    "worker-left": lambda chaos: (chaos.temporary[1] / "worker-left").touch(),
    ": 2": lambda chaos: rewrite(chaos, lambda ls: ls.append(next(filter(of_a_line, ls)))),
    "Counter": lambda chaos: rewrite(chaos, lambda ls: ls.remove(next(filter(of_a_line, ls)))),
}


@pytest.mark.slow
@pytest.mark.parametrize("words", BREAKS)
def test_an_inspection_sees_what_is_wrong(words: str, calm: Chaos) -> None:
    BREAKS[words](calm)
    with pytest.raises(AssertionError, match=words):
        calm.inspect(THIS, calm.job.output, set())


@pytest.mark.slow
def test_an_inspection_sees_lines_that_are_done_twice_and_processes_that_stay(calm: Chaos) -> None:
    with pytest.raises(AssertionError, match="done twice"):
        calm.inspect(THIS, calm.job.output, {LINES[0]})
    with subprocess.Popen(["sleep", "600"], start_new_session=True) as stray:
        calm.cluster.groups.add(stray.pid)
        with pytest.raises(AssertionError, match="outlive their Dask worker"):
            calm.inspect(THIS, calm.job.output, set())
        stray.kill()
    calm.inspect(THIS, calm.job.output, set())
    calm.forget()
    (calm.orders / "boat").write_text("linger once")
    with pytest.raises(AssertionError, match="outlive their run") as seen:
        calm.run("local")
    for process in re.findall(r"\d+", str(seen.value).rpartition("[")[2]):
        os.kill(int(process), signal.SIGKILL)


def test_what_a_dead_worker_has_half_written_does_not_stay(job: SmallJob, capsys: Capture) -> None:
    kept = job.output / "en" / ".keep-me"
    for path in (job.output / ".0123abcd", kept.with_name(".89abcdef.glb"), kept):
        path.parent.mkdir(parents=True, exist_ok=True)
        path.touch()
    run_inline(capsys, job)  # sees that nothing hidden is left but what it does not know
    assert kept.exists()
