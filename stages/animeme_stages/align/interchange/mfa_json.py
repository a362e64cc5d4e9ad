"""MFA's JSON (``--output_format json``) and praatio's, which it derives from."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

from animeme_stages.align.interchange.source import Source, listing, mapping, number, string
from animeme_stages.align.interchange.tiers import Tier, timings_of
from animeme_stages.align.interchange.timings import DamagedError, Span, Timings


def matches(source: Source) -> bool:
    """Whether this is a JSON object with tiers."""
    return isinstance(source.json, dict) and "tiers" in source.json


def read(source: Source) -> Timings:
    """The words and phones in its tiers.

    Raises:
        DamagedError: its structure is another.
    """
    root = mapping(source.json, "the top level")
    if abs(number(root.get("start", root.get("xmin", 0)), "start")) > 0:
        raise DamagedError("its start is not 0 s")
    end_s = number(root.get("end", root.get("xmax")), "end")
    return timings_of(tuple(_tiers(root["tiers"])), end_s, "mfa-json")


def _tiers(tiers: Any) -> Iterator[Tier]:
    if isinstance(tiers, dict):
        named = list(tiers.items())
    else:
        listed = [mapping(tier, "a tier") for tier in listing(tiers, "tiers")]
        named = [(string(tier.get("name"), "a tier's name"), tier) for tier in listed]
    for name, tier in named:
        members = mapping(tier, f"tier '{name[:40]}'")
        kind = string(members.get("type", members.get("class", "interval")), "a tier's type")
        points = kind in ("point", "TextTier", "PointTier")
        entries = listing(members.get("entries"), f"entries of tier '{name[:40]}'")
        yield Tier(name, tuple(_span(entry, points=points) for entry in entries), points)


def _span(entry: Any, *, points: bool) -> Span:
    parts = listing(entry, "an entry")
    if len(parts) != (2 if points else 3):
        raise DamagedError(f"an entry has {len(parts)} parts")
    *times, label = parts
    start_s = number(times[0], "an entry's start")
    return Span(string(label, "a label"), start_s, number(times[-1], "an entry's end"))
