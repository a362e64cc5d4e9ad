"""Viewing copies of glTF: the file without what a browser needs not, or could not, load."""

from __future__ import annotations

import base64
import binascii
import io
import json
import struct
from collections.abc import Iterator
from copy import deepcopy
from pathlib import Path
from typing import Any

from animeme.errors import InputError
from animeme_stages.ingest.glb import Container, open_container
from animeme_stages.ingest.gltf import load_gltf
from animeme_stages.ingest.gltf_data import Buffers, local_file
from animeme_stages.review.view import MeshView, View, is_cover

MOST_PIXELS = 1024
# A picture of fewer bytes is kept as it is.
SMALL_IMAGE_BYTES = 400_000
_DRACO = "KHR_draco_mesh_compression"
_MESHOPT = ("EXT_meshopt_compression", "KHR_meshopt_compression")
# What the page's loader knows and a viewing copy keeps; colour is enough to judge a mouth.
_KEPT = frozenset(
    {*_MESHOPT, "KHR_mesh_quantization", "KHR_materials_unlit", "KHR_texture_transform"}
)
# Accessors and buffer views are copied where they are used: most may be of animations.
_ROOT = (
    "scene", "scenes", "nodes", "meshes", "skins", "materials", "textures", "images", "samplers",
)  # fmt: skip


def view_gltf(path: Path) -> View:
    """The viewing copy of a ``.glb``, ``.gltf`` or ``.vrm`` file.

    Textures other than the base colour's are left out, and large ones made smaller.

    Raises:
        InputError: it cannot be read, or its meshes are compressed with Draco.
    """
    character = load_gltf(path)
    container = open_container(path)
    if _DRACO in container.json.get("extensionsRequired", ()):
        raise InputError(
            "view-unsupported",
            "is compressed with Draco, which the page cannot show",
            place=str(path),
            action="All but the head is shown; compress with meshopt instead, or not at all.",
        )
    copier = _Copier(container)
    meshes = tuple(
        MeshView(
            int(mesh.path.rpartition("/")[2]),
            tuple(character.canonical[shape] for shape in mesh.shapes),
            mesh.rest,
        )
        for mesh in character.meshes
    )
    faces = -1 if "VRM" in container.json.get("extensions", {}) else 1
    return View(copier.glb(), meshes, faces, tuple(copier.notes))


def pack(root: dict[str, Any], data: bytes) -> bytes:
    """A GLB of one buffer (Khronos glTF 2.0, section 4.4)."""
    data += b"\0" * (-len(data) % 4)
    root["buffers"] = [{"byteLength": len(data)}]
    text = json.dumps(root, ensure_ascii=False, separators=(",", ":")).encode()
    text += b" " * (-len(text) % 4)
    size = 12 + 8 + len(text) + 8 + len(data)
    head = struct.pack("<4sII", b"glTF", 2, size)
    return b"".join([
        head, struct.pack("<I4s", len(text), b"JSON"), text,
        struct.pack("<I4s", len(data), b"BIN\0"), data,
    ])  # fmt: skip


class _Copier:
    """Copies what is used of a file, and says what is not."""

    def __init__(self, container: Container) -> None:
        self._path = container.path
        self._source = container.json
        self._buffers = Buffers(container)
        self._root = {key: deepcopy(self._source[key]) for key in _ROOT if key in self._source}
        self._data = bytearray()
        self._views: list[dict[str, Any]] = []
        self._new_view: dict[int, int] = {}
        self.notes: list[str] = []

    def glb(self) -> bytes:
        """The copy."""
        root = self._root
        for key in ("extensionsUsed", "extensionsRequired"):
            kept = [name for name in self._source.get(key, ()) if name in _KEPT]
            root |= {key: kept} if kept else {}
        root["asset"] = {"version": "2.0"}
        for holder in _objects(root):
            self._strip(holder)
        for node in root.get("nodes", []):
            node.pop("camera", None)
        self._materials()
        self._images()
        self._accessors()
        root["bufferViews"] = self._views
        return pack(root, bytes(self._data))

    @staticmethod
    def _strip(holder: dict[str, Any]) -> None:
        """Take out what other programs left, and extensions that are not kept."""
        holder.pop("extras", None)
        extensions = holder.get("extensions")
        if isinstance(extensions, dict):
            kept = {name: value for name, value in extensions.items() if name in _KEPT}
            holder.pop("extensions")
            holder |= {"extensions": kept} if kept else {}

    def _materials(self) -> None:
        for material in self._root.get("materials", []):
            for name in ("normalTexture", "occlusionTexture", "emissiveTexture"):
                material.pop(name, None)
            pbr = material.setdefault("pbrMetallicRoughness", {})
            if is_cover(str(material.get("name", ""))):
                pbr |= {"baseColorFactor": [0, 0, 0, 0]}
                pbr.pop("baseColorTexture", None)
                material |= {"alphaMode": "MASK"}
            if pbr.pop("metallicRoughnessTexture", None) is not None:
                pbr |= {"metallicFactor": 0.0, "roughnessFactor": 0.7}

    def _images(self) -> None:
        """Put the pictures of base colours into the buffer; take the others' references out."""
        root = self._root
        materials = root.get("materials", [])
        textures, images = root.pop("textures", []), root.pop("images", [])
        loaded: dict[int, dict[str, Any] | None] = {}
        kept_images: list[dict[str, Any]] = []
        kept_textures: list[dict[str, Any]] = []
        for material in materials:
            slot = material["pbrMetallicRoughness"].get("baseColorTexture")
            if slot is None:
                continue
            texture = textures[slot["index"]]
            source = texture.get("source")
            if source is not None and source not in loaded:
                loaded[source] = self._image(images[source])
            image = loaded.get(source) if source is not None else None
            if image is None:
                del material["pbrMetallicRoughness"]["baseColorTexture"]
                self._note("Some textures cannot be shown.")
                continue
            if image not in kept_images:
                kept_images.append(image)
            sampler = {"sampler": texture["sampler"]} if "sampler" in texture else {}
            kept_textures.append({"source": kept_images.index(image), **sampler})
            slot["index"] = len(kept_textures) - 1
        if kept_textures:
            root |= {"textures": kept_textures, "images": kept_images}

    def _image(self, image: dict[str, Any]) -> dict[str, Any] | None:
        try:
            data = self._image_bytes(image)
        except (OSError, ValueError, KeyError, InputError):
            return None
        if len(data) > SMALL_IMAGE_BYTES:
            smaller = _smaller(data)
            if smaller is None:
                return None
            self._note(f"Textures are shown at {MOST_PIXELS} pixels or fewer.")
            data = smaller
        kind = _kind_of(data)
        return None if kind is None else {"bufferView": self._append(data), "mimeType": kind}

    def _image_bytes(self, image: dict[str, Any]) -> bytes:
        if "bufferView" in image:
            view = self._source["bufferViews"][image["bufferView"]]
            return self._view_bytes(view)
        uri = image["uri"]
        if uri.startswith("data:"):
            try:
                return base64.b64decode(uri.partition(",")[2], validate=True)
            except binascii.Error as error:
                raise ValueError(str(error)) from error
        return local_file(self._path, uri).read_bytes()

    def _accessors(self) -> None:
        root = self._root
        accessors = self._source.get("accessors", [])
        used: dict[int, int] = {}

        def moved(index: int) -> int:
            return used.setdefault(index, len(used))

        for mesh in root.get("meshes", []):
            for primitive in mesh["primitives"]:
                for group in (primitive["attributes"], *primitive.get("targets", ())):
                    # Without normal maps nobody needs tangents, nor a second set of coordinates.
                    for name in [n for n in group if n.startswith(("TANGENT", "_"))]:
                        del group[name]
                    group |= {name: moved(index) for name, index in group.items()}
                if "indices" in primitive:
                    primitive["indices"] = moved(primitive["indices"])
        for skin in root.get("skins", []):
            if "inverseBindMatrices" in skin:
                skin["inverseBindMatrices"] = moved(skin["inverseBindMatrices"])
        kept = [deepcopy(accessors[index]) for index in used]
        for accessor in kept:
            self._strip(accessor)
            holders = [accessor]
            if "sparse" in accessor:
                holders += [accessor["sparse"]["indices"], accessor["sparse"]["values"]]
            for holder in holders:
                if "bufferView" in holder:
                    holder["bufferView"] = self._view(holder["bufferView"])
        root["accessors"] = kept

    def _view(self, index: int) -> int:
        if index not in self._new_view:
            view = deepcopy(self._source["bufferViews"][index])
            self._strip(view)
            packed = next((view.get("extensions", {}).get(name) for name in _MESHOPT
                           if name in view.get("extensions", {})), None)  # fmt: skip
            if packed is not None:
                at = self._place(self._view_bytes(packed))
                packed |= {"buffer": 0, "byteOffset": at}
                view.pop("byteOffset", None)  # what stands in for it is never read
                self._views.append({**view, "buffer": 0})
            else:
                at = self._place(self._view_bytes(view))
                self._views.append({**view, "buffer": 0, "byteOffset": at})
            self._new_view[index] = len(self._views) - 1
        return self._new_view[index]

    def _view_bytes(self, view: dict[str, Any]) -> bytes:
        start = view.get("byteOffset", 0)
        return bytes(self._buffers.buffer(view["buffer"])[start : start + view["byteLength"]])

    def _append(self, data: bytes) -> int:
        at = self._place(data)
        self._views.append({"buffer": 0, "byteOffset": at, "byteLength": len(data)})
        return len(self._views) - 1

    def _place(self, data: bytes) -> int:
        self._data += b"\0" * (-len(self._data) % 4)
        at = len(self._data)
        self._data += data
        return at

    def _note(self, text: str) -> None:
        if text not in self.notes:
            self.notes.append(text)


def _objects(value: Any) -> Iterator[dict[str, Any]]:
    if isinstance(value, dict):
        yield value
        yield from (found for held in list(value.values()) for found in _objects(held))
    elif isinstance(value, list):
        yield from (found for held in value for found in _objects(held))


def _kind_of(data: bytes) -> str | None:
    if data.startswith(b"\x89PNG"):
        return "image/png"
    if data.startswith(b"\xff\xd8"):
        return "image/jpeg"
    return "image/webp" if data[:4] == b"RIFF" and data[8:12] == b"WEBP" else None


def _smaller(data: bytes) -> bytes | None:
    """A picture of at most `MOST_PIXELS` a side; None if it cannot be read."""
    from PIL import Image  # comes with matplotlib

    try:
        with Image.open(io.BytesIO(data)) as image:
            image.thumbnail((MOST_PIXELS, MOST_PIXELS))
            clear = image.mode in ("RGBA", "LA", "PA") or "transparency" in image.info
            out = io.BytesIO()
            if clear:
                image.convert("RGBA").save(out, "PNG", optimize=True)
            else:
                image.convert("RGB").save(out, "JPEG", quality=85)
    except (OSError, ValueError, Image.DecompressionBombError):
        return None
    return out.getvalue()
