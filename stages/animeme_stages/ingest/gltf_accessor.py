"""What an accessor of glTF says, as floats; glTF 2.0, section 3.6.2.

Dense, strided and sparse ones, of floats or of whole numbers that stand for fractions.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

FLOAT = 5126
_KINDS = {5120: "i1", 5121: "u1", 5122: "<i2", 5123: "<u2", FLOAT: "<f4"}
_INDEX_KINDS = {5121: "u1", 5123: "<u2", 5125: "<u4"}
_WIDTH = {"SCALAR": 1, "VEC2": 2, "VEC3": 3, "VEC4": 4}
# Numbers of an accessor that no file holds, and that hence cost its author nothing: 64 MB, five
# hours of 30 frames a second with 30 shapes.
_MOST_UNSTORED = 1 << 24
_COMPRESSED = ("EXT_meshopt_compression", "KHR_meshopt_compression")


class AccessorError(ValueError):
    """An accessor cannot be followed; says why, in words that go after "accessor 3"."""


class CompressedError(AccessorError):
    """Its data is there, but in a coding that is not read here."""


def accessor_floats(
    root: Mapping[str, Any], index: int, buffer: Callable[[int], memoryview]
) -> NDArray[np.float32]:
    """The values of an accessor, shape (count, components).

    Args:
        root: the document.
        index: of the accessor.
        buffer: gives the data of a buffer by its index.

    Raises:
        AccessorError: it leaves its buffer, or has no such type.
        LookupError, TypeError, ValueError: the document is broken where it is followed.
    """
    accessor = root["accessors"][index]
    kind = accessor["componentType"]
    if kind not in _KINDS or (kind != FLOAT and accessor.get("normalized") is not True):
        raise AccessorError("holds neither floats nor normalized whole numbers")
    dtype, width, count = np.dtype(_KINDS[kind]), _WIDTH[accessor["type"]], accessor["count"]
    sparse = accessor.get("sparse")
    if "bufferView" in accessor:
        values = _elements(root, accessor, (count, width), dtype, buffer)
    elif sparse is None or not 0 <= count * width <= _MOST_UNSTORED:
        raise AccessorError("has no data")
    else:
        values = np.zeros((count, width), dtype)
    if sparse is not None:
        size, indices = sparse["count"], sparse["indices"]
        places = _elements(
            root, indices, (size, 1), np.dtype(_INDEX_KINDS[indices["componentType"]]), buffer
        )
        values = values.copy()
        values[places[:, 0]] = _elements(root, sparse["values"], (size, width), dtype, buffer)
    if kind == FLOAT:
        return values.astype(np.float32, copy=False)
    return np.maximum(values / np.iinfo(dtype).max, -1).astype(np.float32)


def _elements(
    root: Mapping[str, Any],
    holder: Mapping[str, Any],
    shape: tuple[int, int],
    dtype: np.dtype[Any],
    buffer: Callable[[int], memoryview],
) -> NDArray[Any]:
    """The numbers at a holder's ``bufferView`` and ``byteOffset``, of that shape."""
    view = root["bufferViews"][holder["bufferView"]]
    if any(name in view.get("extensions", ()) for name in _COMPRESSED):
        raise CompressedError("is compressed")
    count, width = shape
    offset, size = holder.get("byteOffset", 0), width * dtype.itemsize
    stride = view.get("byteStride", size)
    data = buffer(view["buffer"])
    start = view.get("byteOffset", 0)
    room = min(len(data) - start, view["byteLength"]) - offset
    if min(start, offset, count) < 0 or stride < size or (count - 1) * stride + size > room:
        raise AccessorError("leaves its buffer")
    return np.ndarray(shape, dtype, data, start + offset, (stride, dtype.itemsize))
