"""The golden timing files, and what is in them."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

from animeme_stages.align.interchange import Span, Timings

FOLDER = Path(__file__).parents[1] / "fixtures" / "timings"
_EXPECTED = json.loads((FOLDER / "expected.json").read_text(encoding="utf-8"))
NAMES: tuple[str, ...] = tuple(_EXPECTED["files"])

OPEN_ENDED = ("ctm", "htk", "polly", "webvtt", "srt", "rhubarb-tsv", "azure-lines")
"""Formats without a mark at the end: that whole lines are missing cannot be told."""


def expected(name: str) -> dict[str, Any]:
    """Words, phones, events, duration and source of a golden file."""
    entry = _EXPECTED["files"][name]
    return {tier: _spans(entry.get(tier, ())) for tier in ("words", "phones", "events")} | {
        "duration_s": entry.get("duration_s"),
        "source": entry["source"],
    }


def open_ended(name: str) -> bool:
    """Whether a golden file could lack whole lines without a trace."""
    return expected(name)["source"] in OPEN_ENDED or name.endswith((".jsonl", "polly-words.json"))


def same(timings: Timings, wanted: dict[str, Any], tolerance_s: float = 1e-9) -> bool:
    """Whether `timings` are as wanted, times within `tolerance_s`."""
    if (timings.duration_s, timings.source) != (wanted["duration_s"], wanted["source"]):
        return False
    return all(
        close(getattr(timings, tier), wanted[tier], tolerance_s)
        for tier in ("words", "phones", "events")
    )


def close(found: tuple[Span, ...], wanted: tuple[Span, ...], tolerance_s: float) -> bool:
    """Whether two tiers have the same labels, and times within `tolerance_s`."""
    return len(found) == len(wanted) and all(
        a.label == b.label
        and abs(a.start_s - b.start_s) <= tolerance_s
        and abs(a.end_s - b.end_s) <= tolerance_s
        for a, b in zip(found, wanted, strict=True)
    )


def _spans(rows: Any) -> tuple[Span, ...]:
    rows = _EXPECTED["lists"][rows] if isinstance(rows, str) else rows
    return tuple(Span(*row) for row in rows)
