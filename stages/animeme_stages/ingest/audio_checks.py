"""Faults of a recording that can be heard, and what a producer should know about them."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from animeme.findings import Finding, Severity
from animeme_stages.ingest.audio_speech import Sound

# Telephone sound ends below 4 kHz; what a resampler leaves above is far below this. Right lines
# have more than -50 dB there.
NARROW_HZ = 4_200.0
NARROW_DB = -60.0
NARROW_RATE_HZ = 16_000
# A single vowel may have no treble.
NARROW_SOUND_S = 0.5

# Consecutive samples at a recording's highest or lowest value. One peak that was normalised to
# full scale is one sample; 1,000 right lines have one run of this length between them.
CLIPPED_RUN = 3
# Samples of 8 bits and less are equal at every peak.
COARSE_CLIPPED_RUN = 8
# A few clipped peaks are heard by nobody; a share of these marks a spoilt take.
CLIPPED_RUNS = 5
CLIPPED_SHARE = 0.001

# Median level of what is sound; right lines have -39 to -17 dB of full scale.
QUIET_DB = -50.0

OFFSET = 0.02
OVER_SCALE = 10 ** (1 / 20)


def offset(mono: NDArray[np.float32]) -> float:
    """How far the sound's middle is from zero, full scale 1; 0 where that does not matter."""
    middle = float(np.mean(mono, dtype=np.float64))
    loudness = float(np.std(mono, dtype=np.float64))
    return middle if abs(middle) > OFFSET and abs(middle) > 0.1 * loudness else 0.0


def clipping(mono: NDArray[np.float32], *, coarse: bool) -> tuple[int, float]:
    """How many peaks are cut flat, and their share of all samples.

    Args:
        mono: as recorded, shape (S,); levels after clipping do not matter.
        coarse: the samples have 8 bits or less, so that only full scale is a sign.
    """
    runs = [0]
    for side in (mono, -mono):
        peak = float(side.max())
        if peak <= 0 or (coarse and peak < 0.98):
            continue
        flat = np.flatnonzero(side >= peak * (1 - 1e-4))
        lengths = np.diff(np.flatnonzero(np.diff(flat, prepend=-2, append=flat[-1] + 2) > 1))
        runs += lengths[lengths >= (COARSE_CLIPPED_RUN if coarse else CLIPPED_RUN)].tolist()
    return len(runs) - 1, sum(runs) / len(mono)


def heard(
    mono: NDArray[np.float32], sound: Sound, *, rate_hz: int, coarse: bool, path: Path
) -> Iterator[Finding]:
    """What is wrong with a recording that can be used nevertheless.

    Args:
        mono: the chosen channel as recorded, centred, shape (S,).
        sound: what was measured of it.
        rate_hz: as recorded.
        coarse: see `clipping`.
        path: the recording, for messages.
    """

    def finding(severity: Severity, code: str, message: str, action: str = "") -> Finding:
        return Finding(severity, code, message, place=str(path), action=action)

    peak = float(np.abs(mono).max())
    if peak > OVER_SCALE:
        over_db = 20 * np.log10(peak)
        message = f"goes {over_db:.0f} dB beyond full scale and was turned down to be read"
        yield finding(Severity.INFO, "audio-over-scale", message)
    if sound.level_db < QUIET_DB:
        yield finding(
            Severity.WARNING,
            "audio-quiet",
            f"is very quiet (its sound is at {sound.level_db:.0f} dBFS)",
            "Check the gain of the recording, and that this is the right channel.",
        )
    if sound.strange:
        yield finding(
            Severity.WARNING,
            "audio-no-speech",
            f"sounds like {sound.strange}; no speech was made out",
            "Listen to it: the wrong file, or the wrong channel.",
        )
        return  # what follows is about voices
    count, share = clipping(mono, coarse=coarse)
    if count >= CLIPPED_RUNS:
        spoilt = share >= CLIPPED_SHARE
        yield finding(
            Severity.WARNING if spoilt else Severity.INFO,
            "audio-clipped",
            f"is clipped: {count} peaks are cut flat ({share:.2%} of the recording)",
            "Use a take that was recorded at a lower level." if spoilt else "",
        )
    if rate_hz < NARROW_RATE_HZ:
        yield finding(
            Severity.WARNING,
            "audio-narrowband",
            f"was recorded at {rate_hz} Hz, so it lacks the treble that tells consonants apart",
            f"Deliver it at {NARROW_RATE_HZ} Hz or more, from the original.",
        )
    elif sound.sound_s >= NARROW_SOUND_S and is_narrow(mono, rate_hz):
        yield finding(
            Severity.WARNING,
            "audio-narrowband",
            f"holds nothing above {NARROW_HZ / 1000:.1f} kHz although it has {rate_hz} Hz: it was "
            "made from telephone sound or lost its treble",
            "Deliver the original; if the sound is meant to be dull, deliver it before the effect.",
        )


def is_narrow(mono: NDArray[np.float32], rate_hz: int) -> bool:
    """Whether a recording could hold treble and has none."""
    size = 1024
    above = below = 0.0
    first = int(np.ceil(NARROW_HZ * size / rate_hz))
    window = np.hanning(size).astype(np.float32)
    last = size * min(8_000, rate_hz // 2) // rate_hz
    most = 128 * size  # samples at a time: larger arrays take longer, piece for piece
    for start in range(0, len(mono), most):
        part = mono[start : start + most]
        frames = np.pad(part, (0, -len(part) % size)).reshape(-1, size) * window
        power = (np.abs(np.fft.rfft(frames, axis=1)) ** 2).sum(axis=0)
        above += float(power[first:last].sum())
        below += float(power[:first].sum())
    return above < below * 10 ** (NARROW_DB / 10)
