"""Which of a recording's channels holds the voice."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import soxr
from numpy.typing import NDArray

from animeme.findings import Finding, Severity
from animeme_stages.ingest.audio_speech import RATE_HZ, measure

# A channel this far below the loudest holds only what leaked into it.
DEAD_DB = 40.0
# Correlation of channels that are copies of each other, and of those that are one performance: in
# stereo, or with a second microphone up to 1.7 m (5 ms) away. Two lines of `grid-s1` have 0.01 to
# 0.30 (median 0.06; 0.20 where each leaks into the other at -20 dB), one line in an echoing room at
# two microphones 0.23 to 0.74.
COPY = 0.98
TOGETHER = 0.22
_APART = RATE_HZ * 5 // 1000
# This much of the loudest stretch is enough to tell.
_COMPARED = 30 * RATE_HZ


def choose(
    samples: NDArray[np.float32], rate_hz: int, path: Path
) -> tuple[int, tuple[Finding, ...]]:
    """The channel to align, and why it is that one.

    Channels are never mixed: those of opposite phase would cancel each other, and a second voice
    or noise would cover the first.

    Args:
        samples: shape (S, channels), finite.
        rate_hz: of `samples`.
        path: the recording, for messages.
    """
    count = samples.shape[1]
    if count == 1:
        return 0, ()
    energy = np.var(samples, axis=0, dtype=np.float64)
    loudest = int(np.argmax(energy))
    live = np.flatnonzero(energy > energy[loudest] * 10 ** (-DEAD_DB / 10)).tolist()
    if len(live) <= 1:
        return loudest, (_said(path, count, loudest, "the only one with sound"),)
    parts = {channel: _resampled(samples[:, channel], rate_hz) for channel in live}
    strange = {channel: measure(parts[channel]).strange for channel in live}
    voices = [channel for channel in live if not strange[channel]] or live
    chosen = max(voices, key=lambda channel: float(energy[channel]))
    likeness = {c: _likeness(parts[chosen], parts[c]) for c in voices if c != chosen}
    mirrored = [channel for channel, alike in likeness.items() if alike < -COPY]
    apart = [channel for channel, alike in likeness.items() if alike < TOGETHER]
    if mirrored:
        message = (
            f"{count} channels; {mirrored[0] + 1} is {chosen + 1} upside down, so that they would "
            f"cancel each other if mixed; channel {chosen + 1} is used"
        )
        return chosen, (Finding(Severity.INFO, "audio-phase", message, place=str(path)),)
    if apart and not strange[chosen]:
        message = (
            f"channels {chosen + 1} and {apart[0] + 1} hold different voices or sounds; channel "
            f"{chosen + 1}, the louder, is used"
        )
        action = "Deliver one file per speaker, with nothing but the line in it."
        return chosen, (
            Finding(Severity.WARNING, "audio-voices", message, place=str(path), action=action),
        )
    if len(voices) < len(live):
        why = "the one with speech" if len(voices) == 1 else "the loudest with speech"
    elif all(alike > COPY for alike in likeness.values()):
        why = "the same as the others"
    else:
        why = "the loudest"
    return chosen, (_said(path, count, chosen, why),)


def _said(path: Path, count: int, channel: int, why: str) -> Finding:
    message = f"{count} channels; channel {channel + 1}, {why}, is used"
    return Finding(Severity.INFO, "audio-channels", message, place=str(path))


def _resampled(channel: NDArray[np.float32], rate_hz: int) -> NDArray[np.float32]:
    """A channel that is not silent, at `RATE_HZ`, centred, its peak at full scale."""
    centred = channel - channel.mean(dtype=np.float64)
    scaled = np.ascontiguousarray(centred / np.abs(centred).max(), np.float32)
    if rate_hz == RATE_HZ:
        return scaled
    return np.asarray(soxr.resample(scaled, rate_hz, RATE_HZ), np.float32)


def _likeness(a: NDArray[np.float32], b: NDArray[np.float32]) -> float:
    """Correlation of two channels, -1 to 1: at the same time, or up to 5 ms apart if that is more.

    Only the same time tells copies, so a shift never makes more than 0.97.
    """
    start = max(0, int(np.argmax(np.abs(a))) - _COMPARED // 2)
    a, b = a[start : start + _COMPARED], b[start : start + _COMPARED]
    scale = float(np.sqrt(np.sum(a * a, dtype=np.float64) * np.sum(b * b, dtype=np.float64)))
    if scale == 0.0:
        return 0.0
    now = float(np.dot(a, b)) / scale
    if abs(now) > 0.97:
        return now
    size = 1 << (len(a) + _APART).bit_length()
    product = np.fft.irfft(np.fft.rfft(a, size) * np.conj(np.fft.rfft(b, size)), size)
    near = np.concatenate((product[: _APART + 1], product[-_APART:]))
    return min(0.97, float(np.abs(near).max()) / scale)
