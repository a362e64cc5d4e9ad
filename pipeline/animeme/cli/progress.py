"""How far a command has come, for people."""

from __future__ import annotations

import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager

import click
from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, TextColumn, TimeRemainingColumn
from rich.progress import Progress as Bar

from animeme.runner import Listener, Progress

# Where there is no terminal, a line this often.
PLAIN_EVERY_S = 5.0


@contextmanager
def progress(*stages: str) -> Iterator[Listener]:
    """A bar per stage on a terminal, plain lines elsewhere; both on stderr."""
    if not sys.stderr.isatty():
        yield _PlainLines()
        return
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


class _PlainLines:
    """A line of progress every few seconds, and one at the end of each stage."""

    def __init__(self) -> None:
        self.last = time.monotonic()

    def __call__(self, event: Progress) -> None:
        now = time.monotonic()
        if now - self.last >= PLAIN_EVERY_S or event.done == event.total:
            self.last = now
            failed = f", {event.failed} failed" if event.failed else ""
            click.echo(f"{event.stage}: {event.done}/{event.total}{failed}", err=True)
