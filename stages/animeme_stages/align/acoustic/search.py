"""Exact search: the best path through a transcript, the best without it, and what they compete for.

Viterbi 1967 over a left-to-right network, without beams: every frame's score of every state is
looked at, so that a right line is never lost, and a wrong one shows in its scores.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from animeme_stages.align.acoustic.model import SILENCE_PHONE, STATES, AcousticModel
from animeme_stages.align.acoustic.network import Network

Floats = NDArray[np.float32]
Indices = NDArray[np.int64]
Streams = tuple[Floats, Floats, Floats]

NEVER = np.float32(-1e30)
# A new phone of the free path costs this many nats: without a price it changes every few frames.
_NEW_PHONE = np.float32(-6.0)


@dataclass(frozen=True, eq=False)
class Scores:
    """Log likelihoods of T frames.

    Attributes:
        states: (T, S) in each state of a network.
        plain: (T, P × 3) in each state of each phone without context.
    """

    states: Floats
    plain: Floats


@dataclass(frozen=True, eq=False)
class Search:
    """All that a search over T frames found; S states of the network.

    Attributes:
        before: (T, S + 1) score of the best path from the start that is in a state at a frame; the
            last column is nowhere.
        after: (T, S + 1) score of the best path from a frame in a state to the end.
        path: (T,) state of each frame on the best path; empty if there is none.
        best: that path's score.
        free: (T,) score of each frame on the best path over any phones.
    """

    before: Floats
    after: Floats
    path: Indices
    best: float
    free: Floats


def score(model: AcousticModel, streams: Streams, net: Network, quiet: NDArray[np.bool_]) -> Scores:
    """Log likelihoods of all frames.

    Args:
        model: gives Gaussians and mixtures.
        streams: T frames of cepstra and their differences.
        net: the transcript.
        quiet: (T,) frames without sound. There the free path may not do better than silence does:
            faint noise resembles many phones more than it resembles the model's silence.
    """
    senones, where = np.unique(net.senones, return_inverse=True)
    plain = model.sequences[model.plain].reshape(-1)
    both = _senone_scores(model, streams, np.concatenate([senones, plain]))
    free = both[:, len(senones) :].copy()
    first = STATES * model.index[SILENCE_PHONE]
    silence = free[quiet, first : first + STATES].max(axis=1, initial=NEVER, keepdims=True)
    free[quiet] = np.minimum(free[quiet], silence)
    return Scores(both[:, where], free)


def _senone_scores(model: AcousticModel, streams: Streams, senones: Indices) -> Floats:
    """Log likelihood of each frame in each senone, (T, len(senones))."""
    used = np.unique(model.codebooks[senones])
    members = [np.flatnonzero(model.codebooks[senones] == codebook) for codebook in used]
    result = np.zeros((len(streams[0]), len(senones)), np.float32)
    for stream, projection, constant, mixture in zip(
        streams, model.projections, model.constants, model.mixtures, strict=True
    ):
        frame = np.concatenate([stream, stream**2], axis=1)
        for codebook, columns in zip(used, members, strict=True):
            density = frame @ projection[codebook].T
            density += constant[codebook]
            largest = density.max(axis=1, keepdims=True)
            density -= largest
            np.exp(density, out=density)
            result[:, columns] += np.log(density @ mixture[senones[columns]].T) + largest
    return result


def search(model: AcousticModel, net: Network, scores: Scores, *, anywhere: bool = False) -> Search:
    """The best paths through T ≥ 1 frames.

    Three searches run side by side in the same arrays, for a step of each costs more to start than
    to do: forwards through the network, backwards through it, and freely over all phones.

    Args:
        model: gives transitions.
        net: the transcript.
        scores: of all frames.
        anywhere: the path may end at any word of the transcript, not only after its last.
    """
    frames, size = scores.states.shape
    value, moved, which, came = _run(_Table(model, net), scores)
    before = np.full((frames, size + 1), NEVER, np.float32)
    before[:, :-1] = value[:, :size]
    after = np.full((frames, size + 1), NEVER, np.float32)
    after[:, :-1] = value[::-1, size : 2 * size][:, ::-1]
    ends = np.arange(size) if anywhere else net.ends
    last = int(ends[np.argmax(before[-1, ends])])
    best = float(before[-1, last])
    path = np.empty(0, np.int64)
    if best > NEVER / 2:
        path = trace(net, moved[:, :size], which, last)
    free = _free_path(value[:, 2 * size :], moved[:, 2 * size :], came, scores.plain)
    return Search(before, after, path, best, free)


class _Table:
    """The transitions of all three searches: forwards, backwards in reverse order, freely."""

    def __init__(self, model: AcousticModel, net: Network) -> None:
        phones = np.array([unit.phone for unit in net.units])
        stay, leave = model.stay[phones].reshape(-1), model.leave[phones].reshape(-1)
        size = len(stay)
        plain_stay, plain_leave = model.stay.reshape(-1), model.leave.reshape(-1)
        self.size = size
        self.total = 2 * size + len(plain_stay)
        # Two more places: nowhere, and the best end of the free path.
        self.nowhere, self.anywhere = self.total, self.total + 1
        self.stay = np.concatenate([stay, stay[::-1], plain_stay])
        # Forwards the price of leaving is paid on leaving, backwards on arriving.
        none = np.zeros_like(leave)
        self.leave = np.concatenate([leave, none, plain_leave])
        self.arrive = np.concatenate([none, leave[::-1], np.zeros_like(plain_leave)])
        mirrored = 2 * size - 1  # where a state's mirror image is, less the state
        plain_first = np.arange(2 * size, self.total, STATES)
        self.entries = np.concatenate(
            [net.entries, mirrored - net.exits, plain_first, [0, size, *_others(net, mirrored)]]
        )
        self.forward_entries = len(net.entries)
        width = max(net.sources.shape[1], net.targets.shape[1], 1)
        sources = np.full((len(self.entries), width), self.nowhere)
        rows = len(net.entries)
        sources[:rows, : net.sources.shape[1]] = np.where(
            net.sources == size, self.nowhere, net.sources
        )
        sources[rows : rows + len(net.exits), : net.targets.shape[1]] = np.where(
            net.targets == size, self.nowhere, mirrored - net.targets
        )
        rows += len(net.exits)
        sources[rows : rows + len(plain_first), 0] = self.anywhere
        self.sources = sources
        self.plain_ends = plain_first + STATES - 1
        plain_starts = plain_first
        self.starts = np.concatenate([net.starts, mirrored - net.ends, plain_starts])


def _others(net: Network, mirrored: int) -> list[int]:
    """Last states of units that nothing follows, mirrored: nothing leads there backwards."""
    followed = set(net.exits.tolist())
    final = {int(state) for state in net.ends}
    return [mirrored - state for state in sorted(final - followed)]


def _run(
    table: _Table, scores: Scores
) -> tuple[Floats, NDArray[np.bool_], NDArray[np.uint16], NDArray[np.uint8]]:
    """Values of all states at all steps, and the choices that led there."""
    frames = len(scores.states)
    given = np.concatenate([scores.states, scores.states[::-1, ::-1], scores.plain], axis=1)
    value = np.empty((frames, table.total), np.float32)
    moved = np.zeros((frames, table.total), bool)
    which = np.zeros((frames, table.forward_entries), np.uint16)
    came = np.zeros(frames, np.uint8)
    value[0] = NEVER
    value[0, table.starts] = given[0, table.starts]
    left = np.full(table.total + 2, NEVER, np.float32)
    onward = np.empty(table.total, np.float32)
    stayed = np.empty(table.total, np.float32)
    rows = np.arange(len(table.entries))
    inner = left[: table.total]
    for t in range(1, frames):
        np.add(value[t - 1], table.leave, out=inner)
        came[t] = inner[table.plain_ends].argmax()
        left[table.anywhere] = inner[table.plain_ends[came[t]]] + _NEW_PHONE
        onward[1:] = inner[:-1]
        arriving = left[table.sources]
        choice = arriving.argmax(axis=1)
        onward[table.entries] = arriving[rows, choice]
        which[t] = choice[: table.forward_entries]
        onward += table.arrive
        np.add(value[t - 1], table.stay, out=stayed)
        np.greater(onward, stayed, out=moved[t])
        np.maximum(onward, stayed, out=stayed)
        np.add(stayed, given[t], out=value[t])
    return value, moved, which, came


def trace(net: Network, moved: NDArray[np.bool_], which: NDArray[np.uint16], state: int) -> Indices:
    """The path that ends in `state` at the last frame, (T,)."""
    row_of = {int(entry): row for row, entry in enumerate(net.entries)}
    path = np.empty(len(moved), np.int64)
    for t in range(len(moved) - 1, -1, -1):
        path[t] = state
        if moved[t, state]:
            row = row_of.get(state)
            state = state - 1 if row is None else int(net.sources[row, which[t, row]])
    return path


def _free_path(
    value: Floats, moved: NDArray[np.bool_], came: NDArray[np.uint8], plain: Floats
) -> Floats:
    """Score of each frame on the free path, (T,)."""
    frames = len(value)
    state = STATES * int(value[-1, STATES - 1 :: STATES].argmax()) + STATES - 1
    states = np.empty(frames, np.int64)
    for t in range(frames - 1, -1, -1):
        states[t] = state
        if moved[t, state]:
            first = state % STATES == 0
            state = STATES * int(came[t]) + STATES - 1 if first else state - 1
    found: Floats = plain[np.arange(frames), states]
    return found
