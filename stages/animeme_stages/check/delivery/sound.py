"""What a recording tells of the mouth: how loud it is, and in which bands; and how two fit."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache

import numpy as np
import soxr
from numpy.typing import NDArray

from animeme.contracts import Speech
from animeme.curves import Floats

RATE_HZ = 100
"""Frames per second of everything here."""
BANDS = 16
CONTEXT = tuple(range(-24, 25, 3))
"""Frames that the guess looks at, relative to its own."""
_AUDIO_HZ = 16_000
_FFT = 512
# Bands below this, relative to their loud frames, tell of the room and not of the mouth (nepers).
_FLOOR = -10.0
# Slower movement than this, in seconds, is posture; it would correlate with anything.
_SLOW_S = 0.15
# Sound this far below the loud parts is silence; breath and room are louder (dB).
SILENT_DB = -40.0
# Speech within this of the loud parts is a vowel or near one (dB).
VOICED_DB = -18.0


def level_db(speech: Speech) -> Floats:
    """Level of each frame relative to the loud ones (95th percentile), shape (F,)."""
    frames = _frames(speech)
    power = (frames**2).mean(axis=1)
    level = 10 * np.log10(power + 1e-10)
    return np.asarray(level - np.percentile(level, 95))


def features(speech: Speech) -> Floats:
    """What the guess is made from, shape (F, BANDS × len(CONTEXT) + 1)."""
    spectrum = np.fft.rfft(_frames(speech) * np.hanning(_FFT))
    bands = np.log((spectrum.real**2 + spectrum.imag**2) @ _mel().T + 1e-7)
    bands = np.maximum(bands - np.percentile(bands, 95, axis=0), _FLOOR)
    reach = CONTEXT[-1]
    padded = np.pad(bands, ((reach, reach), (0, 0)), mode="edge")
    columns = [padded[reach + c : reach + c + len(bands)] for c in CONTEXT]
    return np.hstack([*columns, np.ones((len(bands), 1))])


def without_posture(signal: Floats) -> Floats:
    """A signal at `RATE_HZ` without what is slower than syllables."""
    sigma = _SLOW_S * RATE_HZ
    reach = int(3 * sigma)
    kernel = np.exp(-0.5 * (np.arange(-reach, reach + 1) / sigma) ** 2)
    kernel /= kernel.sum()
    slow = np.convolve(np.pad(signal, reach, mode="symmetric"), kernel, "valid")
    return np.asarray(signal - slow)


@dataclass(frozen=True)
class Fit:
    """How two signals fit at each lag.

    Attributes:
        lags_s: of the first signal, seconds, positive where it is late, shape (L,).
        scores: correlations there, -1 to 1, shape (L,).
    """

    lags_s: Floats
    scores: Floats

    @property
    def lag_s(self) -> float:
        """Where they fit best."""
        return float(self.lags_s[np.argmax(self.scores)])

    @property
    def likeness(self) -> float:
        """How well they fit there."""
        return float(self.scores.max())

    def best(self, within_s: float) -> tuple[float, float]:
        """How well they fit at best at lags up to `within_s`, and at best at any other."""
        near = np.abs(self.lags_s) <= within_s + 1e-9
        return float(self.scores[near].max()), float(self.scores[~near].max(initial=0.0))


def fit_of(moved: Floats, expected: Floats, most_s: float) -> Fit:
    """How two signals at `RATE_HZ` fit.

    Args:
        moved: shape (F,).
        expected: shape (F,).
        most_s: largest lag that is looked at, seconds.
    """
    most = round(most_s * RATE_HZ)
    scores = []
    for lag in range(-most, most + 1):
        first = moved[max(0, lag) : len(moved) + min(0, lag)]
        second = expected[max(0, -lag) : len(expected) + min(0, -lag)]
        first, second = first - first.mean(), second - second.mean()
        norm = np.sqrt((first @ first) * (second @ second))
        scores.append(first @ second / norm if norm > 1e-12 else 0.0)
    return Fit(np.arange(-most, most + 1) / RATE_HZ, np.array(scores))


def _frames(speech: Speech) -> Floats:
    """Frames around each hundredth of a second, full scale 1, shape (F, 512)."""
    mono = speech.samples.astype(np.float64) / 32768
    if speech.rate_hz != _AUDIO_HZ:
        mono = soxr.resample(mono, speech.rate_hz, _AUDIO_HZ)
    padded = np.pad(mono, (_FFT // 2, _FFT // 2))
    return np.lib.stride_tricks.sliding_window_view(padded, _FFT)[:: _AUDIO_HZ // RATE_HZ]


@cache
def _mel() -> NDArray[np.float64]:
    """Triangles of equal width in mel between 100 and 7000 Hz, shape (BANDS, bins)."""
    at_hz = np.linspace(0, _AUDIO_HZ / 2, _FFT // 2 + 1)
    low, high = (2595 * np.log10(1 + hz / 700) for hz in (100, 7000))
    edges = 700 * (10 ** (np.linspace(low, high, BANDS + 2) / 2595) - 1)
    rising = (at_hz - edges[:-2, None]) / np.diff(edges)[:-1, None]
    falling = (edges[2:, None] - at_hz) / np.diff(edges)[1:, None]
    return np.asarray(np.clip(np.minimum(rising, falling), 0, None))
