"""A store and what a driver needs beside it, opened together."""

from __future__ import annotations

import os
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

from animeme.store.code import CodeDigests
from animeme.store.digests import Digests
from animeme.store.entries import Store, unstorable
from animeme.store.index import Index, index_path, user_cache


@dataclass(frozen=True)
class Memory:
    """What earlier runs found out.

    Attributes:
        store: results.
        index: of files on this machine, and of results by line.
        digests: of files.
        code: digests of plug-ins' code.
        lasting: it outlives the run.
    """

    store: Store
    index: Index
    digests: Digests
    code: CodeDigests
    lasting: bool


def default_store() -> Path:
    """The store of a user who names none."""
    return user_cache() / "store"


@contextmanager
def memory(folder: Path | None, *, rehash: bool = False, dry: bool = False) -> Iterator[Memory]:
    """Open the store in a folder; None opens one that is gone afterwards.

    Args:
        folder: of the store.
        rehash: read files, whether or not they look as they did.
        dry: write nothing at all.

    Raises:
        InputError: the folder cannot be made or written.
    """
    if folder is None:
        with tempfile.TemporaryDirectory(prefix="animeme-") as gone:
            yield _opened(Path(gone), Index(None), lasting=False, rehash=rehash)
        return
    if dry:
        path = index_path(folder)
        with Index(path if path.is_file() else None, dry=True) as index:
            yield _opened(folder, index, lasting=True, rehash=rehash)
        return
    try:
        folder.mkdir(parents=True, exist_ok=True)
        if not os.access(folder, os.W_OK):
            raise PermissionError(13, "Permission denied")
    except OSError as error:
        raise unstorable(folder, error) from error
    with Index(index_path(folder)) as index:
        opened = _opened(folder, index, lasting=True, rehash=rehash)
        opened.store.sweep()
        try:
            yield opened
        finally:
            opened.digests.settle()


def _opened(folder: Path, index: Index, *, lasting: bool, rehash: bool) -> Memory:
    # Workers may have another working folder.
    digests = Digests(index, rehash=rehash)
    return Memory(Store(folder.absolute()), index, digests, CodeDigests(index, digests), lasting)
