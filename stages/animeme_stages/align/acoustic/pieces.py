"""Long recordings, in pieces: the cost of a search grows with the square of a piece's length."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from animeme_stages.align.acoustic.model import STATES, AcousticModel
from animeme_stages.align.acoustic.network import PAUSE, Indices, Network, Sounds, network
from animeme_stages.align.acoustic.search import Scores, search

LONGEST = 2000
"""Frames of the longest piece."""

_WINDOW = 3000
# The end of a window is uncertain: words are only taken from what lies before its last part.
_MARGIN = 800
# A pause to cut in has this many frames; without one in the last half the cut is between words.
_PAUSE = 12
# A piece has this many frames at least, if there is anywhere to cut.
_LEAST = LONGEST // 4
# A window is offered this many times the words that its share of the recording has, and some more;
# twice as many if it reaches this share of them: a recording may be dense first and silent then…
_SURPLUS, _MORE, _REACHED = 1.6, 12, 0.8
# … but no more than can be said in this part of its frames: 25 sounds a second, which nobody says.
_FASTEST = 0.75

Score = Callable[[int, int, Network, int], Scores]
"""Scores of frames [start, end) in a network whose first word is the given one."""


@dataclass(frozen=True)
class Piece:
    """Frames [start, end) that say words [first, last)."""

    start: int
    end: int
    first: int
    last: int


def pieces(
    model: AcousticModel, words: Sequence[Sequence[Sounds]], frames: int, score: Score
) -> Iterator[Piece]:
    """Cut a recording in the middle of pauses, one window after the other.

    Args:
        model: the acoustic model.
        words: per word, its pronunciations.
        frames: length of the recording.
        score: scores any stretch of it.

    Yields:
        Pieces of about `LONGEST` frames that cover all of both. Some may have no words.
    """
    least = least_frames(words)
    start = first = 0
    while frames - start > LONGEST:
        end = min(start + _WINDOW, frames)
        if end == frames:
            offered = most = len(words)
            if least[-1] - least[first] > end - start:
                break
        else:
            latest = least[first] + _FASTEST * (end - start)
            most = int(np.searchsorted(least, latest, side="right")) - 1
            share = (end - start) / (frames - start)
            offered = min(most, first + round(share * (len(words) - first) * _SURPLUS) + _MORE)
        cut, said = LONGEST, 0
        while offered > first:
            net = network(model, words[first:offered])
            found = search(model, net, score(start, end, net, first), anywhere=end < frames)
            # Even where only most of them are reached, the last ones may stand for others.
            if offered == most or found.path[-1] < _REACHED * len(net.senones):
                cut, said = _cut(net, found.path, min(LONGEST, end - start - _MARGIN))
                break
            offered = min(most, 2 * offered - first)
        if start + cut == frames:
            break
        yield Piece(start, start + cut, first, first + said)
        start, first = start + cut, first + said
    yield Piece(start, frames, first, len(words))


def least_frames(words: Sequence[Sequence[Sounds]]) -> Indices:
    """Frames that it takes at least to say the words before each, and all of them: (words + 1,)."""
    shortest = [STATES * min(map(len, variants)) for variants in words]
    return np.concatenate([[0], np.cumsum(shortest, dtype=np.int64)])


def _cut(net: Network, path: Indices, latest: int) -> tuple[int, int]:
    """The frame to cut at and the number of words before it.

    The last pause up to the frame `latest`; without one the last border of words, and without that
    the first one after it.
    """
    unit = path // STATES
    word = np.array([u.word for u in net.units])[unit]
    edges = [0, *(np.flatnonzero(np.diff(unit)) + 1).tolist(), len(path)]
    pauses, borders, said = [], [], 0
    for start, end in pairwise(edges):
        if word[start] == PAUSE:
            at = min((start + end) // 2, latest)
            if end - start >= _PAUSE and at >= max(start + _PAUSE // 2, _LEAST):
                pauses.append((at, said))
        else:
            said = int(word[start]) + 1
            if end == len(path) or word[end] != word[start]:
                borders.append((end, said))
    inside = [border for border in borders if _LEAST <= border[0] <= latest]
    late = [border for border in borders if border[0] > latest]
    return (pauses or inside or late[:1] or [(len(path), said)])[-1]
