"""Writing line animations into glTF by appending.

Nothing is serialised anew: the JSON text gets new elements, the binary chunk gets new bytes behind
the old ones, and the rest is copied.
"""

from __future__ import annotations

import base64
import struct
from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import chain, count
from pathlib import Path
from typing import Any, BinaryIO, ClassVar
from urllib.parse import quote

import numpy as np
from numpy.typing import NDArray

from animeme.contracts import LineAnimation, Verify, unverified
from animeme.curves import CurveSet
from animeme.delivery import StoredTrack
from animeme.errors import InputError
from animeme.files import atomic_path
from animeme.rig import Character, MeshShapes
from animeme_stages.ingest.glb import Chunk, Container, open_container
from animeme_stages.ingest.gltf import load_gltf
from animeme_stages.ingest.gltf_data import external_uris, local_file, weight_animations
from animeme_stages.ingest.gltf_document import mark_of, marked
from animeme_stages.ingest.gltf_stored import stored
from animeme_stages.write.gltf_files import companions, side_car_name
from animeme_stages.write.gltf_harm import harm
from animeme_stages.write.json_splice import Splice

_FLOAT = 5126


@dataclass
class _Appended:
    """Accessors and bytes on their way into the file."""

    first_accessor: int
    view: int
    accessors: list[dict[str, Any]] = field(default_factory=list)
    data: bytearray = field(default_factory=bytearray)

    def floats(self, values: NDArray[np.float32], *, bounds: bool = False) -> int:
        """Append a scalar accessor and return its index."""
        flat = np.ascontiguousarray(values, "<f4").reshape(-1)
        accessor = {
            "bufferView": self.view,
            "byteOffset": len(self.data),
            "componentType": _FLOAT,
            "count": len(flat),
            "type": "SCALAR",
        }
        if bounds:
            accessor |= {"min": [float(flat.min())], "max": [float(flat.max())]}
        self.data += flat.tobytes()
        self.accessors.append(accessor)
        return self.first_accessor + len(self.accessors) - 1


class GltfFormat:
    """glTF 2.0: ``.glb``, ``.gltf`` and ``.vrm``."""

    name: ClassVar[str] = "gltf"
    suffixes: ClassVar[tuple[str, ...]] = (".glb", ".gltf", ".vrm")
    assembly_suffix: ClassVar[str] = ""  # glTF has no variants of animations

    def output_suffix(self, source: Path) -> str:
        """As the source's: a GLB stays one."""
        return source.suffix.lower()

    def load(self, path: Path) -> Character:
        """The character in the file; see `animeme.contracts.Format`."""
        return load_gltf(path)

    def companions(self, character: Character) -> dict[str, Path]:
        """Buffers and images in files of their own; see `animeme.contracts.Format`."""
        source = character.source
        files = (local_file(source, uri) for uri in external_uris(open_container(source).json))
        return {file.relative_to(source.parent).as_posix(): file for file in files}

    def write(
        self,
        character: Character,
        lines: Sequence[LineAnimation],
        target: Path,
        *,
        verify: Verify = unverified,
    ) -> tuple[Path, ...]:
        """Write the source with one animation per line appended.

        One channel per node whose mesh owns a driven shape; nodes with the same targets share a
        sampler, all channels of a line share its times.
        """
        container = open_container(character.source)
        beside = companions(container.path, external_uris(container.json), target)
        appended = _Appended(
            len(container.json.get("accessors", [])), len(container.json.get("bufferViews", []))
        )
        animations = _animations(lines, character, container, appended)
        for animation in animations if beside.uris else ():
            animation["extras"] = marked({**animation["extras"]["animeme"], "asset": beside.asset})
        name = None if container.binary else side_car_name(target, beside.uris)
        text = _edited(container, appended, animations, uri=quote(name) if name else None)
        written = [target, *beside.copy()]
        if name and appended.data:
            side_car = target.with_name(name)
            with atomic_path(side_car) as scratch:
                scratch.write_bytes(appended.data)
            written.append(side_car)
        with atomic_path(target) as scratch:
            if container.binary:
                with scratch.open("wb") as stream:
                    _write_glb(stream, container, text, appended)
            else:
                scratch.write_text(text, encoding="utf-8", newline="")
            verify(scratch)
        return tuple(written)

    def write_assembly(
        self,
        character: Character,
        by_language: Mapping[str, Path],
        target: Path,
        *,
        verify: Verify = unverified,
    ) -> tuple[Path, ...]:
        """Write nothing: each language stays a file of its own."""
        return ()

    def read_animations(self, path: Path) -> dict[str, CurveSet]:
        """Weight curves of every linear animation in the file."""
        return weight_animations(open_container(path), load_gltf(path))

    def stored(self, character: Character) -> tuple[StoredTrack, ...]:
        """Weights as they are stored; see `animeme.delivery.StoredReader`."""
        return stored(character)

    def harm(self, character: Character, output: Path) -> list[str]:
        """What `output` lost or changed of the source; see `animeme.contracts.Format`."""
        return harm(open_container(character.source), open_container(output))


def _animations(
    lines: Sequence[LineAnimation],
    character: Character,
    container: Container,
    appended: _Appended,
) -> list[dict[str, Any]]:
    """The glTF animation of each line; their data goes to `appended`."""
    spoken = {(line.name, line.language) for line in lines}
    # Names of all that stays: animations of others, and ours of lines that are not written now.
    taken = {
        str(animation.get("name"))
        for animation in container.json.get("animations", [])
        if _line_of(animation) not in spoken
    }
    made = []
    for line in lines:
        animation = _animation(line, character, appended)
        if animation["channels"]:
            animation["name"] = _free_name(line, taken)
            taken.add(animation["name"])
            made.append(animation)
    return made


def _line_of(animation: Mapping[str, Any]) -> tuple[str, str] | None:
    """Line and language of an animation of ours, None for somebody else's."""
    note = mark_of(animation)
    return (str(note.get("line")), str(note.get("language"))) if note is not None else None


def _animation(line: LineAnimation, character: Character, appended: _Appended) -> dict[str, Any]:
    """The glTF animation of one line; its data goes to `appended`."""
    columns = {name: index for index, name in enumerate(line.curves.names)}
    unknown = set(columns) - set(character.canonical.values())
    if unknown:
        raise ValueError(f"{character.source} has no shape {', '.join(sorted(unknown))}")
    times_s, weights = _as_floats(line.curves)
    channels: list[dict[str, Any]] = []
    samplers: dict[tuple[Any, ...], int] = {}
    made: list[dict[str, Any]] = []
    time_accessor = -1
    for mesh in character.meshes:
        targets = tuple(columns.get(character.canonical[name], -1) for name in mesh.shapes)
        if max(targets) < 0:
            continue
        if time_accessor < 0:
            time_accessor = appended.floats(times_s, bounds=True)
        key = (targets, mesh.rest)
        if key not in samplers:
            samplers[key] = len(made)
            output = appended.floats(_mesh_weights(mesh, targets, weights))
            made.append({"input": time_accessor, "interpolation": "LINEAR", "output": output})
        node = int(mesh.path.rpartition("/")[2])
        target = {"node": node, "path": "weights"}
        channels.append({"sampler": samplers[key], "target": target})
    note = {"line": line.name, "language": line.language, "duration_s": line.duration_s}
    if line.audio_start_s:
        note["audio_start_s"] = line.audio_start_s
    if line.events:
        note["events"] = [{"tag": e.tag, "time_s": e.time_s} for e in line.events]
    return {"name": line.name, "channels": channels, "samplers": made, "extras": marked(note)}


def _free_name(line: LineAnimation, taken: Collection[str]) -> str:
    """The line's name, with its language or a number where that name is taken."""
    candidates = chain(
        (line.name, f"{line.name}_{line.language}"),
        (f"{line.name}_{line.language}_{number}" for number in count(2)),
    )
    return next(name for name in candidates if name not in taken)


def _as_floats(curves: CurveSet) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """Times and weights as float32; keys that coincide in float32 are one key."""
    times_s = curves.times_s.astype(np.float32)
    keep = np.append(True, np.diff(times_s) > 0)
    return times_s[keep], curves.weights[keep].astype(np.float32)


def _mesh_weights(
    mesh: MeshShapes, targets: tuple[int, ...], weights: NDArray[np.float32]
) -> NDArray[np.float32]:
    """All targets of a mesh per key, shape (T, targets); undriven ones at rest."""
    full = np.tile(np.array(mesh.rest, np.float32), (len(weights), 1))
    for column, source in enumerate(targets):
        if source >= 0:
            full[:, column] = weights[:, source]
    return full


def _edited(
    container: Container,
    appended: _Appended,
    animations: Sequence[Mapping[str, Any]],
    *,
    uri: str | None,
) -> str:
    """The source's JSON text with everything new in it.

    Args:
        container: the source.
        appended: new accessors and bytes.
        animations: new animations.
        uri: side-car that holds the bytes; None to put them behind the GLB's own.
    """
    splice = Splice(container.text)
    size = len(appended.data)
    if size:
        buffer, start = _put_buffer(splice, container, appended, uri)
        view = {"buffer": buffer, "byteOffset": start, "byteLength": size}
        splice.append("bufferViews", [view])
        splice.append("accessors", appended.accessors)
    _put_animations(splice, container, animations)
    return splice.apply()


def _put_buffer(
    splice: Splice, container: Container, appended: _Appended, uri: str | None
) -> tuple[int, int]:
    """Make room for the new bytes; returns the buffer's index and where in it they begin."""
    buffers = container.json.get("buffers", [])
    size = len(appended.data)
    first_is_chunk = not buffers or "uri" not in buffers[0]
    if uri is None and first_is_chunk and (container.bin or not buffers):
        start = container.bin.length if container.bin else 0
        if buffers:
            first = splice.elements(splice.members()["buffers"][0])[0]
            splice.set(first[0], "byteLength", start + size)
        else:
            splice.append("buffers", [{"byteLength": start + size}])
        return 0, start
    if uri is None:
        # A GLB that keeps its buffers elsewhere has no chunk to append to.
        encoded = base64.b64encode(appended.data).decode()
        uri = f"data:application/octet-stream;base64,{encoded}"
        appended.data.clear()
    splice.append("buffers", [{"uri": uri, "byteLength": size}])
    return len(buffers), 0


def _put_animations(
    splice: Splice, container: Container, animations: Sequence[Mapping[str, Any]]
) -> None:
    """Append animations; one that we made before of the same line is replaced."""
    old = {
        line: index
        for index, animation in enumerate(container.json.get("animations", []))
        if (line := _line_of(animation)) is not None
    }
    spans = splice.elements(splice.members()["animations"][0]) if old else []
    new = []
    for animation in animations:
        line = _line_of(animation)
        if line in old:
            splice.replace(spans[old[line]], animation)
        else:
            new.append(animation)
    splice.append("animations", new)


def _write_glb(stream: BinaryIO, container: Container, text: str, appended: _Appended) -> None:
    """Header, JSON, old binary with the new bytes behind it, and every other chunk as it was."""
    encoded = text.encode("utf-8")
    encoded += b" " * (-len(encoded) % 4)
    data = bytes(appended.data)
    old = container.bin
    bin_length = (old.length if old else 0) + len(data)
    others = [chunk for chunk in container.chunks if chunk is not old]
    has_bin = old is not None or bool(data)
    total = 12 + 8 + len(encoded) + sum(8 + chunk.length for chunk in others)
    total += 8 + bin_length if has_bin else 0
    if total > 0xFFFFFFFF:
        raise InputError(
            "asset-too-large",
            "would pass 4 GiB, the most a GLB can hold",
            place=str(container.path),
            action='Use layout = "per-line".',
        )
    stream.write(struct.pack("<4sII", b"glTF", 2, total))
    stream.write(struct.pack("<I4s", len(encoded), b"JSON") + encoded)
    with container.path.open("rb") as source:
        if has_bin:
            stream.write(struct.pack("<I4s", bin_length, b"BIN\0"))
            if old:
                _copy(source, stream, old)
            stream.write(data)
        for chunk in others:
            stream.write(struct.pack("<II", chunk.length, chunk.kind))
            _copy(source, stream, chunk)


def _copy(source: BinaryIO, stream: BinaryIO, chunk: Chunk) -> None:
    for start, length in _pieces(chunk):
        source.seek(start)
        stream.write(source.read(length))


def _pieces(chunk: Chunk, size: int = 1 << 20) -> Iterator[tuple[int, int]]:
    """Offsets and lengths that cover a chunk, so that memory stays small."""
    for start in range(chunk.start, chunk.start + chunk.length, size):
        yield start, min(size, chunk.start + chunk.length - start)
