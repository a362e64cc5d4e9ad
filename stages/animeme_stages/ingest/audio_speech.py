"""Whether a sound could be speech at all, by three properties that every voice has.

Speech rises and falls with its syllables, it has a voice or at least the formants of a whisper, and
no sound in it stays as it is for long (Scheirer and Slaney 1997, "Construction and evaluation of a
robust multifeature speech/music discriminator", use the same three). Only what is far from all
speech is told apart here: music with a singer, or a crowd, is for the aligner to refuse.

Thresholds were set between 1,000 recorded lines in five languages, the same lines whispered
(synthetically) or in noise down to 5 dB below the voice, and synthetic noises, beeps and music;
``docs/alignment.md`` has the figures.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

RATE_HZ = 16_000

_FRAME, _HOP = 512, 320  # 32 ms every 20 ms
# Frames that are worked on at a time: memory must not grow with the recording's length, and with
# four times as many, those of 20 s take twice the time.
_BLOCK = 256
# What the spectrum is compared over: 100 ms are most of a syllable.
_LAG = 3
# Sound is what lies within this of the loud parts, and above a 16-bit recording's own noise.
_SOUND_DB = 25.0
_FLOOR_DB = -80.0
# Lag in samples of voices between 70 and 400 Hz.
_PERIODS = slice(RATE_HZ // 400, RATE_HZ // 70)

# Right lines reach 0.04; sustained notes and beeps start at 0.26.
STEADY_SHARE = 0.2
# Standard deviation of the level in dB, as recorded and with the treble raised. Right lines have
# more than 4.3 in both, and 2.7 and 0.5 in noise 5 dB below them; steady noises up to 3.3 and 1.0.
# Below the first nothing speaks, whatever the treble does.
EVEN_DB = 1.5
LEVEL_DB, TREBLE_DB = 3.7, 1.2
# Noise has a flatness of 0.5 and no voice. Right lines stay below 0.08, whispers below 0.2; lines
# in noise of their own level have 0.5, but a voice in a tenth of their frames.
NOISE_FLATNESS, NOISE_VOICED = 0.3, 0.05
# A word's sound goes on for at least 0.1 s; clicks for two or three frames.
CLICK_FRAMES = 3
# Less sound than this is too little to judge.
SHORTEST_SOUND_S = 0.3


@dataclass(frozen=True)
class Sound:
    """What is measured of a recording, over the frames that are loud enough.

    Attributes:
        sound_s: seconds of sound.
        longest_s: longest stretch of it.
        level_db: median level of the sound, dB of full scale.
        swing_db: standard deviation of its level, as recorded and with the treble raised.
        steady: share of frames whose spectrum is that of 60 ms before.
        voiced: share of frames with a pitch; looked for in what is as flat as noise, else 1.
        flatness: median spectral flatness, 0 a tone, 0.56 white noise.
    """

    sound_s: float
    longest_s: float
    level_db: float
    swing_db: tuple[float, float]
    steady: float
    voiced: float
    flatness: float

    @property
    def strange(self) -> str:
        """What it sounds like if that cannot be speech, "" if it can."""
        if 0.0 < self.longest_s <= CLICK_FRAMES * _HOP / RATE_HZ:
            return "nothing but clicks"
        if self.sound_s < SHORTEST_SOUND_S:
            return ""
        if self.steady > STEADY_SHARE:
            return "steady tones, like music or beeps"
        level_db, treble_db = self.swing_db
        if level_db < EVEN_DB or (level_db < LEVEL_DB and treble_db < TREBLE_DB):
            return "an even noise or hum"
        if self.flatness > NOISE_FLATNESS and self.voiced < NOISE_VOICED:
            return "noise"
        return ""


def measure(mono: NDArray[np.float32]) -> Sound:
    """Measure a recording.

    Args:
        mono: samples at `RATE_HZ`, full scale 1, without offset, shape (S,).
    """
    columns = [_measured(block) for block in _blocks(mono)]
    level, treble, steady, flatness = np.concatenate(columns, axis=1)
    top = np.percentile(level, 95)
    sound = level > max(top - _SOUND_DB, _FLOOR_DB)
    if not sound.any():
        return Sound(0.0, 0.0, float(top), (0.0, 0.0), 0.0, 0.0, 0.0)
    both = sound & np.roll(sound, _LAG)
    both[:_LAG] = False
    edges = np.flatnonzero(np.diff(np.concatenate(([0], sound.astype(np.int8), [0]))))
    hop_s = _HOP / RATE_HZ
    flat = float(np.median(flatness[sound]))
    return Sound(
        sound_s=float(sound.sum() * hop_s),
        longest_s=float((edges[1::2] - edges[::2]).max() * hop_s),
        level_db=float(np.median(level[sound])),
        swing_db=(float(level[sound].std()), float(_loud(treble).std())),
        steady=float((steady[both] > 0.98).mean()) if both.any() else 0.0,
        voiced=_voiced(mono, sound) if flat > NOISE_FLATNESS else 1.0,
        flatness=flat,
    )


def _loud(level: NDArray[np.floating]) -> NDArray[np.floating]:
    chosen: NDArray[np.floating] = level[level > np.percentile(level, 95) - _SOUND_DB]
    return chosen


def _blocks(mono: NDArray[np.float32]) -> Iterator[NDArray[np.float32]]:
    """Frames of consecutive stretches, each after the `_LAG` frames that precede it."""
    if len(mono) < _FRAME:
        mono = np.pad(mono, (0, _FRAME - len(mono)))
    frames = np.lib.stride_tricks.sliding_window_view(mono, _FRAME)[::_HOP]
    for start in range(0, len(frames), _BLOCK):
        padded = max(0, start - _LAG)
        yield np.pad(
            frames[padded : start + _BLOCK], ((_LAG - (start - padded), 0), (0, 0)), mode="edge"
        )


_WINDOW = np.hanning(_FRAME).astype(np.float32)
_WINDOW_CORRELATION = np.correlate(_WINDOW, _WINDOW, "full")[_FRAME - 1 :]
# The usual raising of the treble, a first difference, and its power gain per bin.
_RAISING = np.float32(0.97)
_TREBLE = (
    np.abs(1 - _RAISING * np.exp(-2j * np.pi * np.arange(_FRAME // 2 + 1) / _FRAME)) ** 2
).astype(np.float32)


def _measured(frames: NDArray[np.float32]) -> NDArray[np.floating]:
    """Level, level with raised treble, likeness to 60 ms before, flatness: shape (4, F)."""
    windowed = frames * _WINDOW
    power = _power(windowed)
    raised = power * _TREBLE
    amplitude = np.sqrt(raised[:, 3:160])  # 94 Hz to 5 kHz
    amplitude /= np.linalg.norm(amplitude, axis=1, keepdims=True) + 1e-9
    alike = (amplitude[_LAG:] * amplitude[:-_LAG]).sum(axis=1)
    windowed, power, raised = windowed[_LAG:], power[_LAG:], raised[_LAG:]
    level = _level_db(windowed, power)
    treble = _level_db(windowed[:, 1:] - _RAISING * windowed[:, :-1], raised)
    bands = power[:, 3:-1] + 1e-12
    flatness = np.exp(np.log(bands).mean(axis=1)) / bands.mean(axis=1)
    return np.stack((level, treble, alike, flatness))


def _power(frames: NDArray[np.float32]) -> NDArray[np.floating]:
    """Power of each bin from 0 Hz up."""
    # SciPy's is faster, but takes every worker a third of a second to load.
    spectrum = np.fft.rfft(frames, axis=1)
    return spectrum.real**2 + spectrum.imag**2


def _level_db(frames: NDArray[np.float32], power: NDArray[np.floating]) -> NDArray[np.floating]:
    """Level of windowed frames; their lowest and highest bins, which are not mirrored, count twice.

    The samples' own sum (Parseval) is what twice as fine a spectrum would give.
    """
    ends = (power[:, 0] + power[:, -1]) / (2 * _FRAME)
    level: NDArray[np.floating] = 10 * np.log10(((frames**2).sum(axis=1) + ends) / _FRAME + 1e-12)
    return level


def _voiced(mono: NDArray[np.float32], sound: NDArray[np.bool_]) -> float:
    """Share of the frames in `sound` with a pitch: normalised autocorrelation (Boersma 1993)."""
    own = _WINDOW_CORRELATION[_PERIODS] / _WINDOW_CORRELATION[0]
    periodic = []
    for frames in _blocks(mono):
        padded = np.pad(frames[_LAG:] * _WINDOW, ((0, 0), (0, _FRAME)))  # not to go round
        correlation = np.fft.irfft(_power(padded), axis=1)
        peaks = correlation[:, _PERIODS] / (correlation[:, :1] * own + 1e-12)
        periodic.append(peaks.max(axis=1))
    return float((np.concatenate(periodic)[sound] > 0.6).mean())
