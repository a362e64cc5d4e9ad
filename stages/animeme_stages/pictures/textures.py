"""Base colours of materials from images; what cannot be decoded is left out."""

from __future__ import annotations

import base64
import io
from collections.abc import Mapping
from contextlib import suppress
from typing import Any

import numpy as np
from PIL import Image, UnidentifiedImageError

from animeme.errors import InputError
from animeme_stages.ingest.gltf_data import Buffers, local_file
from animeme_stages.pictures.raster import Singles

# A head fills some hundred pixels: finer textures would only flicker.
_LARGEST_PX = 1024
_UNREADABLE = (
    AttributeError, IndexError, InputError, KeyError, OSError, SyntaxError, TypeError,
    UnidentifiedImageError, ValueError, Image.DecompressionBombError,
)  # fmt: skip


def channel_of(material: Mapping[str, Any]) -> int:
    """Which set of texture coordinates a glTF material's base colour uses."""
    texture = material.get("pbrMetallicRoughness", {}).get("baseColorTexture", {})
    return int(texture.get("texCoord", 0))


def of_gltf(buffers: Buffers, index: int) -> Singles | None:
    """The image of a glTF texture, as `decoded` gives it; None if it cannot be read."""
    with suppress(*_UNREADABLE):
        root = buffers.container.json
        image = root["images"][root["textures"][index]["source"]]
        uri = image.get("uri")
        if uri is None:
            return decoded(bytes(buffers.view(image["bufferView"])))
        if uri.startswith("data:"):
            return decoded(base64.b64decode(uri.partition(",")[2]))
        return decoded(local_file(buffers.container.path, uri).read_bytes())
    return None


def decoded(data: bytes) -> Singles | None:
    """An image file as (H, W, 4) linear RGB and alpha, None if it cannot be read."""
    with suppress(*_UNREADABLE), Image.open(io.BytesIO(data)) as image:
        image.draft("RGB", (_LARGEST_PX, _LARGEST_PX))
        whole = image.convert("RGBA")
        whole.thumbnail((_LARGEST_PX, _LARGEST_PX))
        found = np.asarray(whole, dtype=np.float32) / np.float32(255.0)
        found[..., :3] = linear(found[..., :3])
        return found
    return None


def linear(encoded: Singles) -> Singles:
    """Display values, 0 to 1, as linear light."""
    return np.asarray(np.power(encoded, 2.2), dtype=np.float32)


def looked_up(texture: Singles, uv: Singles) -> Singles:
    """Nearest texels (F, 4) at places (F, 2), v down; textures repeat."""
    height, width = texture.shape[:2]
    x = np.floor(uv[:, 0] * width).astype(np.int64) % width
    y = np.floor(uv[:, 1] * height).astype(np.int64) % height
    return np.asarray(texture[y, x])
