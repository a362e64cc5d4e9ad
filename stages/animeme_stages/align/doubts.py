"""Signs that a recording and its transcript differ, although they could be aligned."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from animeme.contracts import Speech
from animeme.findings import Finding, Severity
from animeme.phones import SILENCE, Phone, PhoneTrack
from animeme_stages.align.language import Language

FRAME_S = 0.01
# Every phone model has three states of at least one frame each.
SHORTEST_PHONE_S = 3 * FRAME_S

# Sound between words that is within this of the words' own level is speech, not breath or room…
LOUD_DB = 10.0
# …if it lasts: of 700 right lines of `grid-s1`, one has a longer stretch.
UNTRANSCRIBED_S = 0.7


def doubt(code: str, reason: str) -> Finding:
    """A warning that marks a line for review."""
    return Finding(
        Severity.WARNING,
        code,
        f"the recording and the transcript may differ: {reason}",
        action="Listen to the line with its transcript in hand.",
    )


def doubts(track: PhoneTrack, speech: Speech, language: Language) -> Iterator[Finding]:
    """What speaks against an alignment; thresholds and their measurement: docs/alignment.md.

    Args:
        track: the aligned phones, with scores.
        speech: what they were aligned with.
        language: gives the thresholds.
    """
    spoken = [phone for phone in track.phones if phone.symbol != SILENCE]
    squeezed = sum(phone.duration_s < SHORTEST_PHONE_S + FRAME_S / 2 for phone in spoken)
    share = squeezed / len(spoken)
    if share > language.squeezed_share:
        yield doubt("align-squeezed", f"{share:.0%} of the sounds had to be squeezed in")
    score = mean_score(spoken)
    if score < language.score_floor:
        reason = f"the sounds fit badly (score {score:.0f}, usual above {language.score_floor:.0f})"
        yield doubt("align-poor-score", reason)
    start_s, length_s = longest_sound_between(track, speech)
    if length_s >= UNTRANSCRIBED_S:
        reason = f"{length_s:.1f} s of sound from {start_s:.1f} s on are in no word"
        yield doubt("align-untranscribed", reason)


def mean_score(phones: list[Phone]) -> float:
    """Mean acoustic score per frame over `phones`, weighted by their length."""
    total_s = sum(phone.duration_s for phone in phones)
    return sum((phone.score or 0.0) * phone.duration_s for phone in phones) / total_s


def longest_sound_between(track: PhoneTrack, speech: Speech) -> tuple[float, float]:
    """Start and length in seconds of the longest stretch as loud as speech outside of words."""
    hop = round(speech.rate_hz * FRAME_S)
    count = len(speech.samples) // hop
    frames = speech.samples[: count * hop].astype(np.float64).reshape(count, hop)
    level_db = 10 * np.log10(np.mean(frames**2, axis=1) + 1.0)
    inside = np.zeros(count, bool)
    for phone in track.phones:
        if phone.symbol != SILENCE:
            inside[round(phone.start_s / FRAME_S) : round(phone.end_s / FRAME_S)] = True
    if not inside.any():
        return 0.0, 0.0
    loud = ~inside & (level_db > np.median(level_db[inside]) - LOUD_DB)
    # Speech has gaps of its own; what counts is a majority over a tenth of a second.
    steady = np.convolve(loud, np.full(10, 0.1), "same") > 0.5
    edges = np.flatnonzero(np.diff(np.concatenate([[0], steady.astype(np.int8), [0]])))
    starts, ends = edges[::2], edges[1::2]
    if not len(starts):
        return 0.0, 0.0
    longest = int(np.argmax(ends - starts))
    return float(starts[longest] * FRAME_S), float((ends[longest] - starts[longest]) * FRAME_S)
