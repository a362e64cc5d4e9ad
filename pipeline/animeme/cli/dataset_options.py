"""Options that the commands on datasets share."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import click

from animeme import training
from animeme.cli import options as shared
from animeme.cli.progress import parts
from animeme.dataset import Dataset
from animeme.executors.local import default_workers

_OPTIONS = (
    click.option("--language", default="en", show_default=True, help="BCP-47 tag."),
    shared.aligner,
    shared.lexicon,
    click.option(
        "--controls", default="", help="Names or patterns to keep, for example 'jaw*,mouth*'."
    ),
    click.option(
        "--motion-rate-hz",
        type=click.FloatRange(0, min_open=True),
        help="Frames per second of CSV files that count frames.",
    ),
    shared.workers,
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
    with parts() as listener:
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
