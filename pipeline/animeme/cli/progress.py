"""How far a command has come, for people."""

from __future__ import annotations

import sys
import threading
import time
from collections import deque
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING

import click

from animeme.work import Progress

if TYPE_CHECKING:
    from animeme.dataset import Listener as PartListener

# Where there is no terminal, a line this often.
PLAIN_EVERY_S = 5.0
# A rate is that of the last half minute: lines differ, and processes take a moment to start.
_WINDOW_S = 30.0


class Teller:
    """A listener that knows how fast the work goes.

    Args:
        show: called with each event, when it has been taken in.

    Attributes:
        last: stage → what was told of it last, in the order in which they began.
    """

    def __init__(self, show: Callable[[Progress], object] = lambda _: None) -> None:
        self.last: dict[str, Progress] = {}
        self._show = show
        self._past: deque[tuple[float, int]] = deque()

    def __call__(self, event: Progress) -> None:
        """Take in an event."""
        now = time.monotonic()
        if event.stage not in self.last:
            self._past = deque([(now, event.done)])
        elif event.done > self._past[-1][1]:
            self._past.append((now, event.done))
        self.last[event.stage] = event
        self._show(event)

    def said(self) -> str:
        """The stage that is going on: done, failed, rate and time left; "" before the first."""
        if not self.last:
            return ""
        event = list(self.last.values())[-1]
        text = f"{event.stage}: {event.done}/{event.total}"
        text += f", {event.failed} failed" if event.failed else ""
        rate = self._rate()
        if rate and event.done < event.total:
            left = duration((event.total - event.done) / rate)
            text += f", {rate:.1f}/s" if rate >= 1 else f", {60 * rate:.1f}/min"
            text += f", {left} left"
        return text

    def _rate(self) -> float:
        """How many a second have been done of late; those that were known are not among them."""
        now = time.monotonic()
        past = self._past
        while len(past) > 2 and now - past[1][0] > _WINDOW_S:
            past.popleft()
        count, span = past[-1][1] - past[0][1], now - past[0][0]
        return count / span if count and span > 0 else 0.0


def duration(seconds: float) -> str:
    """A time as people say it: "8 s", "12 min", "3 h 05 min"."""
    if seconds < 60:
        return f"{max(1, round(seconds))} s"
    minutes = round(seconds / 60)
    return f"{minutes} min" if minutes < 60 else f"{minutes // 60} h {minutes % 60:02} min"


@contextmanager
def progress() -> Iterator[Teller]:
    """One line that changes on a terminal, a plain line every few seconds elsewhere; on stderr."""
    if not sys.stderr.isatty():
        with _PlainLines() as lines:
            yield lines
        return
    from rich.console import Console  # takes its time
    from rich.progress import BarColumn, ProgressColumn, SpinnerColumn, Task
    from rich.progress import Progress as Bar
    from rich.text import Text

    class Said(ProgressColumn):
        """What is being done; drawn again and again, so that the time left goes on."""

        def render(self, task: Task) -> Text:
            return Text(teller.said() or "getting ready")

    bar = Bar(SpinnerColumn(), BarColumn(), Said(), console=Console(stderr=True), transient=True)
    task = bar.add_task("", total=None)
    teller = Teller(lambda event: bar.update(task, completed=event.done, total=event.total))
    with bar:
        yield teller


@contextmanager
def parts() -> Iterator[PartListener]:
    """A bar of what is done of one thing after the other, 0 to 1; elsewhere plain lines."""
    if not sys.stderr.isatty():
        due = _Due()

        def plain(what: str, part: float) -> None:
            if due():
                click.echo(f"{what}: {part:.0%}", err=True)

        yield plain
        return
    from rich.console import Console  # takes its time
    from rich.progress import BarColumn, TextColumn, TimeRemainingColumn
    from rich.progress import Progress as Bar

    columns = (TextColumn("{task.description}"), BarColumn(), TimeRemainingColumn())
    with Bar(*columns, console=Console(stderr=True), transient=True) as bar:
        task = bar.add_task("", total=1.0)
        yield lambda what, part: bar.update(task, description=what, completed=part)


class _Due:
    """Whether a line of progress is due: every few seconds."""

    def __init__(self) -> None:
        self.last = time.monotonic()

    def __call__(self) -> bool:
        now = time.monotonic()
        if now - self.last < PLAIN_EVERY_S:
            return False
        self.last = now
        return True


class _PlainLines(Teller):
    """A line when a stage begins and ends, and every few seconds, also while nothing ends."""

    def __init__(self) -> None:
        super().__init__()
        self._ended = threading.Event()
        self._ticker = threading.Thread(target=self._tick, daemon=True)
        self._lock = threading.Lock()
        self._told = ""

    def __enter__(self) -> _PlainLines:
        self._ticker.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._ended.set()
        self._ticker.join()

    def __call__(self, event: Progress) -> None:
        with self._lock:
            first = event.stage not in self.last
            super().__call__(event)
            if first or event.done == event.total:
                self._tell()

    def _tick(self) -> None:
        while not self._ended.wait(PLAIN_EVERY_S):
            with self._lock:
                self._tell()

    def _tell(self) -> None:
        text = self.said() or "getting ready"
        if text != self._told:
            click.echo(text, err=True)
        self._told = text
