"""What an output lost or changed of its source: the promise, checked."""

from __future__ import annotations

import filecmp
import json
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import Any

from animeme_stages.ingest.glb import Chunk, Container
from animeme_stages.ingest.gltf_data import external_uris, local_file
from animeme_stages.ingest.gltf_document import MALFORMED, mark_of
from animeme_stages.write.glb import pieces
from animeme_stages.write.gltf_origin import our_lines, past_of
from animeme_stages.write.gltf_source import Source

# Members of what was there that say nothing of what is seen, or whose meaning is not known here.
_FREE = frozenset({"extras", "extensions", "name"})


def harm(source: Source, output: Container) -> list[str]:
    """One sentence for each old JSON value or byte that is not as it was; [] if all are.

    Allowed are: elements after the old ones of an array; new members of the root and of ``asset``,
    and new names, extras and extensions anywhere; a longer buffer 0 of a GLB; and new versions of
    our own animations. Where `source` is itself an earlier output of ours, its own source has to be
    in `output`, and every line that it had.
    """
    lost = sorted(set(our_lines(source.given)) - set(our_lines(output)))
    found = [f"the line '{name}' of an earlier run is gone" for name in lost]
    before, after = source.container, past_of(output, verified=False)
    if after is None or not _same_text(before, after.source):
        # The quick way is to take what is ours out again; this one says what differs.
        found += _json_changes(before, output)
    if before.bin is not None and not (
        output.bin is not None
        and output.bin.length >= before.bin.length
        and _begins(output, output.bin, source.chunk())
    ):
        found.append("the old binary chunk is not the beginning of the new one")
    if not _same_chunks(before, output):
        found.append("another chunk of the file was lost or changed")
    for uri in external_uris(before.json):
        theirs, copy = local_file(before.path, uri), local_file(output.path, uri)
        if theirs.is_file() and not (copy.is_file() and _same_files(theirs, copy)):
            found.append(f"its file '{uri}' is not beside the output as it was")
    return found


def _same_text(source: Container, other: Container) -> bool:
    return source.text == other.text and source.json_bytes == other.json_bytes


def _json_changes(source: Container, output: Container) -> list[str]:
    allowed = {
        f"/animations/{index}"
        for index, animation in enumerate(source.json.get("animations", []))
        if mark_of(animation) is not None
    }
    old, new = _exact(source.text), _exact(output.text)
    if source.bin is not None and _length(new) >= _length(old):
        allowed.add("/buffers/0/byteLength")
    return list(_changes(old, new, allowed))


def _exact(text: str) -> Any:
    """JSON with numbers as they are written, so that 1.0 and 1 differ."""
    return json.loads(text, parse_float=lambda s: ("number", s), parse_int=lambda s: ("number", s))


def _length(root: Any) -> float:
    """Length of buffer 0 in an `_exact` document; 0 where there is none."""
    try:
        return float(root["buffers"][0]["byteLength"][1])
    except MALFORMED:
        return 0.0


def _changes(old: Any, new: Any, allowed: set[str]) -> Iterator[str]:
    pending = [("", old, new)]
    while pending:
        pointer, before, after = pending.pop()
        if pointer in allowed:
            continue
        if isinstance(before, dict) and isinstance(after, dict):
            for key, value in before.items():
                if key in after:
                    pending.append((f"{pointer}/{key}", value, after[key]))
                else:
                    yield f"{pointer}/{key} is gone"
            # What was left to its default is set: a node moves, a material shines through.
            for key in () if pointer.count("/") < 2 else sorted(after.keys() - before.keys()):
                if _FREE.isdisjoint((key, *pointer.split("/"))):
                    yield f"{pointer}/{key} is new"
        elif isinstance(before, list) and isinstance(after, list):
            if len(after) < len(before):
                yield f"{pointer} lost elements"
            pairs = enumerate(zip(before, after, strict=False))
            pending += [(f"{pointer}/{index}", *pair) for index, pair in pairs]
        elif type(before) is not type(after) or before != after:
            yield f"{pointer} changed"


def _same_chunks(source: Container, output: Container) -> bool:
    """Whether every chunk but the binary one is as it was, in the same order."""
    old = [chunk for chunk in source.chunks if chunk is not source.bin]
    new = [chunk for chunk in output.chunks if chunk is not output.bin]
    if len(old) != len(new):
        return False
    with source.path.open("rb") as stream:
        return all(
            a.kind == b.kind and a.length == b.length and _begins(output, b, pieces(stream, a))
            for a, b in zip(old, new, strict=True)
        )


def _begins(output: Container, chunk: Chunk, data: Iterable[bytes]) -> bool:
    """Whether a chunk of the output, as it lies on disk, begins with some pieces of data."""
    with output.path.open("rb") as stream:
        stream.seek(chunk.start)
        return all(stream.read(len(piece)) == piece for piece in data)


def _same_files(first: Path, second: Path) -> bool:
    return filecmp.cmp(first, second, shallow=False)
