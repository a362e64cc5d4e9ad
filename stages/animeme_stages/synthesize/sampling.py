"""When a curve has keys: uniformly, and where a phone needs one."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from animeme.curves import Floats

# Keys nearer to each other than this are one key; far below any frame.
SAME_TIME_S = 1e-4


def sample_times(end_s: float, rate_hz: float, extra: Iterable[float] = ()) -> Floats:
    """Uniform samples from 0, both ends, and `extra` keys; a sample gives way to a key near it.

    Args:
        end_s: where the curve ends.
        rate_hz: of the uniform samples.
        extra: further keys, seconds, within the curve.

    Returns:
        Shape (T,), strictly increasing.
    """
    uniform = np.arange(int(np.floor(end_s * rate_hz)) + 1) / rate_hz
    fixed = np.unique([0.0, end_s, *extra])
    # Of two keys that coincide the first stays, but the curve always ends with its track.
    fixed = fixed[np.append(True, np.diff(fixed) > SAME_TIME_S)]
    fixed[-1] = end_s
    right = np.searchsorted(fixed, uniform).clip(1, len(fixed) - 1)
    gap = np.minimum(np.abs(uniform - fixed[right]), np.abs(uniform - fixed[right - 1]))
    times_s: Floats = np.union1d(fixed, uniform[gap > SAME_TIME_S])
    return times_s
