"""The source out of an output: what an output remembers of it, and how that is used.

The buffer view of what we append carries a note of what was there before: how long each
list was, what was replaced, how long JSON and binary chunk were, and a checksum of the whole. With
it an output gives its source back byte for byte, which `animeme strip` does; and a run upon an
earlier output starts from the source again, so that files do not grow.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

from animeme.errors import InputError
from animeme_stages.ingest.glb import Chunk, Container
from animeme_stages.ingest.gltf_document import MALFORMED, line_of, mark_of
from animeme_stages.write.glb import checksum, stored
from animeme_stages.write.json_splice import Splice

# Top-level lists that get elements.
LISTS = ("buffers", "bufferViews", "accessors", "animations")
# A source may be padded with NULs by more than what is appended to its JSON; within reason.
_MOST_PADDING = 4096


@dataclass(frozen=True)
class Origin:
    """What an output remembers of its source.

    Attributes:
        json_bytes: length of its JSON as stored.
        nul_bytes: how many of these are NULs at the end, which some exporters pad with.
        bin_bytes: length of its binary chunk, None where there was none.
        lists: of each of `LISTS` the number of elements and `Splice.length`; None where there was
            no such list.
        replaced: (list, index, member) → the JSON text that was there; the member is "" where the
            whole element was replaced.
        crc32: of the whole file.
    """

    json_bytes: int
    nul_bytes: int
    bin_bytes: int | None
    lists: Mapping[str, tuple[int, int] | None]
    replaced: Mapping[tuple[str, int, str], str]
    crc32: int

    def to_json(self) -> dict[str, Any]:
        """As it stands in the file."""
        return {
            "json_bytes": self.json_bytes,
            "nul_bytes": self.nul_bytes,
            "bin_bytes": self.bin_bytes,
            "lists": dict(self.lists),
            "replaced": [[*place, text] for place, text in self.replaced.items()],
            "crc32": self.crc32,
        }

    @classmethod
    def from_json(cls, note: Mapping[str, Any]) -> Origin:
        """Read what `to_json` wrote; anything may be raised if it is something else."""
        return cls(
            note["json_bytes"],
            note["nul_bytes"],
            note["bin_bytes"],
            {name: note["lists"][name] and tuple(note["lists"][name]) for name in LISTS},
            {(name, index, member): text for name, index, member, text in note["replaced"]},
            note["crc32"],
        )


@dataclass(frozen=True)
class Past:
    """An output of ours, taken apart again.

    Attributes:
        origin: what it remembers.
        source: its source; the bytes lie in the output's own file.
        animations: those of ours, in order.
    """

    origin: Origin
    source: Container
    animations: tuple[Mapping[str, Any], ...]


def past_of(container: Container, *, verified: bool = True) -> Past | None:
    """What became of the source of an output of ours; None where that cannot be told any more.

    Args:
        container: any glTF.
        verified: compare the source with its checksum, which reads the whole file.
    """
    try:
        note = _note(container)
        if note is None:
            return None
        origin = Origin.from_json(note)
        source = _source(container, origin)
        if verified and (checksum(stored(source)) != origin.crc32 or not source.json):
            return None
        first = len(source.json.get("animations", []))  # the note may have been edited
        ours = container.json["animations"][first:]
        replaced = [index for name, index, member in origin.replaced if name == "animations"]
        ours = [*(container.json["animations"][index] for index in replaced), *ours]
        sound = all(line_of(animation) for animation in ours)
    except (InputError, RecursionError, *MALFORMED):
        return None
    return Past(origin, source, tuple(ours)) if sound else None


def our_lines(container: Container) -> list[str]:
    """Names of the lines whose animations of ours are in a file."""
    animations = container.json.get("animations")
    each = animations if isinstance(animations, list) else []
    found = [line_of(animation) for animation in each if isinstance(animation, dict)]
    return [line[0] for line in found if line is not None]


def _note(container: Container) -> Mapping[str, Any] | None:
    """The youngest note; what an output was made from may hold older ones."""
    notes = (mark_of(view) for view in reversed(container.json.get("bufferViews", [])))
    return next((note for note in notes if note is not None), None)


def _source(container: Container, origin: Origin) -> Container:
    text = _source_text(container, origin)
    if not 0 <= origin.nul_bytes <= origin.json_bytes <= container.json_bytes + _MOST_PADDING:
        raise ValueError("no such source")
    excess = len(text.encode("utf-8")) - (origin.json_bytes - origin.nul_bytes)
    if excess < 0 or text[len(text) - excess :].strip(" "):  # what is more is the output's padding
        raise ValueError("not the JSON that there was")
    text = text[: len(text) - excess]
    chunks = container.chunks
    if container.binary:
        if container.bin is not None:
            old = _shortened(container.bin, origin.bin_bytes)
            chunks = (*old, *chunks[1:])
        elif origin.bin_bytes is not None:
            raise ValueError("the binary chunk is gone")
    return Container(container.path, text, chunks, container.binary, origin.json_bytes)


def _shortened(chunk: Chunk, length: int | None) -> tuple[Chunk, ...]:
    if length is None:
        return ()
    if not 0 <= length <= chunk.length:
        raise ValueError("the binary chunk is shorter than it was")
    return (replace(chunk, length=length),)


def _source_text(container: Container, origin: Origin) -> str:
    splice = Splice(container.text)
    longer = dict.fromkeys(LISTS, 0)  # by what was replaced within them
    for (name, index, member), text in origin.replaced.items():
        span = splice.elements(splice.members()[name][0])[index]
        span = splice.members(span[0])[member] if member else span
        longer[name] += span[1] - span[0] - len(text)
        splice.replace_text(span, text)
    for name, extent in origin.lists.items():
        if extent is None:
            splice.remove(name)
        else:
            splice.truncate(name, extent[1] + longer[name])
    return splice.apply()
