"""Phone tracks as arrays, and which phones are felt at which times.

Notation of the papers: phone j starts at s_j, lasts d_j; its local time is t_j = (t − s_j)/d_j.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from animeme.curves import Floats
from animeme.phones import PhoneTrack

Ints = NDArray[np.int64]

# Between the lines of a dataset on their common time axis: no dominance reaches that far.
_APART_S = 60.0


@dataclass(frozen=True, eq=False)
class Spoken:
    """The phones of one or several tracks on one time axis; J phones.

    Attributes:
        symbols: plain IPA of each.
        start_s: shape (J,).
        length_s: shape (J,).
        line: shape (J,), which track each belongs to.
        offset_s: shape (tracks,), where each track starts on the axis.
    """

    symbols: tuple[str, ...]
    start_s: Floats
    length_s: Floats
    line: Ints
    offset_s: Floats

    @property
    def end_s(self) -> Floats:
        """Shape (J,)."""
        return self.start_s + self.length_s

    def neighbour(self, offset: int) -> Ints:
        """Index of the phone `offset` places on in the same track, −1 where there is none; (J,)."""
        count = len(self.line)
        index = np.arange(count) + offset
        inside = (index >= 0) & (index < count)
        index = np.where(inside, index, 0)
        same = inside & (self.line[index] == self.line)
        return np.where(same, index, -1)


def spoken(tracks: Sequence[PhoneTrack]) -> Spoken:
    """The phones of `tracks`, one track after another, far enough apart not to be felt."""
    ends = np.cumsum([track.duration_s + _APART_S for track in tracks])
    offset_s = np.concatenate([[0.0], ends[:-1]])
    symbols = [symbol for track in tracks for symbol in track.ipa()]
    start = [p.start_s + o for track, o in zip(tracks, offset_s, strict=True) for p in track.phones]
    length = [phone.duration_s for track in tracks for phone in track.phones]
    line = np.repeat(np.arange(len(tracks)), [len(track.phones) for track in tracks])
    return Spoken(tuple(symbols), np.array(start), np.array(length), line, offset_s)


@dataclass(frozen=True, eq=False)
class Pairs:
    """Which phone is felt at which time; P pairs, sorted by time.

    Attributes:
        frames: number of times F.
        time: shape (P,), index of the time.
        phone: shape (P,), index of the phone.
        local: shape (P,), local time of the phone, 0 to 1 within it (see `pairs_of`).
        outside: shape (P,), how long before or after the phone, 0 within, in the unit of σ.
    """

    frames: int
    time: Ints
    phone: Ints
    local: Floats
    outside: Floats

    def sum_by_time(self, values: Floats) -> Floats:
        """Sum over the pairs of each time: (P,) → (F,), or (P, N) → (F, N)."""
        if values.ndim == 1:
            one: Floats = np.bincount(self.time, values, self.frames).astype(np.float64)
            return one
        columns = [np.bincount(self.time, column, self.frames) for column in values.T]
        return np.stack(columns, axis=1)


def pairs_of(
    phones: Spoken, times_s: Floats, *, reach: Floats, hold_s: float, seconds: bool
) -> Pairs:
    """Pair every time with the phones that are felt there.

    A phone longer than `hold_s` moves as it would in `hold_s`, its first half from its start, its
    second half towards its end, and holds its middle in between: a held vowel stays as it is, and
    a pause does not move the mouth long before anything is said. (Section VIII of the 2012 paper
    names this as its weakness.)

    Args:
        phones: on the axis of `times_s`.
        times_s: shape (F,), sorted.
        reach: shape (J,), how far outside it each phone is felt, in the unit of σ.
        hold_s: see above.
        seconds: the unit of σ: seconds, or the phone's own (held) length.
    """
    moving_s = np.minimum(phones.length_s, hold_s)
    reach_s = reach if seconds else reach * moving_s
    first = np.searchsorted(times_s, phones.start_s - reach_s, side="left")
    last = np.searchsorted(times_s, phones.end_s + reach_s, side="right")
    count = np.maximum(last - first, 0)
    phone = np.repeat(np.arange(len(count)), count)
    starts = np.concatenate([[0], np.cumsum(count)[:-1]])
    time = np.arange(len(phone)) - np.repeat(starts - first, count)
    order = np.argsort(time, kind="stable")
    phone, time = phone[order], time[order]
    since_s = times_s[time] - phones.start_s[phone]
    until_s = phones.end_s[phone] - times_s[time]
    half_s = moving_s[phone] / 2
    local_s = np.where(since_s < half_s, since_s, np.maximum(2 * half_s - until_s, half_s))
    outside_s = np.maximum(np.maximum(-since_s, -until_s), 0.0)
    local = local_s / moving_s[phone]
    outside = outside_s if seconds else outside_s / moving_s[phone]
    return Pairs(len(times_s), time, phone, local, outside)


def legendre(local: Floats, degree: int, beyond: float) -> Floats:
    """Legendre polynomials on [0, 1] at `local`, shape (P, degree + 1).

    They span the same polynomials as the papers' powers of t (eq. 3), and keep the normal equations
    well conditioned. Outside the phone they go on for `beyond` of its length and then stay, so that
    no high power of t outgrows its dominance.
    """
    u = 2.0 * np.clip(local, -beyond, 1.0 + beyond) - 1.0
    columns: list[Any] = [np.ones_like(u), u]
    for m in range(1, degree):
        columns.append(((2 * m + 1) * u * columns[m] - m * columns[m - 1]) / (m + 1))
    return np.stack(columns[: degree + 1], axis=1)
