"""Recordings for a browser: a file that it can play, and the waveform."""

from __future__ import annotations

import io
import struct
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import soundfile
import soxr
from numpy.typing import NDArray

from animeme_stages.ingest.audio import decode

PEAKS_HZ = 200
# Encodings within WAV that all browsers play.
_PLAIN_WAV = frozenset({"PCM_U8", "PCM_16", "PCM_24", "PCM_32", "FLOAT"})
_SAME = {
    "FLAC": (".flac", "audio/flac"),
    "MP3": (".mp3", "audio/mpeg"),
    "OGG": (".ogg", "audio/ogg"),
}
# Opus works at these rates only (RFC 6716, section 2).
_OPUS_HZ = (24_000, 48_000)


@dataclass(frozen=True)
class Sound:
    """A recording as a page holds it.

    Attributes:
        data: a file that a browser plays; None if the recording itself will do.
        suffix, mime: of that file.
        peaks: lowest and highest sample of each 1/`PEAKS_HZ` s, shape (N, 2).
        duration_s: its length.
    """

    data: bytes | None
    suffix: str
    mime: str
    peaks: NDArray[np.int8]
    duration_s: float


def sound_of(path: Path, *, small: bool) -> Sound:
    """The recording at `path` for a page.

    Args:
        path: any recording that a run takes.
        small: as few bytes as a voice needs, for a page that holds everything.

    Raises:
        InputError: it cannot be read.
    """
    decoded = decode(path)
    samples, rate_hz = decoded.samples, decoded.rate_hz
    duration_s = len(samples) / rate_hz
    peaks = _peaks(samples, rate_hz)
    if small:
        return Sound(_opus(samples.mean(axis=1), rate_hz), ".ogg", "audio/ogg", peaks, duration_s)
    suffix, mime = _playable(path)
    if suffix:
        return Sound(None, suffix, mime, peaks, duration_s)
    out = io.BytesIO()
    soundfile.write(out, np.clip(samples[:, :2], -1.0, 1.0), rate_hz, format="FLAC")
    return Sound(out.getvalue(), ".flac", "audio/flac", peaks, duration_s)


def _playable(path: Path) -> tuple[str, str]:
    """Suffix and type of a file that every browser plays; "" if it is none."""
    try:
        about = soundfile.info(path)
    except (OSError, soundfile.SoundFileError):
        return "", ""
    if about.format in ("WAV", "WAVEX") and about.subtype in _PLAIN_WAV:
        return ".wav", "audio/wav"
    return _SAME.get(about.format, ("", ""))


def _peaks(samples: NDArray[np.float32], rate_hz: int) -> NDArray[np.int8]:
    loudest = samples[np.arange(len(samples)), np.abs(samples).argmax(axis=1)]
    edges = (np.arange(int(np.ceil(len(samples) * PEAKS_HZ / rate_hz))) * rate_hz) // PEAKS_HZ
    edges = edges[edges < len(samples)]
    low = np.minimum.reduceat(loudest, edges)
    high = np.maximum.reduceat(loudest, edges)
    return np.clip(np.round(np.stack([low, high], 1) * 127), -127, 127).astype(np.int8)


def _opus(mono: NDArray[np.float32], rate_hz: int) -> bytes:
    """Ogg Opus, the same bytes each time."""
    target = next((rate for rate in _OPUS_HZ if rate >= rate_hz), _OPUS_HZ[-1])
    if target != rate_hz:
        mono = soxr.resample(mono, rate_hz, target)
    out = io.BytesIO()
    soundfile.write(
        out, np.clip(mono, -1.0, 1.0), target, format="OGG", subtype="OPUS", compression_level=0.9
    )
    return _with_serial(out.getvalue(), 1)


def _with_serial(data: bytes, serial: int) -> bytes:
    """An Ogg stream with another serial number: encoders draw theirs at random (RFC 3533)."""
    out = bytearray(data)
    at = 0
    while at < len(out):
        segments = out[at + 26]
        size = 27 + segments + sum(out[at + 27 : at + 27 + segments])
        out[at + 14 : at + 18] = struct.pack("<I", serial)
        out[at + 22 : at + 26] = bytes(4)
        out[at + 22 : at + 26] = struct.pack("<I", _ogg_crc(out[at : at + size]))
        at += size
    return bytes(out)


def _crc_table() -> tuple[int, ...]:
    table = []
    for byte in range(256):
        value = byte << 24
        for _ in range(8):
            value = (value << 1) ^ (0x04C11DB7 if value & 0x80000000 else 0)
        table.append(value & 0xFFFFFFFF)
    return tuple(table)


_TABLE = _crc_table()


def _ogg_crc(page: bytes | bytearray) -> int:
    """Checksum of an Ogg page (RFC 3533, section 6)."""
    value = 0
    for byte in page:
        value = ((value << 8) & 0xFFFFFFFF) ^ _TABLE[(value >> 24) ^ byte]
    return value
