"""Phones to the segments that have dominance functions."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass

from animeme.phones import PhoneTrack


@dataclass(frozen=True)
class Segment:
    """A stretch of time with one target per control.

    Attributes:
        row: index of its class in the model's tables.
        start_s, end_s: its borders, seconds.
        peak_start_s, peak_end_s: where its dominance is largest (equal, or a plateau).
        contact: its contact targets must be reached over the whole segment.
    """

    row: int
    start_s: float
    end_s: float
    peak_start_s: float
    peak_end_s: float
    contact: bool = False


def split_symbol(symbol: str, known: Mapping[str, int]) -> tuple[str, ...]:
    """`symbol` if it is known, else its known pieces, longest first (``aɪ`` → ``a``, ``ɪ``).

    Pieces that nothing is known about are dropped; a symbol without any known piece gives ().
    """
    if symbol in known:
        return (symbol,)
    pieces: list[str] = []
    rest = symbol
    while rest:
        length = next((n for n in range(len(rest), 0, -1) if rest[:n] in known), 0)
        if length:
            pieces.append(rest[:length])
        rest = rest[length or 1 :]
    return tuple(pieces)


def segments(
    track: PhoneTrack,
    rows: Mapping[str, int],
    releases: Mapping[int, int],
    contacts: frozenset[int],
    start_peaks: frozenset[int],
    *,
    plateau_s: float,
    closure_share: float,
) -> list[Segment]:
    """The segments of a track, contiguous from its start to its end.

    Args:
        track: the phones.
        rows: plain IPA symbol → class index.
        releases: class of a stop → class of its release (2002 paper, section 3.2).
        contacts: classes whose contact must be reached.
        start_peaks: classes whose dominance peaks at their start.
        plateau_s: segments longer than this hold their target; half of it is left at either end.
        closure_share: part of a stop that is closure.
    """
    found: list[Segment] = []
    for row, start_s, end_s in _parts(track, rows, releases, closure_share):
        middle_s = (start_s + end_s) / 2
        hold_s = max(0.0, (end_s - start_s) - plateau_s) / 2
        peaks = (start_s, start_s) if row in start_peaks else (middle_s - hold_s, middle_s + hold_s)
        contact = row in contacts
        found.append(Segment(row, start_s, end_s, *peaks, contact=contact))
    return found


def _parts(
    track: PhoneTrack, rows: Mapping[str, int], releases: Mapping[int, int], closure_share: float
) -> Iterator[tuple[int, float, float]]:
    """Class and borders of each segment: diphthongs and affricates in equal parts, stops in two."""
    for symbol, phone in zip(track.ipa(), track.phones, strict=True):
        pieces = split_symbol(symbol, rows) or ("ə",)
        step_s = phone.duration_s / len(pieces)
        for index, piece in enumerate(pieces):
            start_s = phone.start_s + index * step_s
            last = index == len(pieces) - 1
            end_s = phone.end_s if last else phone.start_s + (index + 1) * step_s
            row = rows[piece]
            if row in releases:
                release_s = start_s + closure_share * (end_s - start_s)
                yield row, start_s, release_s
                yield releases[row], release_s, end_s
            else:
                yield row, start_s, end_s
