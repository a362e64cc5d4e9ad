"""Signs that a recording and its transcript differ, although they could be aligned."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from animeme.contracts import Anchor, Speech
from animeme.errors import InputError
from animeme.findings import Finding, Severity
from animeme.phones import SILENCE, Phone, PhoneTrack
from animeme_stages.align.acoustic.features import FRAME_S
from animeme_stages.align.confidence import Judgement

# A line whose words are in doubt from this share on is in doubt as a whole.
MOST_WORDS = 0.5
# A person wants to know where to listen, not everything.
MOST_PLACES = 3
# Above this score, with this share of its words in doubt, a line is refused.
HOPELESS, HOPELESS_WORDS = 4.0, 0.75
# A frame at either end: anchors are rounded to frames.
ANCHOR_ROUNDING_S = 2 * FRAME_S

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


def doubts(judgement: Judgement, track: PhoneTrack) -> Iterator[Finding]:
    """What speaks against an alignment: the places in doubt, the worst ones first.

    Args:
        judgement: of the line.
        track: its words, as many as were judged.
    """
    if judgement.line <= 0:
        return
    share = float((judgement.words > 0).mean())
    if share >= MOST_WORDS and len(track.words) > 1:
        yield doubt("align-text-differs", f"{share:.0%} of its words do not fit the sound")
        return
    # Where no place alone is in doubt, the worst one stands for the line.
    bar = min(0.0, float(max(judgement.words.max(), judgement.gaps.max())))
    places = [(score, 0, at) for at, score in enumerate(judgement.words) if score >= bar]
    places += [(score, 1, at) for at, score in enumerate(judgement.gaps) if score >= bar]
    for _, gap, at in sorted(places, key=lambda place: -place[0])[:MOST_PLACES]:
        yield _gap_doubt(track, at) if gap else _word_doubt(track, at)


def _word_doubt(track: PhoneTrack, at: int) -> Finding:
    word = track.words[at]
    when = f"{word.start_s:.2f}–{word.end_s:.2f} s"
    return doubt("align-word-differs", f"'{word.text}' does not fit the sound at {when}")


def _gap_doubt(track: PhoneTrack, at: int) -> Finding:
    words = track.words
    if at == 0:
        where = f"before the first word, '{words[0].text}' at {words[0].start_s:.2f} s"
    elif at == len(words):
        where = f"after the last word, '{words[-1].text}' at {words[-1].end_s:.2f} s"
    else:
        where = (
            f"between '{words[at - 1].text}' and '{words[at].text}', "
            f"around {(words[at - 1].end_s + words[at].start_s) / 2:.2f} s"
        )
    return doubt("align-untranscribed", f"more seems to be said {where}")


def require_likeness(judgement: Judgement, speech: Speech) -> None:
    """Refuse a line that has next to nothing in common with its transcript.

    Raises:
        InputError: so it is (``align-failed``).
    """
    share = float((judgement.words > 0).mean())
    if judgement.line > HOPELESS and share >= HOPELESS_WORDS:
        raise InputError(
            "align-failed",
            "the recording and the transcript do not fit together",
            place=str(speech.source),
            action="Listen to the line: a wrong take, a missing sentence, or the wrong file.",
        )


def anchor_doubts(track: PhoneTrack, anchors: Sequence[Anchor]) -> Iterator[Finding]:
    """A warning where words could not be spoken at the times that were given for them."""
    missed = [
        word
        for anchor in anchors
        for word in track.words
        if anchor.start <= word.source[0] < anchor.end
        and not (
            anchor.start_s - anchor.slack_s - ANCHOR_ROUNDING_S <= word.start_s
            and word.end_s <= anchor.end_s + anchor.slack_s + ANCHOR_ROUNDING_S
        )
    ]
    if missed:
        first = f"'{missed[0].text}' at {missed[0].start_s:.2f} s"
        reason = f"{len(missed)} words are not spoken at the times given, first {first}"
        yield doubt("align-anchor-missed", reason)


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
