"""Recordings: decoded, checked, brought to one channel and rate."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
import soundfile
import soxr
from numpy.typing import NDArray

from animeme.contracts import Speech
from animeme.errors import InputError
from animeme.files import unreadable
from animeme.findings import Finding, Severity
from animeme_stages.ingest.audio_channels import choose
from animeme_stages.ingest.audio_checks import heard, offset
from animeme_stages.ingest.audio_container import is_container, read_container
from animeme_stages.ingest.audio_length import promised_sound
from animeme_stages.ingest.audio_speech import measure

SPEECH_RATE_HZ = 16_000

# Quieter than this at its loudest, no voice can be heard over a 16-bit recording's own noise.
SILENT_PEAK_DBFS = -60.0
# Shorter than any word.
SHORTEST_S = 0.1
# Encodings of 8 bits and less, in libsndfile's names.
_COARSE = frozenset({"PCM_U8", "PCM_S8", "ULAW", "ALAW", "IMA_ADPCM", "MS_ADPCM", "GSM610"})


def read_speech(path: Path) -> Speech:
    """Read a recording for alignment, and say what is wrong with it.

    Args:
        path: any file that libsndfile decodes; films and AAC with the extra ``video``.

    Returns:
        The channel with the voice at 16 kHz, centred.

    Raises:
        InputError: missing, empty, damaged, truncated, silent or too short, or its extra is not
            installed.
    """
    decoded = decode(path)
    samples, rate_hz = decoded.samples, decoded.rate_hz
    duration_s = len(samples) / rate_hz
    _require_length(path, duration_s)
    channel, said = choose(samples, rate_hz, path)
    findings = list(said)
    mono = np.ascontiguousarray(samples[:, channel])
    middle = offset(mono)
    if middle:
        mono = mono - np.float32(middle)
        message = f"is off centre by {abs(middle):.0%} of full scale and was centred to be read"
        findings.append(Finding(Severity.INFO, "audio-dc-offset", message, place=str(path)))
    peak = _require_voice(path, mono)
    speech = resampled(mono, rate_hz)
    if peak > 1.0:
        speech = speech / np.float32(peak)
    sound = measure(speech)
    findings += heard(mono, sound, rate_hz=rate_hz, coarse=decoded.coarse, path=path)
    return Speech(path, quantized(speech), SPEECH_RATE_HZ, duration_s, tuple(findings))


def resampled(mono: NDArray[np.float32], rate_hz: int) -> NDArray[np.float32]:
    """One channel at `SPEECH_RATE_HZ`."""
    if rate_hz == SPEECH_RATE_HZ:
        return mono
    result: NDArray[np.float32] = soxr.resample(mono, rate_hz, SPEECH_RATE_HZ)
    return result


def quantized(samples: NDArray[np.float32]) -> NDArray[np.int16]:
    """Samples of full scale 1 as 16-bit integers."""
    scaled = samples * 32768.0  # the only copy: recordings may be long
    np.round(scaled, out=scaled)
    return np.clip(scaled, -32768, 32767, out=scaled).astype(np.int16)


@dataclass(frozen=True)
class Decoded:
    """Samples of shape (S, channels), their rate, and whether they have but 8 bits or less."""

    samples: NDArray[np.float32]
    rate_hz: int
    coarse: bool


def decode(path: Path) -> Decoded:
    """All samples of a recording, whole and finite, of at least one channel.

    Raises:
        InputError: missing, empty, damaged or truncated, or its extra is not installed.
    """
    if not path.is_file():
        raise InputError(
            "audio-missing",
            "there is no such recording",
            place=str(path),
            action="Deliver it, take the line out of the folder, or run the job with --speak.",
        )
    if path.stat().st_size == 0:
        raise _empty(path)
    if is_container(path):
        container = read_container(path)
        return Decoded(_sound(path, container.samples), container.rate_hz, coarse=False)
    try:
        promise = promised_sound(path)
        if promise is not None and promise.missing > 0:
            raise _truncated(path, "its header promises more sound than there is")
        with soundfile.SoundFile(promise.repaired(path) if promise else path) as stream:
            promised = stream.frames
            samples = stream.read(dtype="float32", always_2d=True)
            rate_hz = int(stream.samplerate)
            coarse = stream.subtype in _COARSE
    except OSError as error:
        raise unreadable(path, "audio-unreadable", error) from error
    except (soundfile.SoundFileError, RuntimeError, ValueError) as error:
        raise InputError(
            "audio-unreadable",
            f"cannot be decoded ({_reason(error)})",
            place=str(path),
            action="Export it again as WAV or FLAC.",
        ) from error
    if len(samples) < promised:
        raise _truncated(path, f"{len(samples)} of {promised} samples are there")
    return Decoded(_sound(path, samples), rate_hz, coarse)


def _sound(path: Path, samples: NDArray[np.float32]) -> NDArray[np.float32]:
    """`samples` if they are some, and numbers."""
    if len(samples) == 0:
        raise _empty(path)
    if not np.isfinite(samples).all():
        raise InputError(
            "audio-unreadable",
            "has samples that are not numbers",
            place=str(path),
            action="Export it again as WAV or FLAC.",
        )
    return samples


def _reason(error: Exception) -> str:
    """Libsndfile's own words, without the file's name, which the finding has."""
    return str(error).splitlines()[-1].rpartition(": ")[2].strip().rstrip(".")


def _require_length(path: Path, duration_s: float) -> None:
    if duration_s < SHORTEST_S:
        raise InputError(
            "audio-too-short",
            f"is {duration_s * 1000:.0f} ms long, too short for a word",
            place=str(path),
            action="Check the export range of the recording.",
        )


def _require_voice(path: Path, mono: NDArray[np.float32]) -> float:
    """The highest sample's magnitude, of a sound that is not silent."""
    peak = max(float(mono.max()), -float(mono.min()))
    peak_dbfs = 20 * np.log10(max(peak, 1e-9))
    if peak_dbfs < SILENT_PEAK_DBFS:
        raise InputError(
            "audio-silent",
            f"is silent (peak {peak_dbfs:.0f} dBFS)",
            place=str(path),
            action="Check the channel and the level of the export.",
        )
    return peak


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
