"""What an output lost or changed of its source: the promise, checked."""

from __future__ import annotations

import json
from collections.abc import Iterator
from typing import Any

from animeme_stages.ingest.glb import Chunk, Container

_PIECE = 1 << 20


def harm(source: Container, output: Container) -> list[str]:
    """One sentence for each old JSON value or byte that is not as it was; [] if all are.

    Allowed are: elements after the old ones of an array, new members, a longer buffer 0, and a new
    version of an animation of ours.
    """
    old, new = _exact(source.text), _exact(output.text)
    found = list(_changes(old, new, ""))
    if source.bin is not None and not (
        output.bin is not None and _is_prefix(source, source.bin, output, output.bin)
    ):
        found.append("the old binary chunk is not the beginning of the new one")
    others = [chunk for chunk in source.chunks if chunk is not source.bin]
    theirs = [chunk for chunk in output.chunks if chunk is not output.bin]
    kept = len(others) == len(theirs) and all(
        a.kind == b.kind and a.length == b.length and _is_prefix(source, a, output, b)
        for a, b in zip(others, theirs, strict=True)
    )
    if not kept:
        found.append("another chunk of the file was lost or changed")
    return found


def _exact(text: str) -> Any:
    """JSON with numbers as they are written, so that 1.0 and 1 differ."""
    return json.loads(text, parse_float=lambda s: ("number", s), parse_int=lambda s: ("number", s))


def _changes(old: Any, new: Any, pointer: str) -> Iterator[str]:
    if isinstance(old, dict) and isinstance(new, dict):
        for key, value in old.items():
            place = f"{pointer}/{key}"
            if key not in new:
                yield f"{place} is gone"
            elif place != "/buffers/0/byteLength":
                yield from _changes(value, new[key], place)
    elif isinstance(old, list) and isinstance(new, list):
        if len(new) < len(old):
            yield f"{pointer} lost elements"
        for index, (before, after) in enumerate(zip(old, new, strict=False)):
            replaced = pointer == "/animations" and "animeme" in (before.get("extras") or ())
            if not replaced:
                yield from _changes(before, after, f"{pointer}/{index}")
    elif old != new:
        yield f"{pointer} changed"


def _is_prefix(source: Container, old: Chunk, output: Container, new: Chunk) -> bool:
    if new.length < old.length:
        return False
    with source.path.open("rb") as a, output.path.open("rb") as b:
        a.seek(old.start)
        b.seek(new.start)
        for done in range(0, old.length, _PIECE):
            size = min(_PIECE, old.length - done)
            if a.read(size) != b.read(size):
                return False
    return True
