"""An aligner without an acoustic model: espeak-ng's speech of the text, warped onto the recording.

Dynamic time warping (Sakoe & Chiba 1978, "Dynamic programming algorithm optimization for spoken
word recognition") of mel cepstra (Davis & Mermelstein 1980). espeak-ng says exactly when it speaks
each phone; the warp says when that is in the recording. It shares nothing with PocketSphinx but
the reading of the text, so it is a second opinion on it.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray
from scipy.fft import dct

import animeme
from animeme.contracts import Alignment, Anchor, Speech
from animeme.errors import InputError
from animeme.findings import Finding, Severity
from animeme.phones import Phone, PhoneTrack, Word, contiguous
from animeme_stages.align.language import languages

_Floats = NDArray[np.float64]

HOP_S = 0.010
WINDOW_S = 0.025
FILTERS = 26
CEPSTRA = 13
# Where speech ends; what is above differs more between rooms than between sounds.
HIGHEST_HZ = 7000.0
# Nobody speaks more characters in a second, or is this much slower or faster than espeak-ng.
MOST_CHARACTERS_PER_S = 60.0
MOST_STRETCH = 6.0
LONGEST_S = 120.0
SHORTEST_PHONE_S = 0.005
# Mean distance on the path over that of all pairs of loud frames; a higher one is for review.
UNLIKE = 0.82
# Share of the way from the noise floor to the loudest sounds, and the weight of slopes.
LOUD = 0.35
SLOPES = 0.7
FORBIDDEN = 1e6


class DtwAligner:
    """Warps espeak-ng's speech onto the recording. A lexicon has no say."""

    name: ClassVar[str] = "dtw"

    def languages(self) -> frozenset[str]:
        """Primary language subtags that it can align."""
        return frozenset(languages())

    def align(
        self,
        speech: Speech,
        text: str,
        *,
        language: str,
        lexicon: Path | None = None,
        anchors: Sequence[Anchor] = (),
        voice: Path | None = None,
    ) -> Alignment:
        """Align `text` with `speech`; see `animeme.contracts.Aligner`."""
        if voice is not None:
            raise InputError(
                "voice-unsupported",
                "this aligner uses no voices",
                place=str(voice),
                action="Leave it out.",
            )
        if speech.duration_s > LONGEST_S:
            raise _refused("audio-too-long", f"is longer than {LONGEST_S:.0f} s", speech)
        if len(text) > MOST_CHARACTERS_PER_S * max(speech.duration_s, 1.0):
            raise _refused("transcript-too-long", "is too short for so much text", speech)
        spoken = animeme.speak(text, language=language)
        reference = spoken.alignment.track
        stretch = speech.duration_s / reference.duration_s
        if not 1 / MOST_STRETCH < stretch < MOST_STRETCH:
            raise _refused("align-failed", "is far too short or long for the transcript", speech)
        theirs, they_speak = features(spoken.speech.samples, spoken.speech.rate_hz)
        ours, we_speak = features(speech.samples, speech.rate_hz)
        distances = _distances(theirs, ours)
        usual = float(distances[np.ix_(they_speak, we_speak)].mean())
        _forbid(distances, reference, anchors)
        path = warp(distances)
        passed = distances[path[:, 0], path[:, 1]]
        if passed.max() >= FORBIDDEN:
            raise _refused("align-failed", "cannot be brought to the given times", speech)
        spoken_there = they_speak[path[:, 0]] | we_speak[path[:, 1]]
        cost = float(passed[spoken_there].mean()) / usual
        track = _warped(reference, path, language, speech)
        findings = [_unlike(cost)] if cost > UNLIKE else []
        return Alignment(track, tuple(findings), score=float(np.clip(1.0 - cost, 0.0, 1.0)))


def features(samples: NDArray[np.int16], rate_hz: int) -> tuple[_Floats, NDArray[np.bool_]]:
    """Mel cepstra with their slopes, and which frames are loud.

    Returns:
        Shape (frames, 2 × CEPSTRA), of mean 0 and variance 1 over what is loud; shape (frames,).
    """
    hop, window = round(HOP_S * rate_hz), round(WINDOW_S * rate_hz)
    size = 1 << (window - 1).bit_length()
    signal = samples.astype(np.float64) / 32768.0
    signal = np.append(signal[:1], signal[1:] - 0.97 * signal[:-1])
    # The noise floor of a good recording: digital silence must not lie far below it.
    signal = signal + np.random.default_rng(0).normal(0.0, 1e-4, len(signal))
    padded = np.pad(signal, (window // 2, window))
    count = 1 + len(signal) // hop
    frames = np.lib.stride_tricks.sliding_window_view(padded, window)[::hop][:count]
    power = np.abs(np.fft.rfft(frames * np.hamming(window), size)) ** 2
    mel = np.log(power @ _filters(size, rate_hz).T + 1e-10)
    cepstra = dct(mel, axis=1, norm="ortho")[:, :CEPSTRA]
    level = mel.mean(1)
    floor, top = np.percentile(level, (5, 95))
    loud = level >= floor + LOUD * (top - floor)
    cepstra = (cepstra - cepstra[loud].mean(0)) / (cepstra[loud].std(0) + 1e-9)
    slopes = np.gradient(cepstra, 2.0, axis=0)
    slopes *= SLOPES / (slopes[loud].std(0) + 1e-9)
    return np.hstack([cepstra, slopes]), loud


def _filters(size: int, rate_hz: int) -> _Floats:
    """Triangles of equal width in mel; shape (FILTERS, size / 2 + 1)."""

    def mel(hz: float) -> float:
        return float(2595.0 * np.log10(1.0 + hz / 700.0))

    edges_mel = np.linspace(mel(100.0), mel(min(HIGHEST_HZ, rate_hz / 2)), FILTERS + 2)
    edges_hz = 700.0 * (10.0 ** (edges_mel / 2595.0) - 1.0)
    bins_hz = np.arange(size // 2 + 1) * rate_hz / size
    low, middle, high = edges_hz[:-2, None], edges_hz[1:-1, None], edges_hz[2:, None]
    rising, falling = (bins_hz - low) / (middle - low), (high - bins_hz) / (high - middle)
    return np.maximum(np.minimum(rising, falling), 0.0)


def _distances(left: _Floats, right: _Floats) -> _Floats:
    """Euclidean distance of each pair of frames; shape (left, right)."""
    squares = np.sum(left**2, 1)[:, None] + np.sum(right**2, 1) - 2.0 * left @ right.T
    return np.sqrt(np.maximum(squares, 0.0))


def _forbid(distances: _Floats, reference: PhoneTrack, anchors: Sequence[Anchor]) -> None:
    """Keep words whose time is known within it."""
    at_s = np.arange(distances.shape[1]) * HOP_S
    for anchor in anchors:
        early, late = anchor.start_s - anchor.slack_s, anchor.end_s + anchor.slack_s
        outside = (at_s < early) | (at_s > late)
        for word in reference.words:
            if anchor.start <= word.source[0] and word.source[1] <= anchor.end:
                rows = slice(round(word.start_s / HOP_S), round(word.end_s / HOP_S))
                distances[rows, outside] = FORBIDDEN


def warp(distances: _Floats) -> NDArray[np.int64]:
    """The cheapest path from corner to corner; a step to both sides costs as much as one of each.

    Returns:
        Pairs of frames, shape (steps, 2).
    """
    rows, columns = distances.shape
    total = np.full((rows + 1, columns + 1), np.inf)
    total[0, 0] = 0.0
    came = np.zeros((rows + 1, columns + 1), np.int8)
    for diagonal in range(2, rows + columns + 1):  # all cells of one depend on the two before
        i = np.arange(max(1, diagonal - columns), min(rows, diagonal - 1) + 1)
        j = diagonal - i
        own = distances[i - 1, j - 1]
        ways = np.stack(
            [total[i - 1, j - 1] + 2.0 * own, total[i - 1, j] + own, total[i, j - 1] + own]
        )
        came[i, j] = ways.argmin(0)
        total[i, j] = ways.min(0)
    i, j = rows, columns
    path = []
    while i > 0 and j > 0:
        path.append((i - 1, j - 1))
        step = came[i, j]
        i, j = (i - (step != 2), j - (step != 1))
    return np.array(path[::-1])


def _warped(
    reference: PhoneTrack, path: NDArray[np.int64], language: str, speech: Speech
) -> PhoneTrack:
    """The reference's phones and words at the recording's times."""
    edges_s = np.array([phone.start_s for phone in reference.phones] + [reference.duration_s])
    first = np.searchsorted(path[:, 0], np.round(edges_s / HOP_S))
    warped_s = path[np.minimum(first, len(path) - 1), 1] * HOP_S
    count = len(edges_s)
    least_s = np.arange(count) * SHORTEST_PHONE_S
    if least_s[-1] > speech.duration_s:
        raise _refused("transcript-too-long", "is too short for so many sounds", speech)
    warped_s = np.maximum.accumulate(warped_s - least_s) + least_s
    warped_s = np.minimum(warped_s, speech.duration_s - least_s[::-1])
    warped_s[0], warped_s[-1] = 0.0, speech.duration_s
    times = dict(zip(edges_s.tolist(), warped_s.tolist(), strict=True))
    phones = [Phone(p.symbol, times[p.start_s], times[p.end_s]) for p in reference.phones]
    words = [
        Word(word.text, times[word.start_s], times[word.end_s], word.source)
        for word in reference.words
    ]
    return PhoneTrack(
        language, reference.inventory, contiguous(phones, speech.duration_s), tuple(words)
    )


def _unlike(cost: float) -> Finding:
    return Finding(
        Severity.WARNING,
        "align-unlike",
        f"the recording is not much like the transcript's sounds ({cost:.2f} of a chance pairing)",
        action="Listen to the line.",
    )


def _refused(code: str, problem: str, speech: Speech) -> InputError:
    return InputError(
        code, f"the recording {problem}", place=str(speech.source), action="Check line and text."
    )
