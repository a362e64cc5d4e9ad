"""Looking after a store: how much there is, whether it is sound, and less of it.

All of it may go on while runs use the store: what one of them misses it makes again.
"""

from __future__ import annotations

from contextlib import suppress
from dataclasses import dataclass
from datetime import UTC, datetime

from animeme.store.entries import Store


@dataclass(frozen=True)
class Survey:
    """What is in a store.

    Attributes:
        results: how many.
        size: of all, in bytes.
        oldest, newest: when the one longest unused and the last one used were, in ISO 8601 and UTC;
            None if there is none.
    """

    results: int
    size: int
    oldest: str | None
    newest: str | None


def survey(store: Store) -> Survey:
    """Count what is in a store."""
    files = [*store.files()]
    used = [file.used for file in files]

    def at(seconds: float) -> str:
        return datetime.fromtimestamp(seconds, UTC).isoformat(timespec="seconds")

    ends = (at(min(used)), at(max(used))) if used else (None, None)
    return Survey(len(files), sum(file.size for file in files), *ends)


def verify(store: Store) -> tuple[int, list[str]]:
    """Read every entry and remove those that are damaged.

    Returns:
        How many were read, and the keys of those that are removed.
    """
    checked = 0
    damaged = []
    for file in store.files():
        checked += 1
        if store.get(file.key) is None:
            with suppress(OSError):
                file.path.unlink()
                damaged.append(file.key)
    return checked, sorted(damaged)


def collect(store: Store, most: int) -> tuple[int, int, int]:
    """Remove entries, the longest unused first, until `most` bytes are left at the most.

    Returns:
        How many were removed, bytes that they had, bytes left.
    """
    store.sweep()
    files = sorted(store.files(), key=lambda file: (file.used, file.key))
    left = sum(file.size for file in files)
    removed = freed = 0
    for file in files:
        if left <= most:
            break
        with suppress(OSError):
            file.path.unlink()
            removed, freed, left = removed + 1, freed + file.size, left - file.size
    return removed, freed, left
