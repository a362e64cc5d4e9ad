"""What an accessor of glTF says; glTF 2.0, section 3.6.2.

Dense, strided and sparse ones, of floats or of whole numbers that stand for fractions.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

FLOAT = 5126
_LONG = 5125
_KINDS = {5120: "i1", 5121: "u1", 5122: "<i2", 5123: "<u2", _LONG: "<u4", FLOAT: "<f4"}
_INDEX_KINDS = {5121: "u1", 5123: "<u2", 5125: "<u4"}
_WIDTH = {"SCALAR": 1, "VEC2": 2, "VEC3": 3, "VEC4": 4, "MAT4": 16}
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
    """The values of an accessor that stand for real numbers, shape (count, components).

    Args:
        root: the document.
        index: of the accessor.
        buffer: gives the data of a buffer by its index.

    Raises:
        AccessorError: it leaves its buffer, or holds whole numbers.
        LookupError, TypeError, ValueError: the document is broken where it is followed.
    """
    accessor = root["accessors"][index]
    kind = accessor["componentType"]
    fractions = kind in _KINDS and kind != _LONG and accessor.get("normalized") is True
    if kind != FLOAT and not fractions:
        raise AccessorError("holds neither floats nor normalized whole numbers")
    return accessor_values(root, index, buffer).astype(np.float32, copy=False)


def accessor_values(
    root: Mapping[str, Any], index: int, buffer: Callable[[int], memoryview]
) -> NDArray[Any]:
    """The values of any accessor, shape (count, components); normalized ones are float32.

    Args:
        root, index, buffer: as of `accessor_floats`.

    Raises:
        AccessorError: it leaves its buffer, or is of no known type.
        LookupError, TypeError, ValueError: the document is broken where it is followed.
    """
    accessor = root["accessors"][index]
    if accessor["componentType"] not in _KINDS:
        raise AccessorError("holds numbers of no known kind")
    dtype = np.dtype(_KINDS[accessor["componentType"]])
    width, count = _WIDTH[accessor["type"]], accessor["count"]
    sparse = accessor.get("sparse")
    if "bufferView" in accessor:
        values = _elements(root, accessor, (count, width), dtype, buffer)
    elif not 0 <= count * width <= _MOST_UNSTORED:
        raise AccessorError("has more zeros than anybody needs")
    else:
        values = np.zeros((count, width), dtype)
    if sparse is not None:
        size, indices = sparse["count"], sparse["indices"]
        places = _elements(
            root, indices, (size, 1), np.dtype(_INDEX_KINDS[indices["componentType"]]), buffer
        )
        values = values.copy()
        values[places[:, 0]] = _elements(root, sparse["values"], (size, width), dtype, buffer)
    if accessor.get("normalized") is True and dtype.kind in "iu":
        return np.maximum(values / np.iinfo(dtype).max, -1).astype(np.float32)
    return values


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
