"""Recordings: decoded, checked, brought to one channel and rate."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import soundfile
import soxr
from numpy.typing import NDArray

from animeme.contracts import Speech
from animeme.errors import InputError
from animeme.files import unreadable
from animeme.findings import Finding, Severity
from animeme_stages.ingest.audio_length import promised_sound

SPEECH_RATE_HZ = 16_000

# Quieter than this at its loudest, no voice can be heard over a 16-bit recording's own noise.
SILENT_PEAK_DBFS = -60.0
# Shorter than any word.
SHORTEST_S = 0.1


def read_speech(path: Path) -> Speech:
    """Read a recording for alignment.

    Args:
        path: any file that libsndfile decodes.

    Returns:
        The loudest channel at 16 kHz.

    Raises:
        InputError: missing, empty, damaged, truncated, silent or too short.
    """
    samples, rate_hz = _decode(path)
    duration_s = len(samples) / rate_hz
    findings: list[Finding] = []
    if samples.shape[1] > 1:
        channel = int(np.argmax(np.square(samples, dtype=np.float64).sum(axis=0)))
        message = f"{samples.shape[1]} channels; channel {channel + 1}, the loudest, is used"
        findings.append(Finding(Severity.INFO, "audio-channels", message, place=str(path)))
    else:
        channel = 0
    mono = samples[:, channel]
    _require_voice(path, mono, duration_s)
    if rate_hz < SPEECH_RATE_HZ:
        message = f"recorded at {rate_hz} Hz: consonants are harder to place"
        findings.append(Finding(Severity.INFO, "audio-narrowband", message, place=str(path)))
    pcm = speech_samples(mono, rate_hz)
    return Speech(path, pcm, SPEECH_RATE_HZ, duration_s, tuple(findings))


def speech_samples(mono: NDArray[np.float32], rate_hz: int) -> NDArray[np.int16]:
    """One channel, full scale 1, as aligners take it: int16 at `SPEECH_RATE_HZ`."""
    if rate_hz != SPEECH_RATE_HZ:
        mono = soxr.resample(mono, rate_hz, SPEECH_RATE_HZ)
    return np.clip(np.round(mono * 32768.0), -32768, 32767).astype(np.int16)


def _decode(path: Path) -> tuple[NDArray[np.float32], int]:
    """All samples, shape (S, channels), and the rate in Hz."""
    if not path.is_file():
        raise InputError(
            "audio-missing",
            "there is no such recording",
            place=str(path),
            action="Deliver it, take the line out of the folder, or run the job with --speak.",
        )
    if path.stat().st_size == 0:
        raise _empty(path)
    try:
        promise = promised_sound(path)
        if promise is not None and promise.missing > 0:
            raise _truncated(path, "its header promises more sound than there is")
        with soundfile.SoundFile(promise.repaired(path) if promise else path) as stream:
            promised = stream.frames
            samples = stream.read(dtype="float32", always_2d=True)
            rate_hz = int(stream.samplerate)
    except OSError as error:
        raise unreadable(path, "audio-unreadable", error) from error
    except (soundfile.SoundFileError, RuntimeError, ValueError) as error:
        raise InputError(
            "audio-unreadable",
            f"cannot be decoded ({_reason(error)})",
            place=str(path),
            action="Export it again as WAV or FLAC.",
        ) from error
    if len(samples) == 0:
        raise _empty(path)
    if len(samples) < promised:
        raise _truncated(path, f"{len(samples)} of {promised} samples are there")
    if not np.isfinite(samples).all():
        raise InputError(
            "audio-unreadable",
            "has samples that are not numbers",
            place=str(path),
            action="Export it again as WAV or FLAC.",
        )
    return samples, rate_hz


def _reason(error: Exception) -> str:
    """Libsndfile's own words, without the file's name, which the finding has."""
    return str(error).splitlines()[-1].rpartition(": ")[2].strip().rstrip(".")


def _require_voice(path: Path, mono: NDArray[np.float32], duration_s: float) -> None:
    if duration_s < SHORTEST_S:
        raise InputError(
            "audio-too-short",
            f"is {duration_s * 1000:.0f} ms long, too short for a word",
            place=str(path),
            action="Check the export range of the recording.",
        )
    peak_dbfs = 20 * np.log10(max(float(np.abs(mono).max()), 1e-9))
    if peak_dbfs < SILENT_PEAK_DBFS:
        raise InputError(
            "audio-silent",
            f"is silent (peak {peak_dbfs:.0f} dBFS)",
            place=str(path),
            action="Check the channel and the level of the export.",
        )


def _empty(path: Path) -> InputError:
    return InputError(
        "audio-empty",
        "has no samples",
        place=str(path),
        action="Export the recording again.",
    )


def _truncated(path: Path, detail: str) -> InputError:
    return InputError(
        "audio-truncated",
        f"was cut off: {detail}",
        place=str(path),
        action="Copy or export the recording again.",
    )
