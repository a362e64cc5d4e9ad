"""Cepstra as the acoustic model was trained on.

Davis & Mermelstein 1980 with CMU Sphinx's parameters (``feat.params`` of the model): 25 mel filters
from 130 to 6,800 Hz, 13 liftered cepstra, mean normalisation per recording, first and second
differences; and its suppression of stationary noise.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cache

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float32]

RATE_HZ = 16_000
HOP = 160
FRAME_S = HOP / RATE_HZ
WINDOW = 410
# Windows that are transformed at once.
_BLOCK = 1000
_FFT = 512
_FILTERS = 25
_CEPSTRA = 13
_LOW_HZ, _HIGH_HZ = 130.0, 6800.0
_LIFTER = 22
_PREEMPHASIS = 0.97
# Added to the power before its logarithm, which digital silence has none of.
_LOG_FLOOR = 1e-4

# Half-way from this percentile of levels to the loudest is loud; frames this near it are active.
_FLOOR_PERCENTILE = 20
_NEAR = 50

# Noise tracking: how slowly power, its floor upwards and its floor downwards follow; masking after
# a peak; and the largest amplification or attenuation.
_POWER_KEEP, _RISE_KEEP, _FALL_KEEP = 0.7, 0.995, 0.5
_MASK_KEEP, _MASK_LEVEL = 0.85, 0.2
_MOST_GAIN = 20.0
_SMOOTH = 4


def frame_count(samples: int) -> int:
    """Frames of a recording of so many samples; one shorter than a window is led to its length."""
    return 1 + max(0, samples - WINDOW) // HOP


def levels_db(samples: NDArray[np.int16]) -> NDArray[np.float64]:
    """Mean power of each window in dB, 0 for digital silence, (T,)."""
    parts = [
        (windows.astype(np.float64) ** 2).mean(axis=1) for _, windows in _window_blocks(samples)
    ]
    result: NDArray[np.float64] = 10 * np.log10(np.concatenate(parts) + 1.0)
    return result


def _window_blocks(
    samples: NDArray[np.int16],
) -> Iterator[tuple[NDArray[np.int16], NDArray[np.int16]]]:
    """Windows of a recording, some at a time, each with the sample before each window.

    All windows of half an hour at once would take a gigabyte.
    """
    windows = np.lib.stride_tricks.sliding_window_view(samples, WINDOW)[::HOP]
    before = np.concatenate([samples[:1], samples[HOP - 1 :: HOP]])[: len(windows)]
    for start in range(0, len(windows), _BLOCK):
        yield before[start : start + _BLOCK], windows[start : start + _BLOCK]


def active(level_db: NDArray[np.float64]) -> NDArray[np.bool_]:
    """Frames in which something happens, or nearly; a minute of silence around a line is not.

    Args:
        level_db: of each frame, (T,).
    """
    middle_db = (np.percentile(level_db, _FLOOR_PERCENTILE) + level_db.max()) / 2
    count = np.concatenate([[0], np.cumsum(level_db >= middle_db)])
    frame = np.arange(len(level_db))
    after = np.minimum(frame + _NEAR + 1, len(level_db))
    result: NDArray[np.bool_] = count[after] > count[np.maximum(frame - _NEAR, 0)]
    return result


def features(
    samples: NDArray[np.int16], counted: NDArray[np.bool_]
) -> tuple[Floats, Floats, Floats]:
    """Cepstra, their first and second differences, each (T, 13); a frame is 10 ms.

    Args:
        samples: mono at 16 kHz, at least one window of 410.
        counted: (T,) frames over which the recording's colour is measured, to be taken off.
    """
    parts: list[NDArray[np.float64]] = []
    noise: _Noise | None = None
    for before, windows in _window_blocks(samples):
        power = _mel_power(before, windows)
        if noise is None:
            start = power[0] / _MOST_GAIN
            noise = _Noise(power[0].copy(), start, start, np.zeros_like(start))
        noise.remove(power)
        parts.append(np.log(power + _LOG_FLOOR) @ _cosines().T)
    cepstra = np.concatenate(parts)
    cepstra -= cepstra[counted].mean(axis=0)
    padded = np.pad(cepstra, ((3, 3), (0, 0)), mode="edge")
    count = len(cepstra)
    first = padded[5 : 5 + count] - padded[1 : 1 + count]
    later = padded[6 : 6 + count] - padded[2 : 2 + count]
    earlier = padded[4 : 4 + count] - padded[:count]
    return (
        cepstra.astype(np.float32),
        first.astype(np.float32),
        (later - earlier).astype(np.float32),
    )


def _mel_power(before: NDArray[np.int16], windows: NDArray[np.int16]) -> NDArray[np.float64]:
    """Power in each filter, (windows, filters)."""
    earlier = np.concatenate([before[:, None], windows[:, :-1]], axis=1)
    emphasized = windows - _PREEMPHASIS * earlier
    spectrum = np.fft.rfft(emphasized * _hamming(), _FFT)
    power: NDArray[np.float64] = np.abs(spectrum) ** 2 @ _mel_filters().T
    return power


@dataclass
class _Noise:
    """What suppression of noise remembers of the frames before, (filters,) each.

    Attributes:
        level: smoothed power.
        noise: its floor.
        floor: that of what is above the noise.
        peak: of what is above the noise, fading.
    """

    level: NDArray[np.float64]
    noise: NDArray[np.float64]
    floor: NDArray[np.float64]
    peak: NDArray[np.float64]

    def remove(self, power: NDArray[np.float64]) -> None:
        """Attenuate stationary noise in mel power, (T, filters), in place."""
        level = (1 - _POWER_KEEP) * power
        for now in level:
            now += _POWER_KEEP * self.level
            self.level = now
        noise = _lower_envelope(level, self.noise)
        signal = np.maximum(level - noise, 1.0)
        floor = _lower_envelope(signal, self.floor)
        faded = np.empty_like(signal)
        for now, sound in zip(faded, signal, strict=True):
            np.multiply(self.peak, _MASK_KEEP, out=now)
            self.peak = np.maximum(now, sound)
        masked = np.where(signal < faded, faded * (_MASK_LEVEL / _MASK_KEEP), signal)
        heard = np.maximum(masked, floor)
        gains = np.clip(heard / np.maximum(level, 1e-10), 1 / _MOST_GAIN, _MOST_GAIN)
        power *= gains @ _neighbours().T
        self.noise, self.floor = noise[-1], floor[-1]


def _lower_envelope(level: NDArray[np.float64], start: NDArray[np.float64]) -> NDArray[np.float64]:
    """What follows `level` slowly upwards and fast downwards, (T, filters)."""
    slow, fast = (1 - _RISE_KEEP) * level, (1 - _FALL_KEEP) * level
    result = np.empty_like(level)
    rising, before = np.empty_like(start), start
    for t in range(len(level)):
        # The smaller of the two is the one that applies: upwards the slow one, downwards the fast.
        np.multiply(before, _RISE_KEEP, out=rising)
        rising += slow[t]
        now = result[t]
        np.multiply(before, _FALL_KEEP, out=now)
        now += fast[t]
        np.minimum(now, rising, out=now)
        before = now
    return result


@cache
def _hamming() -> NDArray[np.float64]:
    return 0.54 - 0.46 * np.cos(2 * np.pi * np.arange(WINDOW) / (WINDOW - 1))


@cache
def _mel_filters() -> NDArray[np.float64]:
    """Triangles of unit area with corners on bins of the transform, (filters, bins)."""
    low, high = 2595 * np.log10(1 + np.array([_LOW_HZ, _HIGH_HZ]) / 700)
    corners_hz = 700 * (10 ** (np.linspace(low, high, _FILTERS + 2) / 2595) - 1)
    step_hz = RATE_HZ / _FFT
    corners_hz = np.round(corners_hz / step_hz) * step_hz
    left, middle, right = corners_hz[:-2, None], corners_hz[1:-1, None], corners_hz[2:, None]
    bins_hz = np.arange(_FFT // 2 + 1) * step_hz
    rising, falling = (bins_hz - left) / (middle - left), (right - bins_hz) / (right - middle)
    filters: NDArray[np.float64] = np.maximum(0, np.minimum(rising, falling)) * 2 / (right - left)
    return filters


@cache
def _cosines() -> NDArray[np.float64]:
    """Orthogonal cosine transform with its lifter, (cepstra, filters)."""
    order = np.arange(_CEPSTRA)
    cosines = np.cos(np.pi / _FILTERS * np.outer(order, np.arange(_FILTERS) + 0.5))
    cosines *= np.sqrt(2 / _FILTERS)
    cosines[0] *= np.sqrt(0.5)
    lifter = 1 + _LIFTER / 2 * np.sin(np.pi * order / _LIFTER)
    result: NDArray[np.float64] = cosines * lifter[:, None]
    return result


@cache
def _neighbours() -> NDArray[np.float64]:
    """Mean over a filter and its neighbours, (filters, filters)."""
    distance = np.abs(np.subtract.outer(np.arange(_FILTERS), np.arange(_FILTERS)))
    near = (distance <= _SMOOTH).astype(np.float64)
    result: NDArray[np.float64] = near / near.sum(axis=1, keepdims=True)
    return result
