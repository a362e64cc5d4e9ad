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

# Sound in a pause that is within this of the words' own level is speech, not breath or room…
LOUD_DB = 8.0
# …if there is enough of it: 99 % of 175 right lines of `grid-s1` have less than 0.6 s in a pause.
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
    pause, length_s = sound_in_pauses(track, speech)
    if pause is not None and length_s >= UNTRANSCRIBED_S:
        between = f"between {pause.start_s:.1f} and {pause.end_s:.1f} s"
        reason = f"{length_s:.1f} s of sound {between} are in no word"
        yield doubt("align-untranscribed", reason)


def mean_score(phones: list[Phone]) -> float:
    """Mean acoustic score per frame over `phones`, weighted by their length."""
    total_s = sum(phone.duration_s for phone in phones)
    return sum((phone.score or 0.0) * phone.duration_s for phone in phones) / total_s


def sound_in_pauses(track: PhoneTrack, speech: Speech) -> tuple[Phone | None, float]:
    """The pause with most sound as loud as speech in it, and how much that is in seconds."""
    hop = round(speech.rate_hz * FRAME_S)
    count = len(speech.samples) // hop
    frames = speech.samples[: count * hop].astype(np.float64).reshape(count, hop)
    level_db = 10 * np.log10(np.mean(frames**2, axis=1) + 1.0)
    spans = [
        (phone, slice(round(phone.start_s / FRAME_S), round(phone.end_s / FRAME_S)))
        for phone in track.phones
    ]
    spoken = [level_db[span] for phone, span in spans if phone.symbol != SILENCE]
    pauses = [(phone, level_db[span]) for phone, span in spans if phone.symbol == SILENCE]
    if not spoken or not pauses:
        return None, 0.0
    threshold = np.median(np.concatenate(spoken)) - LOUD_DB
    sound = [(float((levels > threshold).sum() * FRAME_S), phone) for phone, levels in pauses]
    length_s, pause = max(sound, key=lambda entry: entry[0])
    return pause, length_s
