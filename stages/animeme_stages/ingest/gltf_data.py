"""What glTF buffers hold: URIs made safe, accessors, weight animations."""

from __future__ import annotations

import base64
import binascii
import os
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from functools import cached_property
from pathlib import Path, PurePosixPath
from typing import Any
from urllib.parse import unquote, urlsplit

import numpy as np
from numpy.typing import NDArray

from animeme.curves import CurveSet
from animeme.errors import InputError
from animeme.rig import Character
from animeme_stages.ingest.glb import Container, open_container, unreadable
from animeme_stages.ingest.gltf_accessor import (
    AccessorError,
    CompressedError,
    accessor_floats,
    accessor_values,
)
from animeme_stages.ingest.gltf_document import MALFORMED, mark_of

# Bytes of a binary chunk that are read faster than mapped.
_SMALL = 1 << 18


def local_file(path: Path, uri: str) -> Path:
    """The file that a URI of the asset at `path` names, always within the asset's folder.

    Raises:
        InputError: the URI is absolute, names a host, or leaves the folder, be it by a link.
    """
    inner = _inner_path(uri)
    folder = path.parent
    if inner is None or not _is_within(folder.joinpath(*inner.parts), folder):
        raise InputError(
            "asset-uri-refused",
            f"refers to {uri[:120]!r}, which is not a file in its own folder",
            place=str(path),
            action="Put the file beside the asset and use a relative URI.",
        )
    return folder.joinpath(*inner.parts)


def external_files(path: Path) -> tuple[Path, ...]:
    """Files that the asset at `path` names as its buffers and images, whether or not they exist.

    Raises:
        InputError: it cannot be read, or one of them is not within its folder.
    """
    return tuple(local_file(path, uri) for uri in external_uris(open_container(path).json))


def _is_within(file: Path, folder: Path) -> bool:
    """Whether a file is in a folder once links are followed."""
    try:
        return file.resolve().is_relative_to(folder.resolve())
    except (OSError, RuntimeError, ValueError):  # links in a circle, names that no system takes
        return False


def _inner_path(uri: str) -> PurePosixPath | None:
    """The relative path that a URI means, None where it is anything else."""
    try:
        parts = urlsplit(uri)
    except ValueError:
        return None
    text = unquote(parts.path)
    inner = PurePosixPath(text)
    outside = parts.scheme or parts.netloc or inner.is_absolute() or ".." in inner.parts
    strange = not inner.parts or any(c in text for c in "\\\0") or ":" in inner.parts[0]
    # Control characters are dropped by urlsplit: what it says is not what the URI says.
    return None if outside or strange or any(c < " " for c in uri) else inner


def external_uris(root: Mapping[str, Any]) -> list[str]:
    """URIs of buffers and images that live in files of their own, in order, each once."""
    holders = [*root.get("buffers", []), *root.get("images", [])]
    uris = [holder["uri"] for holder in holders if isinstance(holder.get("uri"), str)]
    return list(dict.fromkeys(uri for uri in uris if not uri.startswith("data:")))


class Buffers:
    """Reads accessors of one container; each buffer is read once, when first needed."""

    def __init__(self, container: Container) -> None:
        self.container = container
        self._loaded: dict[int, memoryview] = {}

    @cached_property
    def _bin(self) -> memoryview:
        chunk = self.container.bin
        if chunk is None:
            raise unreadable(self.container.path, "has a buffer without data")
        if chunk.length < _SMALL:
            with open(self.container.path, "rb", buffering=0) as stream:
                return memoryview(os.pread(stream.fileno(), chunk.length, chunk.start))
        data = np.memmap(self.container.path, np.uint8, "r", chunk.start, (chunk.length,))
        return data.data

    def floats(self, index: int) -> NDArray[np.float32]:
        """The values of an accessor of real numbers, shape (count, components).

        Raises:
            InputError: ``animation-compressed``; ``asset-unreadable``: it leaves its buffer, or
                holds no such numbers.
        """
        with self._followed(index):
            return accessor_floats(self.container.json, index, self.buffer)

    def values(self, index: int) -> NDArray[Any]:
        """The values of any accessor, shape (count, components); normalized ones are floats.

        Raises:
            InputError: as of `floats`.
        """
        with self._followed(index):
            return accessor_values(self.container.json, index, self.buffer)

    @contextmanager
    def _followed(self, index: int) -> Iterator[None]:
        try:
            yield
        except CompressedError as error:
            raise InputError(
                "animation-compressed",
                f"uses accessor {index}, whose data is compressed",
                place=str(self.container.path),
                action="Export it without compressing animations, if it is to be read.",
            ) from error
        except AccessorError as error:
            raise unreadable(self.container.path, f"accessor {index} {error}") from error

    def view(self, index: int) -> memoryview:
        """The bytes of a buffer view.

        Raises:
            InputError: it leaves its buffer.
        """
        view = self.container.json["bufferViews"][index]
        data, start = self.buffer(view["buffer"]), view.get("byteOffset", 0)
        if start < 0 or start + view["byteLength"] > len(data):
            raise unreadable(self.container.path, f"buffer view {index} leaves its buffer")
        return data[start : start + view["byteLength"]]

    def buffer(self, index: int) -> memoryview:
        """A whole buffer.

        Raises:
            InputError: it is not there, or damaged.
        """
        if index not in self._loaded:
            uri = self.container.json["buffers"][index].get("uri")
            if uri is None:
                self._loaded[index] = self._bin
            elif uri.startswith("data:"):
                self._loaded[index] = self._embedded(uri)
            else:
                file = local_file(self.container.path, uri)
                try:
                    self._loaded[index] = memoryview(file.read_bytes())
                except OSError as error:
                    raise unreadable(file, f"cannot be read ({error.strerror})") from error
        return self._loaded[index]

    def _embedded(self, uri: str) -> memoryview:
        try:
            return memoryview(base64.b64decode(uri.partition(",")[2], validate=True))
        except binascii.Error as error:
            raise unreadable(
                self.container.path, "has an embedded buffer that is no base64"
            ) from error


def weight_animations(container: Container, character: Character) -> dict[str, CurveSet]:
    """Weight curves of every linear animation, over canonical shape names.

    Animations of others that are broken, compressed or not linear, are left out.

    Raises:
        InputError: an animation of ours is broken.
    """
    buffers = Buffers(container)
    found: dict[str, CurveSet] = {}
    for index, animation in enumerate(container.json.get("animations", [])):
        name = str(animation.get("name", f"animation {index}"))
        try:
            curves = _weight_curves(animation, buffers, character)
        except (InputError, *MALFORMED) as error:
            if mark_of(animation) is None:
                continue
            if isinstance(error, InputError):
                raise
            raise unreadable(container.path, f"animation '{name}' is broken ({error})") from error
        if curves is not None:
            found[name] = curves
    return found


def _weight_curves(
    animation: Mapping[str, Any], buffers: Buffers, character: Character
) -> CurveSet | None:
    """Curves of one animation, None if it moves no weights linearly."""
    times_s: NDArray[np.float32] | None = None
    columns: dict[str, NDArray[np.float32]] = {}
    read: dict[tuple[int, int], tuple[NDArray[np.float32], NDArray[np.float32]]] = {}
    for sampler, names in _weight_channels(animation, character):
        accessors = sampler["input"], sampler["output"]
        if accessors not in read:
            seconds = buffers.floats(accessors[0])[:, 0]
            weights = buffers.floats(accessors[1]).reshape(len(seconds), -1)
            read[accessors] = seconds, weights
        keys, values = read[accessors]
        if values.shape[1] != len(names):
            raise ValueError(f"{values.shape[1]} weights for {len(names)} targets")
        times_s = keys if times_s is None else times_s
        if times_s is keys or np.array_equal(times_s, keys):
            for column, name in enumerate(names):
                columns.setdefault(name, values[:, column])
    if times_s is None:
        return None
    stacked = np.stack(list(columns.values()), axis=1).astype(np.float64)
    return CurveSet(times_s.astype(np.float64), tuple(columns), stacked)


def _weight_channels(
    animation: Mapping[str, Any], character: Character
) -> Iterator[tuple[Mapping[str, Any], list[str]]]:
    """Sampler and canonical target names of each linear weights channel."""
    meshes = {mesh.path: mesh for mesh in character.meshes}
    for channel in animation["channels"]:
        target = channel["target"]
        mesh = meshes.get(f"/nodes/{target.get('node')}")
        sampler = animation["samplers"][channel["sampler"]]
        linear = sampler.get("interpolation", "LINEAR") == "LINEAR"
        if target["path"] == "weights" and mesh and linear:
            yield sampler, [character.canonical[name] for name in mesh.shapes]
