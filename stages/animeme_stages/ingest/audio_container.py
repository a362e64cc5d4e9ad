"""Sound in the containers of films and phones: MP4, M4A, QuickTime.

libsndfile does not read them; PyAV does, and comes with the extra ``video``.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from animeme.errors import InputError

# An ISO base media or QuickTime file starts with one of these boxes (ISO/IEC 14496-12, §4.2).
_BOXES = (b"ftyp", b"moov", b"wide", b"mdat", b"free", b"skip")
# Encoders pad by two frames at each end; what is missing beyond that was cut off.
_PADDING_S = 0.1


@dataclass(frozen=True)
class Contained:
    """The first sound track: samples of shape (S, channels), and their rate."""

    samples: NDArray[np.float32]
    rate_hz: int


def is_container(path: Path) -> bool:
    """Whether a file is such a container, going by its first bytes."""
    with path.open("rb") as stream:
        return stream.read(8)[4:] in _BOXES


def read_container(path: Path) -> Contained:
    """The first sound track of a film.

    Raises:
        InputError: the extra is not installed, or the file is damaged, cut, or has no sound.
    """
    try:
        import av
    except ImportError:
        raise InputError(
            "extra-missing",
            f"'{path.name}' is an MP4 or QuickTime file, whose reader is not installed",
            place="extra 'video'",
            action="Run `pip install 'animeme[video]'`, or export the sound as WAV or FLAC.",
        ) from None
    try:
        with av.open(str(path), "r") as film:
            if not film.streams.audio:
                raise InputError(
                    "audio-empty",
                    "holds no sound",
                    place=str(path),
                    action="Export the sound of the film as WAV or FLAC.",
                )
            return _decoded(film, film.streams.audio[0], path)
    except (av.FFmpegError, ValueError) as error:
        raise InputError(
            "audio-unreadable",
            f"cannot be decoded ({getattr(error, 'strerror', None) or error})",
            place=str(path),
            action="Export it again as WAV or FLAC.",
        ) from error


def _decoded(film: Any, track: Any, path: Path) -> Contained:
    from av import AudioResampler

    # One format; channels and rate stay as they are.
    resampler = AudioResampler(format="fltp")
    frames: list[Any] = []
    start_s = 0.0
    for frame in film.decode(track):
        if not frames and frame.pts is not None:
            start_s = float(frame.pts * frame.time_base)
        frames += resampler.resample(frame)
    if frames:
        frames += resampler.resample(None)
    if not frames:
        raise InputError(
            "audio-empty",
            "has no samples",
            place=str(path),
            action="Export the recording again.",
        )
    samples = np.concatenate([frame.to_ndarray() for frame in frames], axis=1).T
    rate_hz = int(frames[0].sample_rate)
    samples = _from_zero(samples, round(start_s * rate_hz))
    end_s = float(((track.duration or 0) + max(0, track.start_time or 0)) * track.time_base)
    if len(samples) / rate_hz < end_s - _PADDING_S:
        raise InputError(
            "audio-truncated",
            f"was cut off: {len(samples) / rate_hz:.2f} of {end_s:.2f} s are there",
            place=str(path),
            action="Copy or export the recording again.",
        )
    samples = samples[: max(1, round(end_s * rate_hz))] if end_s else samples
    return Contained(np.ascontiguousarray(samples, np.float32), rate_hz)


def _from_zero(samples: NDArray[np.float32], start: int) -> NDArray[np.float32]:
    """`samples` from the film's first moment: the encoder's lead-in cut, a late start filled."""
    if start <= 0:
        return samples[-start:]
    return np.pad(samples, ((start, 0), (0, 0)))
