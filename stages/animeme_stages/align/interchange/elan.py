"""ELAN (``.eaf``): tiers of annotations between time slots.

Annotations that refer to others have no times of their own and are left out. A document type
declaration is refused, so no entity can be expanded; ELAN writes none.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from itertools import groupby
from xml.etree.ElementTree import Element

from animeme_stages.align.interchange.source import Source, number
from animeme_stages.align.interchange.tiers import Tier, timings_of
from animeme_stages.align.interchange.timings import DamagedError, Span, Timings
from animeme_stages.ingest.safe_xml import XmlError, parse_xml


def matches(source: Source) -> bool:
    """Whether this is an ELAN document, going by its root element."""
    return source.text.lstrip().startswith("<") and "<ANNOTATION_DOCUMENT" in source.text[:4096]


def read(source: Source) -> Timings:
    """The words and phones in its tiers.

    Raises:
        DamagedError: it is not complete XML, declares entities, or an annotation has no time.
    """
    try:
        root = parse_xml(source.text)
    except XmlError as error:
        raise DamagedError(str(error)) from None
    if root.tag != "ANNOTATION_DOCUMENT":
        raise DamagedError(f"its root is <{root.tag[:40]}>, not <ANNOTATION_DOCUMENT>")
    header = root.find("HEADER")
    units = "milliseconds" if header is None else header.get("TIME_UNITS", "milliseconds")
    if units != "milliseconds":
        raise DamagedError(f"its times are in {units[:40]}, not in milliseconds")
    slots = _slots(root)
    tiers = tuple(
        Tier(tier.get("TIER_ID", ""), tuple(_spans(tier, slots))) for tier in root.iter("TIER")
    )
    return timings_of(tiers, None, "elan")


def _slots(root: Element) -> dict[str, float | None]:
    """Seconds of each time slot, None where ELAN left it to be spread evenly."""
    slots: dict[str, float | None] = {}
    for slot in root.iter("TIME_SLOT"):
        value = slot.get("TIME_VALUE")
        identity = slot.get("TIME_SLOT_ID", "")
        slots[identity] = None if value is None else number(value, f"slot {identity[:40]}") / 1000
    return slots


def _spans(tier: Element, slots: Mapping[str, float | None]) -> Iterator[Span]:
    labels: list[str] = []
    times: list[float | None] = []
    for annotation in tier.iter("ALIGNABLE_ANNOTATION"):
        value = annotation.find("ANNOTATION_VALUE")
        if value is None:
            name = tier.get("TIER_ID", "")[:40]
            raise DamagedError(f"an annotation of tier '{name}' has no value")
        labels.append(" ".join((value.text or "").split()))
        for end in ("TIME_SLOT_REF1", "TIME_SLOT_REF2"):
            reference = annotation.get(end, "")
            if reference not in slots:
                raise DamagedError(f"there is no time slot '{reference[:40]}'")
            times.append(slots[reference])
    spread = _spread(times)
    order = sorted(range(len(labels)), key=lambda index: spread[2 * index])
    for index in order:
        yield Span(labels[index], spread[2 * index], spread[2 * index + 1])


def _spread(times: Sequence[float | None]) -> list[float]:
    """Fill unaligned times evenly between their neighbours, as ELAN shows them.

    `times` are start and end of each annotation in turn: in a run of unaligned ones, an end and the
    start behind it are one slot, so that a run of 2n times is n points.
    """
    spread: list[float] = []
    for unknown, group in groupby(times, key=lambda time: time is None):
        run = list(group)
        if not unknown:
            spread += [time for time in run if time is not None]
            continue
        after = len(spread) + len(run)
        if not spread or after >= len(times) or len(run) % 2:
            raise DamagedError("an annotation without time does not lie between two that have one")
        before_s, after_s = spread[-1], times[after]
        assert after_s is not None  # a run ends where a known time stands
        steps = len(run) // 2 + 1
        for step in range(1, steps):
            middle_s = before_s + (after_s - before_s) * step / steps
            spread += [middle_s, middle_s]
    return spread
