"""Writing line animations into glTF by appending.

Nothing is serialised anew: the JSON text gets new elements, the binary chunk gets new bytes behind
the old ones, and the rest is copied.
"""

from __future__ import annotations

import base64
import shutil
import struct
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, BinaryIO, ClassVar

import numpy as np
from numpy.typing import NDArray

from animeme.contracts import LineAnimation
from animeme.curves import CurveSet
from animeme.errors import InputError
from animeme.files import atomic_path
from animeme.rig import Character, MeshShapes
from animeme_stages.ingest.glb import Chunk, Container, open_container
from animeme_stages.ingest.gltf import load_gltf
from animeme_stages.ingest.gltf_data import external_uris, local_file, weight_animations
from animeme_stages.write.gltf_harm import harm
from animeme_stages.write.json_splice import Splice

_FLOAT = 5126
_MARK = "animeme"


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

    def write(
        self, character: Character, lines: Sequence[LineAnimation], target: Path
    ) -> tuple[Path, ...]:
        """Write the source with one animation per line appended.

        One channel per node whose mesh owns a driven shape; nodes with the same targets share a
        sampler, all channels of a line share its times.
        """
        container = open_container(character.source)
        uris = external_uris(container.json)
        for uri in uris:
            local_file(container.path, uri)  # refuse before anything is written
        appended = _Appended(
            len(container.json.get("accessors", [])), len(container.json.get("bufferViews", []))
        )
        animations = [_animation(line, character, container, appended) for line in lines]
        written = [target]
        if container.binary:
            text = _edited(container, appended, animations, uri=None)
            with atomic_path(target) as scratch, scratch.open("wb") as stream:
                _write_glb(stream, container, text, appended)
        else:
            side_car = target.with_suffix(".animeme.bin")
            text = _edited(container, appended, animations, uri=side_car.name)
            with atomic_path(side_car) as scratch:
                scratch.write_bytes(appended.data)
            with atomic_path(target) as scratch:
                scratch.write_text(text, encoding="utf-8", newline="")
            written.append(side_car)
        written += _copy_externals(container.path, uris, target.parent)
        return tuple(written)

    def write_assembly(
        self, character: Character, by_language: Mapping[str, Path], target: Path
    ) -> tuple[Path, ...]:
        """Write nothing: each language stays a file of its own."""
        return ()

    def read_animations(self, path: Path) -> dict[str, CurveSet]:
        """Weight curves of every linear animation in the file."""
        return weight_animations(open_container(path), load_gltf(path))

    def harm(self, character: Character, output: Path) -> list[str]:
        """What `output` lost or changed of the source; see `animeme.contracts.Format`."""
        return harm(open_container(character.source), open_container(output))


def _animation(
    line: LineAnimation, character: Character, container: Container, appended: _Appended
) -> dict[str, Any]:
    """The glTF animation of one line; its data goes to `appended`."""
    times_s, weights = _as_floats(line.curves)
    columns = {name: index for index, name in enumerate(line.curves.names)}
    unknown = set(columns) - set(character.canonical.values())
    if unknown:
        raise ValueError(f"{character.source} has no shape {', '.join(sorted(unknown))}")
    time_accessor = appended.floats(times_s, bounds=True)
    samplers: dict[tuple[Any, ...], int] = {}
    channels: list[dict[str, Any]] = []
    made: list[dict[str, Any]] = []
    for mesh in character.meshes:
        targets = tuple(columns.get(character.canonical[name], -1) for name in mesh.shapes)
        if max(targets) < 0:
            continue
        key = (targets, mesh.rest)
        if key not in samplers:
            samplers[key] = len(made)
            output = appended.floats(_mesh_weights(mesh, targets, weights))
            made.append({"input": time_accessor, "interpolation": "LINEAR", "output": output})
        node = int(mesh.path.rpartition("/")[2])
        target = {"node": node, "path": "weights"}
        channels.append({"sampler": samplers[key], "target": target})
    note = {"line": line.name, "language": line.language, "duration_s": line.duration_s}
    name = _free_name(line, container)
    return {"name": name, "channels": channels, "samplers": made, "extras": {_MARK: note}}


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


def _free_name(line: LineAnimation, container: Container) -> str:
    """The line's name, with its language where somebody else's animation has that name."""
    theirs = {a.get("name") for a in container.json.get("animations", []) if not _is_ours(a)}
    return line.name if line.name not in theirs else f"{line.name}_{line.language}"


def _is_ours(animation: Mapping[str, Any]) -> bool:
    extras = animation.get("extras")
    return isinstance(extras, dict) and _MARK in extras


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
    buffers = container.json.get("buffers", [])
    start, size = 0, len(appended.data)
    if uri is None and (container.bin or not buffers):
        buffer = 0
        start = container.bin.length if container.bin else 0
        if buffers:
            first = splice.elements(splice.members()["buffers"][0])[0]
            splice.set(first[0], "byteLength", start + size)
        else:
            splice.append("buffers", [{"byteLength": size}])
    else:
        # A GLB may keep its buffers elsewhere, and then has no chunk to append to.
        data = "data:application/octet-stream;base64," + base64.b64encode(appended.data).decode()
        buffer = len(buffers)
        splice.append("buffers", [{"uri": uri or data, "byteLength": size}])
        appended_elsewhere = uri is None
        if appended_elsewhere:
            appended.data.clear()
    view = {"buffer": buffer, "byteOffset": start, "byteLength": size}
    splice.append("bufferViews", [view])
    splice.append("accessors", appended.accessors)
    _put_animations(splice, container, animations)
    return splice.apply()


def _put_animations(
    splice: Splice, container: Container, animations: Sequence[Mapping[str, Any]]
) -> None:
    """Append animations; one that we made before under the same name is replaced."""
    old = {
        a["name"]: index
        for index, a in enumerate(container.json.get("animations", []))
        if _is_ours(a) and isinstance(a.get("name"), str)
    }
    spans = splice.elements(splice.members()["animations"][0]) if old else []
    new = []
    for animation in animations:
        if animation["name"] in old:
            splice.replace(spans[old[animation["name"]]], animation)
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


def _copy_externals(source: Path, uris: Sequence[str], folder: Path) -> list[Path]:
    """Copy the asset's other files to the same places beside the output."""
    copied: list[Path] = []
    for uri in uris:
        file = local_file(source, uri)
        target = folder / file.relative_to(source.parent)
        if not file.is_file() or target.resolve() == file.resolve():
            continue
        if target.is_file():
            if target.read_bytes() != file.read_bytes():
                raise InputError(
                    "asset-file-clash",
                    f"needs '{uri}', but another asset's file of that name is there",
                    place=str(target),
                    action="Deliver one of the two as .glb, or rename its file.",
                )
            continue
        with atomic_path(target) as scratch:
            shutil.copyfile(file, scratch)
        copied.append(target)
    return copied
