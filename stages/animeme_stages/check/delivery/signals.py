"""What checks of delivered animations measure: the mouth's opening against its recording."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from animeme.contracts import Speech
from animeme.curves import CurveSet, Floats
from animeme.delivery import Performance, Skip
from animeme.phones import SILENCE, Phone, PhoneTrack
from animeme.rig import BoundRig
from animeme_stages.check.delivery.sound import RATE_HZ
from animeme_stages.check.opening import opening

BILABIALS = frozenset("pbm")
LABIODENTALS = frozenset("fvɱ")
# Vowels for which the jaw drops, by the first letter of their IPA: /æ ɑ a ɐ ɔ ɒ ʌ/ and diphthongs.
OPEN_VOWELS = tuple("æɑaɐɔɒʌ")


@dataclass(frozen=True)
class _Mouth:
    rig: BoundRig
    shapes: CurveSet


def opening_at(performance: Performance, times_s: Floats) -> Floats:
    """Opening of the mouth at times on the recording's axis, in units of ``jawOpen``.

    Raises:
        Skip: the rig has no known way to open its mouth.
    """
    if performance.rig is None:
        raise Skip("the rig is of no known family: --rig says what opens its mouth")
    opened = opening(_Mouth(performance.rig, performance.shapes))
    if opened is None:
        raise Skip("the rig has no shape that opens its mouth")
    return np.interp(times_s + performance.audio_start_s, performance.shapes.times_s, opened)


def speech_of(performance: Performance) -> Speech:
    """The recording.

    Raises:
        Skip: none is known.
        InputError: it cannot be read.
    """
    if performance.take is None:
        raise Skip("no recording is known: --dialogue names their folder")
    return performance.take.speech


def track_of(performance: Performance) -> PhoneTrack:
    """The phones of the recording.

    Raises:
        Skip: no recording is known.
        InputError: it cannot be read or aligned.
    """
    speech_of(performance)
    assert performance.take is not None
    return performance.take.track


def frames_s(speech: Speech) -> Floats:
    """Times of the frames of a recording, seconds, shape (F,)."""
    return np.arange(int(speech.duration_s * RATE_HZ) + 1) / RATE_HZ


def spoken(track: PhoneTrack) -> list[tuple[Phone, str]]:
    """Phones that are no silence, each with its IPA."""
    both = zip(track.phones, track.ipa(), strict=True)
    return [(phone, ipa) for phone, ipa in both if phone.symbol != SILENCE]


def during_phones(track: PhoneTrack, at_s: Floats) -> NDArray[np.bool_]:
    """Whether a phone is spoken at each time of the recording, shape (F,)."""
    said = np.zeros(len(at_s), dtype=np.bool_)
    for phone, _ in spoken(track):
        said |= (at_s >= phone.start_s) & (at_s < phone.end_s)
    return said


def is_open_vowel(ipa: str) -> bool:
    """Whether the jaw drops for a phone."""
    return ipa.startswith(OPEN_VOWELS)


def extreme(performance: Performance, phone: Phone, slack_s: float, *, least: bool) -> float:
    """Least or largest opening during a phone, `slack_s` early and late included."""
    at_s = np.linspace(phone.start_s - slack_s, phone.end_s + slack_s, 24)
    opened = opening_at(performance, at_s)
    return float(opened.min() if least else opened.max())


def range_of(performance: Performance, track: PhoneTrack) -> float:
    """How far the mouth opens in this line: 90th percentile over its speech."""
    phones = spoken(track)
    if not phones:
        raise Skip("nothing is said")
    at_s = np.concatenate([np.arange(p.start_s, p.end_s, 0.01) for p, _ in phones])
    return float(np.percentile(opening_at(performance, at_s), 90))


def stretches(mask: NDArray[np.bool_]) -> Iterator[tuple[int, int]]:
    """Start and end (exclusive) of each run of True."""
    edges = np.flatnonzero(np.diff(np.concatenate(([0], mask.astype(np.int8), [0]))))
    yield from zip(edges[::2].tolist(), edges[1::2].tolist(), strict=True)
