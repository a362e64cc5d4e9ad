"""How far the mouth opens at phones of one kind: what several checks judge."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from typing import Any

from animeme.delivery import Complaint, LimitSpec, Performance, Skip, complain
from animeme_stages.check.delivery.signals import extreme, range_of, spoken, track_of

# Below this nothing can be said of parts of it.
_LEAST_RANGE = 0.02


def opening_limits(opening: LimitSpec) -> dict[str, LimitSpec]:
    """The limits that `openings` takes."""
    return {
        "opening": opening,
        "share": LimitSpec(0.5, "largest share of these phones that may fail"),
        "least_phones": LimitSpec(2.0, "fewest of these phones that are judged"),
        "slack_s": LimitSpec(0.03, "how early or late it may happen, seconds"),
    }


def openings(
    performance: Performance,
    limits: Mapping[str, Any],
    code: str,
    which: Callable[[str], bool],
    failure: str,
    *,
    wide: bool,
) -> Iterator[Complaint]:
    """Complain once, with the worst phone, if the mouth is too often not as open as it should be.

    Args:
        performance: the line.
        limits: as of `opening_limits`.
        code: of the complaint.
        which: whether a phone in IPA is judged.
        failure: what went wrong, after the number of phones.
        wide: the mouth should be open; shut otherwise.

    Raises:
        Skip: there are too few of them, or the mouth hardly moves.
    """
    track = track_of(performance)
    phones = [(phone, ipa) for phone, ipa in spoken(track) if which(ipa)]
    if len(phones) < limits["least_phones"]:
        raise Skip(f"{len(phones)} such phones are too few to tell")
    range_ = range_of(performance, track)
    if range_ < _LEAST_RANGE:
        raise Skip("the mouth hardly opens; see 'flat'")
    found = [
        (extreme(performance, phone, limits["slack_s"], least=not wide) / range_, phone, ipa)
        for phone, ipa in phones
    ]
    # How far each is on the wrong side of the limit.
    sign = -1 if wide else 1
    failed = [entry for entry in found if sign * (entry[0] - limits["opening"]) > 0]
    if len(failed) > limits["share"] * len(found):
        part, phone, ipa = max(failed, key=lambda entry: sign * entry[0])
        lead_s = performance.audio_start_s
        yield complain(
            code,
            f"{len(failed)} of {len(found)} {failure}, most of all /{ipa}/: "
            f"the mouth is {part:.0%} as open as in the line's loud parts",
            start_s=phone.start_s + lead_s,
            end_s=phone.end_s + lead_s,
        )
