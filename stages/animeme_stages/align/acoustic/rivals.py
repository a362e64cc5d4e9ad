"""What else the recording may say: paths that leave the transcript at one place, and their gain.

A right transcript is the best explanation of its recording at each of its words. Where a word was
not said, a path without it is better; where another was said, or one more, a path that goes over
any phones for a while. Each of these rivals is the best of its kind over all times, found exactly
from the best paths from the start and to the end (forward and backward Viterbi scores).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from animeme_stages.align.acoustic.model import STATES
from animeme_stages.align.acoustic.network import Network
from animeme_stages.align.acoustic.search import NEVER, Scores, Search

Doubles = NDArray[np.float64]

PRICES = (0.5, 1.0, 1.5, 2.0, 2.5, 3.0)
"""Nats per frame that a rival pays for going over any phones, which always fit better."""

# Frames that a rival goes over any phones at least: no word is shorter.
_SHORTEST = 6


@dataclass(frozen=True, eq=False)
class Rivals:
    """By how many nats rivals are better than the best path, W words; mostly negative.

    Attributes:
        without: (W,) leaving out the word.
        instead: (W, len(PRICES)) any phones in place of the word.
        instead_of_two: (W, len(PRICES)) … in place of the word and the next.
        between: (W + 1, len(PRICES)) … before each word, and after the last.
    """

    without: Doubles
    instead: Doubles
    instead_of_two: Doubles
    between: Doubles


def rivals(net: Network, scores: Scores, found: Search) -> Rivals:
    """The rivals of the best path that `found` has."""
    until, onwards = _borders(net, scores, found)
    count = net.words
    without = (until[:-1] + onwards[1:]).max(axis=1) - found.best
    instead = np.empty((count, len(PRICES)))
    instead_of_two = np.empty((count, len(PRICES)))
    between = np.empty((count + 1, len(PRICES)))
    for column, price in enumerate(PRICES):
        free = np.concatenate([[0.0], np.cumsum(found.free.astype(np.float64) - price)])
        left = np.maximum.accumulate(until - free, axis=1)[:, :-_SHORTEST]
        right = (onwards + free)[:, _SHORTEST:]
        between[:, column] = (left + right).max(axis=1) - found.best
        instead[:, column] = (left[:-1] + right[1:]).max(axis=1) - found.best
        two = np.minimum(np.arange(2, count + 2), count)
        instead_of_two[:, column] = (left[:-1] + right[two]).max(axis=1) - found.best
    return Rivals(without, instead, instead_of_two, between)


def _borders(net: Network, scores: Scores, found: Search) -> tuple[Doubles, Doubles]:
    """Best scores of what comes before each word, and from it on; both (W + 1, T + 1).

    Column t: the frames before frame t, and the frames from it on.
    """
    frames = len(scores.states)
    until = np.full((net.words + 1, frames + 1), float(NEVER))
    onwards = np.full((net.words + 1, frames + 1), float(NEVER))
    until[0, 0] = 0.0
    onwards[-1, -1] = 0.0
    for border in range(net.words + 1):
        pause = int(net.pauses[border])
        ends = [pause, *(net.lasts[border - 1] if border else ())]
        until[border, 1:] = found.before[:, [STATES * u + STATES - 1 for u in ends]].max(axis=1)
        # A pause belongs to what comes before, but for the last one.
        begins = net.firsts[border] if border < net.words else (pause,)
        onwards[border, :-1] = found.after[:, [STATES * unit for unit in begins]].max(axis=1)
    return until, onwards
