"""How far a command has come, for people."""

from __future__ import annotations

import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager

import click

from animeme.dataset import Listener as PartListener
from animeme.runner import Listener, Progress

# Where there is no terminal, a line this often.
PLAIN_EVERY_S = 5.0


@contextmanager
def progress(*stages: str) -> Iterator[Listener]:
    """A bar per stage on a terminal, plain lines elsewhere; both on stderr."""
    if not sys.stderr.isatty():
        yield _PlainLines()
        return
    from rich.console import Console  # takes its time
    from rich.progress import BarColumn, MofNCompleteColumn, TextColumn, TimeRemainingColumn
    from rich.progress import Progress as Bar

    columns = (
        TextColumn("{task.description}"),
        BarColumn(),
        MofNCompleteColumn(),
        TimeRemainingColumn(),
        TextColumn("{task.fields[note]}"),
    )
    with Bar(*columns, console=Console(stderr=True), transient=True) as bar:
        tasks = {stage: bar.add_task(stage, total=None, note="") for stage in stages}

        def listener(event: Progress) -> None:
            note = f"{event.failed} failed" if event.failed else ""
            bar.update(tasks[event.stage], completed=event.done, total=event.total, note=note)

        yield listener


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
    """Whether a line of progress is due: every few seconds, or where one must be."""

    def __init__(self) -> None:
        self.last = time.monotonic()

    def __call__(self, must: bool = False) -> bool:
        now = time.monotonic()
        if not must and now - self.last < PLAIN_EVERY_S:
            return False
        self.last = now
        return True


class _PlainLines:
    """A line of progress every few seconds, and one at the end of each stage."""

    def __init__(self) -> None:
        self.due = _Due()

    def __call__(self, event: Progress) -> None:
        if self.due(must=event.done == event.total):
            failed = f", {event.failed} failed" if event.failed else ""
            click.echo(f"{event.stage}: {event.done}/{event.total}{failed}", err=True)
