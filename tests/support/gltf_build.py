"""Tiny glTF files made by hand, and a reader that shares no code with animeme."""

from __future__ import annotations

import base64
import json
import re
import struct
import warnings
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any
from urllib.parse import unquote

import numpy as np
from numpy.typing import NDArray
from pygltflib import GLTF2

Json = dict[str, Any]

JSON_KIND = b"JSON"
BIN_KIND = b"BIN\0"
_FORMATS = {5120: "i1", 5121: "u1", 5122: "<i2", 5123: "<u2", 5125: "<u4", 5126: "<f4"}
_WIDTHS = {"SCALAR": 1, "VEC2": 2, "VEC3": 3, "VEC4": 4, "MAT4": 16}


# Building


def mesh(count: int, names: Sequence[str] | None, *, primitives: int = 1) -> Json:
    """A mesh with `count` targets; `names` go to ``mesh.extras``."""
    made: Json = {
        "primitives": [
            {"attributes": {"POSITION": 0}, "targets": [{"POSITION": 0}] * count}
            for _ in range(primitives)
        ]
    }
    if names is not None:
        made["extras"] = {"targetNames": list(names)}
    return made


def face(names: Sequence[str] = ("jawOpen", "mouthClose"), **members: Any) -> Json:
    """One triangle with a target per name, as a document; its 36 bytes are `TRIANGLE`."""
    return {
        "asset": {"version": "2.0"},
        "scene": 0,
        "scenes": [{"nodes": [0]}],
        "nodes": [{"mesh": 0, "name": "face"}],
        "meshes": [mesh(len(names), names)],
        "buffers": [{"byteLength": len(TRIANGLE)}],
        "bufferViews": [{"buffer": 0, "byteLength": len(TRIANGLE)}],
        "accessors": [
            {
                "bufferView": 0,
                "componentType": 5126,
                "count": 3,
                "type": "VEC3",
                "min": [0, 0, 0],
                "max": [1, 1, 0],
            }
        ],
    } | members


TRIANGLE = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0]], "<f4").tobytes()


def glb(text: str | Mapping[str, Any], *chunks: tuple[bytes, bytes]) -> bytes:
    """A GLB of a JSON text (or document) and chunks (kind, data), padded as the format wants."""
    if not isinstance(text, str):
        text = json.dumps(text)
    encoded = text.encode()
    encoded += b" " * (-len(encoded) % 4)
    body = b""
    for kind, data in ((JSON_KIND, encoded), *chunks):
        padded = data + b"\0" * (-len(data) % 4)
        body += struct.pack("<I4s", len(padded), kind) + padded
    return struct.pack("<4sII", b"glTF", 2, 12 + len(body)) + body


def data_uri(data: bytes) -> str:
    return "data:application/octet-stream;base64," + base64.b64encode(data).decode()


def add_accessor(
    document: Json, binary: bytes, values: Any, *, dtype: str = "<f4", **members: Any
) -> tuple[int, bytes]:
    """Append a scalar accessor to document and binary; its index and the longer binary."""
    kinds = {"<f4": 5126, "i1": 5120, "u1": 5121, "<i2": 5122, "<u2": 5123}
    array = np.asarray(values, dtype)
    start = len(binary) + (-len(binary) % 4)
    binary = binary.ljust(start, b"\0") + array.tobytes()
    view = {"buffer": 0, "byteOffset": start, "byteLength": array.nbytes}
    document["bufferViews"].append(view)
    accessor = {
        "bufferView": len(document["bufferViews"]) - 1,
        "componentType": kinds[dtype],
        "count": array.size,
        "type": "SCALAR",
    }
    document["accessors"].append(accessor | members)
    document["buffers"][0]["byteLength"] = len(binary)
    return len(document["accessors"]) - 1, binary


def add_weights_animation(
    document: Json,
    binary: bytes,
    name: str | None,
    weights: Sequence[Sequence[float]],
    *,
    dtype: str = "<f4",
    **sampler: Any,
) -> bytes:
    """Append somebody's animation of node 0: one key per second. Gives the longer binary."""
    times = np.arange(len(weights))
    bounds = {"min": [0.0], "max": [float(times[-1])]}
    keys, binary = add_accessor(document, binary, times, **bounds)
    normal = {} if dtype == "<f4" else {"normalized": True}
    values, binary = add_accessor(document, binary, weights, dtype=dtype, **normal)
    animation = {
        "channels": [{"sampler": 0, "target": {"node": 0, "path": "weights"}}],
        "samplers": [{"input": keys, "output": values} | sampler],
    }
    if name is not None:
        animation["name"] = name
    document.setdefault("animations", []).append(animation)
    return binary


# Reading


def split_glb(data: bytes) -> tuple[str, list[tuple[bytes, bytes]]]:
    """The JSON text of a GLB, padding included, and its other chunks."""
    magic, version, size = struct.unpack_from("<4sII", data)
    assert (magic, version, size) == (b"glTF", 2, len(data))
    chunks = []
    at = 12
    while at < len(data):
        length, kind = struct.unpack_from("<I4s", data, at)
        assert length % 4 == 0, "chunks start and end on 4 bytes"
        chunks.append((kind, data[at + 8 : at + 8 + length]))
        at += 8 + length
    assert at == len(data)
    assert chunks[0][0] == JSON_KIND
    return chunks[0][1].decode(), chunks[1:]


def text_of(path: Path) -> str:
    """JSON text of a file of either container."""
    data = path.read_bytes()
    return split_glb(data)[0] if data[:4] == b"glTF" else data.decode()


def document_of(path: Path) -> Json:
    return dict(json.loads(text_of(path)))


def bin_of(path: Path) -> bytes | None:
    """The binary chunk of a GLB."""
    chunks = split_glb(path.read_bytes())[1]
    return chunks[0][1] if chunks and chunks[0][0] == BIN_KIND else None


_TOKEN = re.compile(r'\s*("(?:[^"\\]|\\.)*"|[\[\]{},:]|[^\s\[\]{},:"]+)')


def raw_tree(text: str) -> Any:
    """JSON as written: every scalar is its source text, an object a list of (key, value) pairs."""
    tokens = iter(_TOKEN.findall(text.strip("\0 \r\n\t")))

    def value(token: str) -> Any:
        if token == "{":
            pairs = []
            key = next(tokens)
            while key != "}":
                assert next(tokens) == ":"
                pairs.append((key, value(next(tokens))))
                token = next(tokens)
                key = next(tokens) if token == "," else token
            return pairs
        if token == "[":
            items = _Array()
            token = next(tokens)
            while token != "]":
                items.append(value(token))
                token = next(tokens)
                token = next(tokens) if token == "," else token
            return items
        return token

    return value(next(tokens))


class _Array(list[Any]):
    """Tells an array from an object's pairs."""


def kept(old: Any, new: Any, *, mine: Iterable[str] = (), pointer: str = "") -> list[str]:
    """Pointers at which `raw_tree` `new` lost or changed something of `old`.

    New members and elements behind the old ones are no loss.

    Args:
        old, new: trees.
        mine: pointers that may change.
        pointer: where the trees are.
    """
    mine = set(mine)
    if pointer in mine:
        return []
    if isinstance(old, _Array) and isinstance(new, _Array) and len(new) >= len(old):
        pairs = [(f"{pointer}/{i}", a, b) for i, (a, b) in enumerate(zip(old, new, strict=False))]
    elif type(old) is list and type(new) is list and len(new) >= len(old):
        if [key for key, _ in old] != [key for key, _ in new[: len(old)]]:
            return [pointer]
        pairs = [
            (f"{pointer}/{json.loads(key)}", a, b)
            for (key, a), (_, b) in zip(old, new, strict=False)
        ]
    else:
        return [] if old == new and type(old) is type(new) else [pointer]
    return [lost for place, a, b in pairs for lost in kept(a, b, mine=mine, pointer=place)]


class Reader:
    """Reads animations as pygltflib (or, for what it cannot read, the bare JSON) sees them."""

    def __init__(self, path: Path, *, plain: bool = False) -> None:
        self.path = path
        binary = path.read_bytes()[:4] == b"glTF"
        if plain:
            self.root = document_of(path)
            self.blob = bin_of(path) if binary else None
        else:
            with warnings.catch_warnings():
                warnings.filterwarnings("ignore", "Ignoring chunk")  # it cannot read them
                loaded = GLTF2().load_binary(str(path)) if binary else GLTF2().load_json(str(path))
            self.root = json.loads(loaded.to_json())
            self.blob = loaded.binary_blob() if binary else None

    def animation_names(self) -> list[str | None]:
        return [a.get("name") for a in self.root.get("animations", [])]

    def weights(self, name: str, times_s: NDArray[np.float64]) -> dict[int, NDArray[np.float64]]:
        """Weights that each node plays in the animation `name`, shape (T, targets)."""
        (animation,) = (a for a in self.root["animations"] if a.get("name") == name)
        played = {}
        for channel in animation["channels"]:
            assert channel["target"]["path"] == "weights"
            sampler = animation["samplers"][channel["sampler"]]
            assert sampler.get("interpolation", "LINEAR") == "LINEAR"
            keys = self.accessor(sampler["input"])
            values = self.accessor(sampler["output"]).reshape(len(keys), -1)
            columns = [np.interp(times_s, keys, column) for column in values.T]
            played[channel["target"]["node"]] = np.stack(columns, axis=1)
        return played

    def accessor(self, index: int) -> NDArray[np.float64]:
        accessor = self.root["accessors"][index]
        view = self.root["bufferViews"][accessor["bufferView"]]
        buffer = self.buffer(view["buffer"])
        assert "target" not in view
        start, size = view.get("byteOffset") or 0, view["byteLength"]
        assert start + size <= self.root["buffers"][view["buffer"]]["byteLength"] <= len(buffer)
        inner = accessor.get("byteOffset") or 0
        dtype = np.dtype(_FORMATS[accessor["componentType"]])
        assert (start + inner) % dtype.itemsize == 0, "accessors are aligned"
        count = accessor["count"] * _WIDTHS[accessor["type"]]
        assert inner + count * dtype.itemsize <= size
        values = np.frombuffer(buffer, dtype, count, start + inner).astype(np.float64)
        for bound, function in (("min", np.min), ("max", np.max)):
            if accessor.get(bound):
                assert function(values) == accessor[bound][0]
        return values

    def buffer(self, index: int) -> bytes:
        uri = self.root["buffers"][index].get("uri")
        if uri is None:
            assert index == 0
            assert self.blob is not None
            return bytes(self.blob)
        if uri.startswith("data:"):
            return base64.b64decode(uri.partition(",")[2], validate=True)
        assert not set(uri) & set(" #?"), f"'{uri}' is no URI"
        return (self.path.parent / unquote(uri)).read_bytes()
