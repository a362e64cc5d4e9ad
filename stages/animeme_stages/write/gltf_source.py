"""The asset that lines go into, read once by a worker for all files that it writes from it."""

from __future__ import annotations

import time
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

from animeme.files import stamp, telling
from animeme_stages.ingest.glb import Container, open_container
from animeme_stages.write.glb import checksum_of, pieces
from animeme_stages.write.gltf_origin import Past, past_of

# Bytes of a binary chunk; a longer one is read from disk for every file. A worker's memory may grow
# by that much for each asset that is kept.
_MOST_KEPT = 1 << 25
_ASSETS = 2
_known: dict[Path, tuple[str, Source]] = {}


@dataclass(frozen=True, eq=False)
class Source:
    """An asset; what is needed of it is read when it is first asked for.

    Attributes:
        given: its file.
    """

    given: Container

    @cached_property
    def past(self) -> Past | None:
        """What it remembers of its own source, None if it is no output of ours."""
        return past_of(self.given)

    @property
    def container(self) -> Container:
        """What to append to: the file itself or, of an earlier output, its source."""
        return self.past.source if self.past else self.given

    @cached_property
    def crc32(self) -> int:
        """CRC-32 of the file that `container` is."""
        return self.past.origin.crc32 if self.past else checksum_of(self.given.path)

    def chunk(self) -> Iterator[bytes]:
        """The binary chunk of `container`, in pieces.

        Raises:
            InputError: the file is shorter by now.
        """
        return iter(self.kept) if self.kept else self._pieces()

    @cached_property
    def kept(self) -> tuple[bytes, ...]:
        """What `chunk` gives, if it may stay in memory; else ()."""
        chunk = self.container.bin
        return tuple(self._pieces()) if chunk and chunk.length <= _MOST_KEPT else ()

    def _pieces(self) -> Iterator[bytes]:
        if self.container.bin is not None:
            with self.given.path.open("rb") as stream:
                yield from pieces(stream, self.container.bin)


def source_of(path: Path) -> Source:
    """The asset at `path` as it is now.

    It is opened again when it looks different, and while it may change without any sign of it.

    Raises:
        InputError: as of `open_container`.
    """
    stamped = stamp(path)
    known = _known.pop(path, None)  # other threads may look, too
    if known is not None and known[0] == stamped:
        _known[path] = known
        return known[1]
    shows = bool(stamped) and telling(stamped, time.time_ns())
    source = Source(open_container(path))
    if shows and source.given.is_short:
        for oldest in [*_known][: max(0, len(_known) + 1 - _ASSETS)]:
            _known.pop(oldest, None)
        _known[path] = stamped, source
    return source
