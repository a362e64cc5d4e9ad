"""The folder of a run that is gone after it, and what is left of runs that were killed."""

from __future__ import annotations

import os
import re
import shutil
import socket
import tempfile
import time
from collections.abc import Iterable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from animeme.files import unwritable
from animeme.store.entries import ABANDONED_S, alive

_PREFIX = ".animeme-"
_SCRATCH = re.compile(r"\.[0-9a-f]{8}(\.\w+)?")  # as `animeme.files.atomic_path` names them


@contextmanager
def output_folder(output: Path) -> Iterator[Path]:
    """Make the output folder; give a spool folder in it, gone afterwards.

    What a run that was killed has left in it is removed, unless another one is at work there.

    Raises:
        InputError: the folder cannot be made or written.
    """
    made = [folder for folder in (output, *output.parents) if not folder.exists()]
    try:
        output.mkdir(parents=True, exist_ok=True)
        _sweep(output)
        name = f"{_PREFIX}{socket.gethostname()}-{os.getpid()}-"
        spool = Path(tempfile.mkdtemp(prefix=name, dir=output))
    except OSError as error:
        raise unwritable(output, error) from error
    try:
        yield spool
    finally:
        shutil.rmtree(spool, ignore_errors=True)
        for folder in made:  # nothing came of the run: leave no empty folders either
            if folder.is_dir() and not any(folder.iterdir()):
                folder.rmdir()


def _sweep(output: Path) -> None:
    left = [path for path in output.glob(f"{_PREFIX}*") if path.is_dir()]
    dead = [path for path in left if _is_dead(path)]
    for path in dead:
        shutil.rmtree(path, ignore_errors=True)
    if dead and len(dead) == len(left):  # nobody is writing here
        for folder, _, names in os.walk(output):
            for name in names:
                if _SCRATCH.fullmatch(name):
                    with suppress(OSError):
                        os.unlink(os.path.join(folder, name))


def sweep_hidden(output: Path, paths: Iterable[str]) -> None:
    """Remove what workers that died in this run have left half-written.

    Args:
        output: the folder; nothing is removed if another run is at work there.
        paths: hidden files below it.
    """
    if sum(path.is_dir() for path in output.glob(f"{_PREFIX}*")) > 1:
        return
    for path in paths:
        if _SCRATCH.fullmatch(os.path.basename(path)):
            with suppress(OSError):
                os.unlink(path)


def _is_dead(spool: Path) -> bool:
    """Whether the run that a spool folder belongs to has ended."""
    host, _, process = spool.name.removeprefix(_PREFIX).rpartition("-")[0].rpartition("-")
    if host == socket.gethostname() and process.isdecimal():
        return not alive(int(process))
    return time.time() - spool.stat().st_mtime > ABANDONED_S
