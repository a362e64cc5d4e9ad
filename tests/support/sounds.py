"""Sounds that are no speech, three seconds each, full scale 1."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

RATE_HZ = 16_000
_COUNT = 3 * RATE_HZ
_TIMES_S = np.arange(_COUNT) / RATE_HZ
# A pentatonic scale over two octaves.
_NOTES_HZ = (220.0, 247.5, 277.2, 330.0, 371.3, 440.0, 495.0, 554.4, 660.0, 742.5)


def _scaled(sound: np.ndarray) -> np.ndarray:
    return sound / np.abs(sound).max() * 0.6


def _white(seed: int = 1) -> np.ndarray:
    return np.random.default_rng(seed).normal(0, 0.1, _COUNT)


def _traffic() -> np.ndarray:
    """Noise whose power falls with frequency."""
    return _scaled(np.convolve(_white(), np.exp(-np.arange(400) / 60), "same"))


def _brown() -> np.ndarray:
    walk = np.cumsum(_white())
    return _scaled(walk - np.convolve(walk, np.ones(800) / 800, "same"))


def _tune(chord: int, note_s: float, decay_hz: float, partials: int) -> np.ndarray:
    chance = np.random.default_rng(2)
    sound = np.zeros(_COUNT)
    step = round(note_s * RATE_HZ)
    for start in range(0, _COUNT, step):
        times_s = _TIMES_S[: _COUNT - start]
        for pitch_hz in chance.choice(_NOTES_HZ, chord, replace=False):
            for partial in range(1, partials + 1):
                wave = np.sin(2 * np.pi * pitch_hz * partial * times_s) / partial
                sound[start:] += wave * np.exp(-decay_hz * times_s)
    return _scaled(sound)


def _drums() -> np.ndarray:
    beat = np.arange(_COUNT) % (RATE_HZ // 4)
    return _white() * np.exp(-beat / 400)


def _clicks(count: int, length: int) -> np.ndarray:
    sound = np.zeros(_COUNT)
    for start in np.linspace(1000, _COUNT - 1000, count).astype(int):
        sound[start : start + length] = 0.9
    return sound


SOUNDS: dict[str, Callable[[], np.ndarray]] = {
    "white noise": _white,
    "traffic": _traffic,
    "rumble": _brown,
    "surf": lambda: _white() * (0.55 + 0.45 * np.sin(2 * np.pi * 0.7 * _TIMES_S)),
    "pulsed noise": lambda: _white() * (0.55 + 0.45 * np.sin(2 * np.pi * 3 * _TIMES_S)),
    "noise and nothing": lambda: _white() * (_TIMES_S < 1.5),
    "tone": lambda: 0.3 * np.sin(2 * np.pi * 440 * _TIMES_S),
    "beeps": lambda: 0.3 * np.sin(2 * np.pi * 1000 * _TIMES_S) * (_TIMES_S % 0.5 < 0.25),
    "hum": lambda: _scaled(sum(np.sin(2 * np.pi * f * _TIMES_S) / f for f in (50, 150, 250))),
    "sweep": lambda: 0.3 * np.sin(2 * np.pi * (200 * _TIMES_S + 300 * _TIMES_S**2)),
    "siren": lambda: 0.3 * np.sin(2 * np.pi * 700 * _TIMES_S + 90 * np.sin(4 * _TIMES_S)),
    "piano": lambda: _tune(3, 0.4, 3.0, 4),
    "organ": lambda: _tune(3, 0.5, 0.1, 6),
    "plucked strings": lambda: _tune(1, 0.25, 6.0, 8),
    "drums": _drums,
    "one click": lambda: _clicks(1, 1),
    "clicks": lambda: _clicks(12, 3),
    "clicks in noise": lambda: _clicks(12, 3) + 0.01 * _white(),
}
