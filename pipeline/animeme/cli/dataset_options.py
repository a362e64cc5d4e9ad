"""Options and progress that the commands on datasets share."""

from __future__ import annotations

import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import click
from rich.console import Console
from rich.progress import BarColumn, TextColumn, TimeRemainingColumn
from rich.progress import Progress as Bar

from animeme import training
from animeme.dataset import Dataset, Listener
from animeme.executors.local import default_workers

# Where there is no terminal, a line this often.
_PLAIN_EVERY_S = 5.0

_OPTIONS = (
    click.option("--language", default="en", show_default=True, help="BCP-47 tag."),
    click.option("--aligner", default="pocketsphinx", show_default=True, help="A registered one."),
    click.option(
        "--lexicon", type=click.Path(path_type=Path), help="Pronunciations that go before others."
    ),
    click.option(
        "--controls", default="", help="Names or patterns to keep, for example 'jaw*,mouth*'."
    ),
    click.option(
        "--motion-rate-hz",
        type=click.FloatRange(0, min_open=True),
        help="Frames per second of CSV files that count frames.",
    ),
    click.option("--workers", type=click.IntRange(1), help="Processes; all processors by default."),
)


def dataset_options(command: Callable[..., Any]) -> Callable[..., Any]:
    """Add the options that say how to read a dataset."""
    for option in reversed(_OPTIONS):
        command = option(command)
    return command


def read(
    folder: Path,
    *,
    language: str,
    aligner: str,
    lexicon: Path | None,
    controls: str,
    motion_rate_hz: float | None,
    workers: int | None,
) -> Dataset:
    """The dataset in a folder, read with the options of `dataset_options`."""
    with progress() as listener:
        return training.read_dataset(
            folder,
            language=language,
            aligner=aligner,
            lexicon=lexicon,
            rate_hz=motion_rate_hz,
            controls=[name.strip() for name in controls.split(",") if name.strip()],
            workers=workers or default_workers(),
            listener=listener,
        )


@contextmanager
def progress() -> Iterator[Listener]:
    """A bar on a terminal, plain lines elsewhere; both on stderr."""
    if not sys.stderr.isatty():
        last = time.monotonic()

        def plain(what: str, part: float) -> None:
            nonlocal last
            if time.monotonic() - last >= _PLAIN_EVERY_S:
                last = time.monotonic()
                click.echo(f"{what}: {part:.0%}", err=True)

        yield plain
        return
    columns = (TextColumn("{task.description}"), BarColumn(), TimeRemainingColumn())
    with Bar(*columns, console=Console(stderr=True), transient=True) as bar:
        task = bar.add_task("", total=1.0)

        def listener(what: str, part: float) -> None:
            bar.update(task, description=what, completed=part)

        yield listener
