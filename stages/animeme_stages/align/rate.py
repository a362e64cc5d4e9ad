"""How fast a line is spoken, and whether anybody could."""

from __future__ import annotations

from collections.abc import Iterator

from animeme.findings import Finding, Severity
from animeme.phones import SILENCE, PhoneTrack

# Phones a second over the speech alone, pauses left out. 700 English lines of one reader and 297
# prompts in five languages that could be aligned have 7.2 to 17.0 (median 12.1), one that the
# aligner doubts as well has 18.3. Played twice as fast they have 15 to 33 (median 23).
# Slowness tells less: lines played at half speed have 7.0 and more, as what lasts too long for a
# phone is taken for a pause.
FASTEST_HZ = 19.0
SLOWEST_HZ = 5.0
# A shout or a sigh may last; a rate needs a phrase.
FEWEST_PHONES = 10


def speaking_rate(track: PhoneTrack) -> float:
    """Phones per second of speech, pauses left out; 0 where there is none."""
    spoken = [phone.duration_s for phone in track.phones if phone.symbol != SILENCE]
    return len(spoken) / sum(spoken) if spoken else 0.0


def rate_doubt(track: PhoneTrack) -> Iterator[Finding]:
    """A warning where the transcript would have to be spoken as nobody speaks.

    Args:
        track: the aligned phones.
    """
    rate_hz = speaking_rate(track)
    phones = sum(phone.symbol != SILENCE for phone in track.phones)
    if phones < FEWEST_PHONES or SLOWEST_HZ <= rate_hz <= FASTEST_HZ:
        return
    fast = rate_hz > FASTEST_HZ
    usual = f"people speak {SLOWEST_HZ:.0f} to {FASTEST_HZ:.0f}"
    yield Finding(
        Severity.WARNING,
        "align-rate",
        f"the transcript would be spoken at {rate_hz:.1f} sounds a second; {usual}, so "
        + (
            "words are not in the recording, or it plays too fast"
            if fast
            else "the recording holds more than the transcript, or plays too slowly"
        ),
        action="Listen to the line with its transcript in hand, and check the sampling rate that "
        "the file states.",
    )
