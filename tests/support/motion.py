"""Speech with made-up motion: every phone has a target, and lips that meet do meet."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import soundfile

from animeme.dataset import CapturedLine, Dataset
from animeme.phones import SILENCE, Phone, PhoneTrack, contiguous
from animeme_stages.align.interchange import write_timings

CONTROLS = ("lip_gap", "lip_width", "jaw_drop")
TARGETS = {
    SILENCE: (0.0, 0.0, 0.0),
    "AA": (0.24, 0.0, 0.2),
    "IY": (0.1, 0.05, 0.05),
    "UW": (0.06, -0.09, 0.06),
    "B": (0.0, -0.02, 0.03),
    "M": (0.0, 0.0, 0.04),
    "S": (0.08, 0.02, 0.02),
    "T": (0.09, 0.0, 0.05),
    "F": (0.05, 0.0, 0.04),
    "L": (0.12, 0.0, 0.1),
}
# These take on half of what follows: coarticulation.
ANTICIPATING = ("S", "T", "L")
RATE_HZ = 50.0


def random_track(seed: int, phones: int = 14) -> PhoneTrack:
    """A track between two pauses, different for every seed."""
    rng = np.random.default_rng(seed)
    spoken = [str(s) for s in rng.choice([s for s in TARGETS if s != SILENCE], phones)]
    lengths = [0.3, *rng.uniform(0.04, 0.16, phones).round(3).tolist(), 0.3]
    ends = np.cumsum(lengths).round(6).tolist()
    starts = [0.0, *ends[:-1]]
    named = zip([SILENCE, *spoken, SILENCE], starts, ends, strict=True)
    return PhoneTrack("en", "arpabet", contiguous([Phone(*entry) for entry in named], ends[-1]))


def motion(track: PhoneTrack, times_s: np.ndarray, seed: int = 0) -> np.ndarray:
    """Targets blended over about 40 ms, with a little noise, shape (F, N)."""
    values = np.zeros((len(times_s), len(CONTROLS)))
    total = np.zeros(len(times_s))
    for phone, following in zip(track.phones, (*track.phones[1:], track.phones[-1]), strict=True):
        target = np.array(TARGETS[phone.symbol])
        if phone.symbol in ANTICIPATING:
            target = 0.5 * (target + TARGETS[following.symbol])
        outside = np.maximum(np.maximum(phone.start_s - times_s, times_s - phone.end_s), 0.0)
        weight = np.exp(-((outside / 0.02) ** 2))
        values += weight[:, None] * target
        total += weight
    noise = np.random.default_rng(seed + 1).normal(0, 0.002, values.shape)
    return values / total[:, None] + noise


def captured_line(seed: int, phones: int = 14) -> CapturedLine:
    """One line of `captured`."""
    track = random_track(seed, phones)
    times_s = np.arange(0, track.duration_s, 1 / RATE_HZ)
    return CapturedLine(f"line{seed:03}", track, times_s, motion(track, times_s, seed))


def captured(lines: int = 12, first: int = 0) -> Dataset:
    """Some lines with motion."""
    return Dataset(CONTROLS, tuple(captured_line(seed) for seed in range(first, first + lines)))


def write_line(folder: Path, line: CapturedLine, header: str = "time_s") -> None:
    """The line as files: noise for a voice, a TextGrid for its phones, its motion."""
    rng = np.random.default_rng(0)
    samples = rng.normal(0, 0.1, round(line.track.duration_s * 16000))
    soundfile.write(folder / f"{line.id}.wav", samples, 16000, subtype="PCM_16")
    (folder / f"{line.id}.txt").write_text("what is said", encoding="utf-8")
    write_timings(line.track, folder / f"{line.id}.TextGrid", "textgrid")
    write_motion(folder / f"{line.id}.csv", line, header)


def write_motion(path: Path, line: CapturedLine, header: str = "time_s") -> None:
    """The line's motion as CSV, a gap as an empty cell."""
    rows = [",".join([header, *CONTROLS])]
    for time_s, values in zip(line.times_s, line.values, strict=True):
        cells = ["" if np.isnan(value) else f"{value:.6f}" for value in values]
        rows.append(",".join([f"{time_s:.4f}", *cells]))
    path.write_text("\n".join(rows) + "\n", encoding="utf-8")
