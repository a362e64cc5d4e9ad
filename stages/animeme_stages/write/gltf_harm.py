"""What an output lost or changed of its source: the promise, checked."""

from __future__ import annotations

import filecmp
import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from animeme_stages.ingest.glb import Chunk, Container
from animeme_stages.ingest.gltf_data import external_uris, local_file
from animeme_stages.ingest.gltf_document import mark_of

_PIECE = 1 << 20


def harm(source: Container, output: Container) -> list[str]:
    """One sentence for each old JSON value or byte that is not as it was; [] if all are.

    Allowed are: elements after the old ones of an array, new members, a longer buffer 0 of a GLB,
    and a new version of an animation of ours.
    """
    allowed = {
        f"/animations/{index}"
        for index, animation in enumerate(source.json.get("animations", []))
        if mark_of(animation) is not None
    }
    old, new = _exact(source.text), _exact(output.text)
    if source.bin is not None and _length(new) >= _length(old):
        allowed.add("/buffers/0/byteLength")
    found = list(_changes(old, new, "", frozenset(allowed)))
    if source.bin is not None and not (
        output.bin is not None and _is_prefix(source, source.bin, output, output.bin)
    ):
        found.append("the old binary chunk is not the beginning of the new one")
    if not _same_chunks(source, output):
        found.append("another chunk of the file was lost or changed")
    for uri in external_uris(source.json):
        before, after = local_file(source.path, uri), local_file(output.path, uri)
        if before.is_file() and not (after.is_file() and _same_files(before, after)):
            found.append(f"its file '{uri}' is not beside the output as it was")
    return found


def _exact(text: str) -> Any:
    """JSON with numbers as they are written, so that 1.0 and 1 differ."""
    return json.loads(text, parse_float=lambda s: ("number", s), parse_int=lambda s: ("number", s))


def _length(root: Any) -> float:
    """Length of buffer 0 in an `_exact` document; 0 where there is none."""
    try:
        return float(root["buffers"][0]["byteLength"][1])
    except (IndexError, KeyError, TypeError, ValueError):
        return 0.0


def _changes(old: Any, new: Any, pointer: str, allowed: frozenset[str]) -> Iterator[str]:
    if pointer in allowed:
        return
    if isinstance(old, dict) and isinstance(new, dict):
        for key, value in old.items():
            if key in new:
                yield from _changes(value, new[key], f"{pointer}/{key}", allowed)
            else:
                yield f"{pointer}/{key} is gone"
    elif isinstance(old, list) and isinstance(new, list):
        if len(new) < len(old):
            yield f"{pointer} lost elements"
        for index, (before, after) in enumerate(zip(old, new, strict=False)):
            yield from _changes(before, after, f"{pointer}/{index}", allowed)
    elif type(old) is not type(new) or old != new:
        yield f"{pointer} changed"


def _same_chunks(source: Container, output: Container) -> bool:
    """Whether every chunk but the binary one is as it was, in the same order."""
    old = [chunk for chunk in source.chunks if chunk is not source.bin]
    new = [chunk for chunk in output.chunks if chunk is not output.bin]
    return len(old) == len(new) and all(
        a.kind == b.kind and a.length == b.length and _is_prefix(source, a, output, b)
        for a, b in zip(old, new, strict=True)
    )


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


def _same_files(first: Path, second: Path) -> bool:
    return filecmp.cmp(first, second, shallow=False)
