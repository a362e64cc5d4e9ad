"""A recording and the words it should say: when each phone is heard, and what speaks against it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from animeme_stages.align.acoustic.features import (
    WINDOW,
    active,
    features,
    frame_count,
    levels_db,
)
from animeme_stages.align.acoustic.model import STATES, AcousticModel
from animeme_stages.align.acoustic.network import PAUSE, Network, Sounds, network
from animeme_stages.align.acoustic.pieces import Piece, Score, least_frames, pieces
from animeme_stages.align.acoustic.rivals import Rivals, rivals
from animeme_stages.align.acoustic.search import Scores, Streams, score, search

Window = tuple[float, float]
"""Frames within which a word has to be."""

# A frame this far below the recording's loud ones holds no speech sound.
_QUIET_DB = 22.0
_LOUD_PERCENTILE = 95
# Nats per frame by which a word outside its window loses: more than any sound could gain.
_OUTSIDE = np.float32(60.0)


@dataclass(frozen=True)
class HeardPhone:
    """One phone of the model, as heard.

    Attributes:
        phone: base phone.
        start, length: frames.
        gain: nats by which its frames fit better here than on the best path over any phones;
            mostly negative.
    """

    phone: int
    start: int
    length: int
    gain: float


@dataclass(frozen=True)
class HeardWord:
    """One word, as heard: which of its pronunciations, and its phones."""

    variant: int
    phones: tuple[HeardPhone, ...]


@dataclass(frozen=True, eq=False)
class Heard:
    """All words of a recording, and the rivals of each.

    Attributes:
        words: in order.
        rivals: over all words.
        pauses: (words + 1,) frames of pause before each word and after the last.
        senones: (T,) the model's state at each frame.
    """

    words: tuple[HeardWord, ...]
    rivals: Rivals
    pauses: NDArray[np.int64]
    senones: NDArray[np.int64]


@dataclass(frozen=True, eq=False)
class Frames:
    """A recording as the acoustic model hears it, T frames.

    Attributes:
        streams: cepstra and their differences.
        quiet: (T,) frames without sound.
    """

    streams: Streams
    quiet: NDArray[np.bool_]


class UnsayableError(ValueError):
    """The recording is shorter than the shortest way to say its words."""


def hear(
    model: AcousticModel,
    samples: NDArray[np.int16],
    words: Sequence[Sequence[Sounds]],
    windows: Sequence[Window | None] = (),
) -> Heard:
    """Find the words in a recording.

    Args:
        model: the acoustic model.
        samples: mono at its rate.
        words: per word, its pronunciations; at least one word.
        windows: per word, where it has to be; empty, or None for a word, where nothing is known.

    Raises:
        UnsayableError: there are fewer frames than the words have states.
    """
    _require_sayable(words, frame_count(len(samples)))
    frames = frames_of(samples)

    def scored(start: int, end: int, net: Network, first: int) -> Scores:
        cepstra, slopes, curvatures = frames.streams
        part = (cepstra[start:end], slopes[start:end], curvatures[start:end])
        found = score(model, part, net, frames.quiet[start:end])
        _require_windows(found, net, windows[first : first + net.words], start)
        return found

    parts = [
        _hear_piece(model, piece, words[piece.first : piece.last], scored)
        for piece in pieces(model, words, len(frames.quiet), scored)
    ]
    return _joined(parts)


def frames_of(samples: NDArray[np.int16]) -> Frames:
    """The frames of a recording, mono at the model's rate; at least one."""
    if len(samples) < WINDOW:
        samples = np.pad(samples, (0, WINDOW - len(samples)))
    level_db = levels_db(samples)
    counted = active(level_db)
    quiet = level_db < np.percentile(level_db[counted], _LOUD_PERCENTILE) - _QUIET_DB
    return Frames(features(samples, counted), quiet)


def _require_sayable(words: Sequence[Sequence[Sounds]], frames: int) -> None:
    """Before any work: what a search looks at grows with the words times the frames."""
    if least_frames(words)[-1] > frames:
        raise UnsayableError(f"{len(words)} words in {frames} frames")


def _require_windows(
    found: Scores, net: Network, windows: Sequence[Window | None], offset: int
) -> None:
    """Make words lose, in place, where they are outside their windows."""
    frame = np.arange(len(found.states)) + offset
    for word, window in enumerate(windows):
        if window is None:
            continue
        outside = (frame < window[0]) | (frame >= window[1])
        units = [number for number, unit in enumerate(net.units) if unit.word == word]
        states = np.arange(STATES * units[0], STATES * (units[-1] + 1))
        found.states[np.ix_(outside, states)] -= _OUTSIDE


def _hear_piece(
    model: AcousticModel, piece: Piece, words: Sequence[Sequence[Sounds]], scored: Score
) -> Heard:
    _require_sayable(words, piece.end - piece.start)
    net = network(model, words)
    scores = scored(piece.start, piece.end, net, piece.first)
    found = search(model, net, scores)
    gain = scores.states[np.arange(len(found.path)), found.path] - found.free
    units = found.path // STATES
    heard: list[list[HeardPhone]] = [[] for _ in words]
    variants = [0] * len(words)
    pauses = np.zeros(len(words) + 1, np.int64)
    said = 0
    edges = [0, *(np.flatnonzero(np.diff(units)) + 1).tolist(), len(units)]
    for start, end in pairwise(edges):
        unit = net.units[units[start]]
        if unit.word == PAUSE:
            pauses[said] += end - start
            continue
        said = unit.word + 1
        variants[unit.word] = unit.variant
        phone = HeardPhone(
            unit.phone, piece.start + start, end - start, float(gain[start:end].sum())
        )
        heard[unit.word].append(phone)
    said_words = zip(variants, heard, strict=True)
    return Heard(
        tuple(HeardWord(variant, tuple(phones)) for variant, phones in said_words),
        rivals(net, scores, found),
        pauses,
        net.senones[found.path],
    )


def _joined(parts: Sequence[Heard]) -> Heard:
    """The pieces as one; what is between two belongs to both."""
    between = parts[0].rivals.between
    pauses = parts[0].pauses
    for part in parts[1:]:
        shared = np.maximum(between[-1:], part.rivals.between[:1])
        between = np.concatenate([between[:-1], shared, part.rivals.between[1:]])
        pauses = np.concatenate([pauses[:-1], pauses[-1:] + part.pauses[:1], part.pauses[1:]])
    return Heard(
        tuple(word for part in parts for word in part.words),
        Rivals(
            np.concatenate([part.rivals.without for part in parts]),
            np.concatenate([part.rivals.instead for part in parts]),
            np.concatenate([part.rivals.instead_of_two for part in parts]),
            between,
        ),
        pauses,
        np.concatenate([part.senones for part in parts]),
    )
