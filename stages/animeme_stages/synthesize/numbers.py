"""Learned numbers as model documents keep them."""

from __future__ import annotations

from collections.abc import Iterable
from itertools import chain
from typing import Any

import numpy as np

from animeme.curves import Floats

# Learned numbers are kept to this many significant digits, so that documents are short and what
# is in memory is what is in the file.
DIGITS = 6


def rounded(values: Any, digits: int = DIGITS) -> Floats:
    """`values` to some significant digits, as documents keep them."""
    array = np.asarray(values, dtype=np.float64)
    flat = [float(f"{value:.{digits}g}") for value in array.ravel().tolist()]
    return np.array(flat).reshape(array.shape)


def array_from(entry: Any, shape: tuple[int | None, ...], name: str) -> Floats:
    """A finite array of a document; None in `shape` fits any length.

    Raises:
        ValueError: it has another shape, or holds something else than finite numbers.
    """
    try:
        found = np.array(entry, dtype=np.float64)
    except (TypeError, ValueError) as error:
        raise ValueError(f"{name} is not an array of numbers") from error
    # NumPy takes "1" and true for numbers. Types at once: these may be a quarter of a million.
    if not _types_in(entry, found.ndim) <= {int, float}:
        raise ValueError(f"{name} is not an array of numbers")
    fits = found.ndim == len(shape) and all(
        n is None or n == m for n, m in zip(shape, found.shape, strict=True)
    )
    if not fits:
        # An empty list of lists loses its inner lengths in JSON.
        if found.size == 0 and 0 in shape:
            return np.zeros([n or 0 for n in shape])
        raise ValueError(f"{name} has shape {found.shape}, not {shape}")
    if not np.isfinite(found).all():
        raise ValueError(f"{name} holds numbers that are not finite")
    return found


def _types_in(entry: Any, depth: int) -> set[type]:
    """Types of what is in lists that are nested as deep as an array has axes."""
    items: Iterable[Any] = [entry]
    for _ in range(depth):
        items = chain.from_iterable(items)
    return set(map(type, items))
