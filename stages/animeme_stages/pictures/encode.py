"""Films written by PyAV, or by the program ffmpeg where PyAV is not installed."""

from __future__ import annotations

import shutil
import subprocess
import tempfile
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from fractions import Fraction
from pathlib import Path
from typing import Any

import numpy as np
import soundfile
import soxr

from animeme.errors import InputError
from animeme_stages.pictures.raster import Singles
from animeme_stages.pictures.shade import Pixels

# One thread each and no word about versions: the same film has the same bytes.
_VIDEO = {"crf": "20", "preset": "medium", "threads": "1", "x264-params": "threads=1"}
_AUDIO_BIT_RATE = 128_000
# What AAC knows; others are brought to the next one above.
_RATES_HZ = (16_000, 22_050, 24_000, 32_000, 44_100, 48_000)


@dataclass(frozen=True, eq=False)
class Sound:
    """A recording: samples (S, 1 or 2), full scale 1, and their rate."""

    samples: Singles
    rate_hz: int

    @property
    def duration_s(self) -> float:
        """Length in seconds."""
        return len(self.samples) / self.rate_hz

    def known(self) -> Sound:
        """The same at a rate that AAC knows."""
        rate_hz = next((rate for rate in _RATES_HZ if rate >= self.rate_hz), _RATES_HZ[-1])
        if rate_hz == self.rate_hz:
            return self
        return Sound(soxr.resample(self.samples, self.rate_hz, rate_hz), rate_hz)


Writer = Callable[[Path, Iterable[Pixels], tuple[int, int], float, Sound | None], None]


def writer() -> Writer:
    """What writes films here: file, frames, (width, height), frames per second, sound.

    Raises:
        InputError: ``extra-missing``: nothing does.
    """
    try:
        import av  # noqa: F401
    except ImportError:
        if shutil.which("ffmpeg"):
            return _with_program
        raise InputError(
            "extra-missing",
            "nothing that writes films is installed",
            place="extra 'video'",
            action="Run `pip install 'animeme[video]'`, or install ffmpeg.",
        ) from None
    return _with_pyav


def _with_pyav(
    path: Path,
    frames: Iterable[Pixels],
    size: tuple[int, int],
    rate_hz: float,
    sound: Sound | None,
) -> None:
    import av

    options = {"fflags": "+bitexact", "movflags": "+faststart"}
    try:
        with av.open(str(path), "w", format="mp4", options=options) as film:
            video = film.add_stream("libx264", rate=_fraction(rate_hz), options=dict(_VIDEO))
            video.width, video.height, video.pix_fmt = *size, "yuv420p"
            video.codec_context.thread_count = 1
            video.codec_context.flags |= av.codec.context.Flags.bitexact
            audio = None
            if sound is not None:
                sound = sound.known()
                layout = "mono" if sound.samples.shape[1] == 1 else "stereo"
                audio = film.add_stream("aac", rate=sound.rate_hz, layout=layout)
                audio.bit_rate = _AUDIO_BIT_RATE
                audio.codec_context.flags |= av.codec.context.Flags.bitexact
            for number, pixels in enumerate(frames):
                frame = av.VideoFrame.from_ndarray(np.ascontiguousarray(pixels), format="rgb24")
                # Here and not by the stream, whose own conversion differs from time to time.
                frame = frame.reformat(format="yuv420p")
                frame.pts, frame.time_base = number, 1 / _fraction(rate_hz)
                film.mux(video.encode(frame))
            film.mux(video.encode(None))
            if audio is not None and sound is not None:
                _put_sound(film, audio, sound)
    except av.FFmpegError as error:
        raise OSError(getattr(error, "errno", 0), error.strerror or str(error)) from error


def _put_sound(film: Any, stream: Any, sound: Sound) -> None:
    import av

    layout = "mono" if sound.samples.shape[1] == 1 else "stereo"
    block = stream.codec_context.frame_size or 1024
    for start in range(0, len(sound.samples), block):
        piece = np.ascontiguousarray(sound.samples[start : start + block].T, np.float32)
        frame = av.AudioFrame.from_ndarray(piece, format="fltp", layout=layout)
        frame.sample_rate, frame.pts = sound.rate_hz, start
        frame.time_base = Fraction(1, sound.rate_hz)
        film.mux(stream.encode(frame))
    film.mux(stream.encode(None))


def _with_program(
    path: Path,
    frames: Iterable[Pixels],
    size: tuple[int, int],
    rate_hz: float,
    sound: Sound | None,
) -> None:
    command = [
        "ffmpeg", "-nostdin", "-v", "error", "-y", "-f", "rawvideo", "-pix_fmt", "rgb24",
        "-s", f"{size[0]}x{size[1]}", "-r", str(_fraction(rate_hz)), "-i", "pipe:0",
    ]  # fmt: skip
    with tempfile.TemporaryDirectory() as folder:
        if sound is not None:
            wave, sound = Path(folder) / "sound.wav", sound.known()
            soundfile.write(wave, sound.samples, sound.rate_hz, subtype="PCM_16")
            command += ["-i", str(wave), "-c:a", "aac", "-b:a", str(_AUDIO_BIT_RATE)]
        for name, value in _VIDEO.items():
            command += [f"-{name}", value]
        command += [
            "-c:v", "libx264", "-pix_fmt", "yuv420p", "-map_metadata", "-1", "-fflags", "+bitexact",
            "-flags", "+bitexact", "-movflags", "+faststart", "-f", "mp4", f"file:{path}",
        ]  # fmt: skip
        with (Path(folder) / "said").open("w+b") as said:
            program = subprocess.Popen(
                command, stdin=subprocess.PIPE, stdout=subprocess.DEVNULL, stderr=said
            )
            assert program.stdin is not None
            try:
                for pixels in frames:
                    program.stdin.write(np.ascontiguousarray(pixels).tobytes())
                program.stdin.close()
            except BrokenPipeError:
                pass  # its own words follow
            except BaseException:
                program.kill()
                raise
            finally:
                code = program.wait()
            if code:
                said.seek(0)
                words = said.read().decode("utf-8", "replace").strip().splitlines()
                raise OSError(0, f"ffmpeg: {words[-1] if words else f'exit code {code}'}")


def _fraction(rate_hz: float) -> Fraction:
    """A rate as films write it: 29.97 is 30000/1001."""
    for base in (24, 30, 48, 60, 120):
        if abs(rate_hz - base * 1000 / 1001) < 5e-3:
            return Fraction(base * 1000, 1001)
    return Fraction(rate_hz).limit_denominator(1000)
