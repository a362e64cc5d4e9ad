"""Which moments of a line show most: one per articulatory event, spread over the line."""

from __future__ import annotations

from dataclasses import dataclass

from animeme.phones import SILENCE, PhoneTrack
from animeme_stages.synthesize.articulation import class_of
from animeme_stages.synthesize.contacts import CLOSURE_SHARE

# How much of a phone can be seen, by its class; what is not named is hardly told from a pause.
# Jeffers & Barley, Speechreading (1971): lips that meet first, then lips that round or part.
_VISIBLE = {
    "bilabial": 1.0,
    "labiodental": 0.9,
    "glide-rounded": 0.8,
    "vowel-rounded-close": 0.8,
    "vowel-open": 0.8,
    "vowel-rounded-mid": 0.7,
    "postalveolar": 0.6,
    "dental": 0.6,
    "vowel-close": 0.55,
    "vowel-mid": 0.5,
    "rhotic": 0.4,
    "sibilant": 0.4,
    "vowel-central": 0.3,
}
_HARDLY = 0.15
# What has been shown once is worth this part the next time.
_AGAIN = 0.62


@dataclass(frozen=True)
class Moment:
    """A moment of a line.

    Attributes:
        time_s: of the recording.
        word: that is spoken, "" between words.
        symbol: of the phone, as the track spells it; "" without phones.
    """

    time_s: float
    word: str = ""
    symbol: str = ""


def moments_of(track: PhoneTrack | None, duration_s: float, count: int) -> tuple[Moment, ...]:
    """At most `count` moments in order.

    Args:
        track: the line's phones; without any the moments are evenly spaced.
        duration_s: of the line.
        count: how many are wanted, at least 1.
    """
    spoken = [] if track is None else _spoken(track)
    if track is None or not spoken:
        return tuple(moment_at(track, duration_s * (k + 0.5) / count) for k in range(max(count, 1)))
    chosen: list[int] = []
    shown: dict[str, int] = {}
    # One part of the phones after another; in each the one that shows most that is new.
    parts = min(count, len(spoken))
    for k in range(parts):
        part = range(k * len(spoken) // parts, (k + 1) * len(spoken) // parts)
        best = max(part, key=lambda i: (_worth(spoken[i].kind, shown, chosen, i, spoken), -i))
        chosen.append(best)
        shown[spoken[best].kind] = shown.get(spoken[best].kind, 0) + 1
    return tuple(moment_at(track, spoken[i].time_s) for i in chosen)


@dataclass(frozen=True)
class _Spoken:
    kind: str
    time_s: float


def _spoken(track: PhoneTrack) -> list[_Spoken]:
    found = []
    for phone, ipa in zip(track.phones, track.ipa(), strict=True):
        if phone.symbol == SILENCE:
            continue
        # What is behind the closure of /p b/ is their release.
        share = CLOSURE_SHARE / 2 if ipa in ("p", "b") else 0.5
        found.append(_Spoken(class_of(ipa), phone.start_s + share * phone.duration_s))
    return found


def _worth(
    kind: str, shown: dict[str, int], chosen: list[int], index: int, spoken: list[_Spoken]
) -> float:
    again = _AGAIN ** shown.get(kind, 0)
    if chosen and spoken[chosen[-1]].kind == kind:
        again *= _AGAIN
    return _VISIBLE.get(kind, _HARDLY) * again


def moment_at(track: PhoneTrack | None, time_s: float) -> Moment:
    """The word and the phone that are spoken at a time."""
    if track is None:
        return Moment(time_s)
    word = next((w.text for w in track.words if w.start_s <= time_s < w.end_s), "")
    phone = next((p.symbol for p in track.phones if p.start_s <= time_s < p.end_s), SILENCE)
    return Moment(time_s, word, phone)
