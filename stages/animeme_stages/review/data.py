"""What pages are told, as JSON."""

from __future__ import annotations

import base64
from collections.abc import Sequence
from itertools import accumulate
from typing import Any

import numpy as np
from numpy.typing import NDArray

from animeme.findings import Complaint, Finding, Severity
from animeme.phones import PhoneTrack
from animeme.reviewing import Detail, Performed, Reviewable, ReviewedLine, when_of
from animeme_stages.review.sound import PEAKS_HZ, Sound


def packed(values: NDArray[Any]) -> str:
    """An array's bytes, little-endian, as base64."""
    return base64.b64encode(values.astype(values.dtype.newbyteorder("<")).tobytes()).decode()


def index_of(
    shown: Reviewable, links: dict[tuple[str, str], str], title_of_other: str
) -> dict[str, Any]:
    """The list of all lines; one row is an array, for there may be many thousands."""
    codes: dict[str, int] = {}
    rows = [
        [
            line.key,
            line.character,
            line.language,
            line.status,
            round(line.audio_s, 2),
            None if line.score is None else round(line.score, 2),
            [codes.setdefault(finding.code, len(codes)) for finding in _doubts(line)],
            line.words,
            links.get((line.key, line.character)),
        ]
        for line in shown.lines
    ]
    return {
        "title": shown.title,
        "against": title_of_other,
        "codes": list(codes),
        "rows": rows,
        "findings": [_finding(finding) for finding in shown.findings],
    }


def _doubts(line: ReviewedLine) -> list[Finding]:
    return [finding for finding in line.findings if finding.severity >= Severity.WARNING]


def line_of(
    line: ReviewedLine,
    detail: Detail,
    *,
    sound: Sound | None,
    source: str | None,
    takes: Sequence[dict[str, Any]],
    frame_hz: float,
    remarks: Sequence[str],
) -> dict[str, Any]:
    """All that a line's page shows.

    Args:
        line, detail: the line.
        sound: its recording, None if there is none.
        source: where the page finds it.
        takes: as `take_of` gives them.
        frame_hz: what a step is one of.
        remarks: why something is not shown.
    """
    lead_s = detail.performed[0].audio_start_s if detail.performed else 0.0
    return {
        "key": line.key,
        "character": line.character,
        "language": line.language,
        "status": line.status,
        "text": detail.text,
        "duration_s": round(sound.duration_s if sound else line.audio_s, 6),
        "frame_hz": frame_hz,
        "audio": source,
        "peaks": {"rate_hz": PEAKS_HZ, "data": packed(sound.peaks)} if sound else None,
        **_track(detail.track, detail.text),
        "findings": [_finding(finding, lead_s) for finding in line.findings],
        "takes": list(takes),
        "remarks": list(remarks),
    }


def take_of(performed: Performed, *, side: str, title: str, asset: str | None) -> dict[str, Any]:
    """How one file plays a line: the weights that are stored in it.

    Args:
        performed: the file.
        side: "A", or "B" for what it is compared with.
        title: of the run it is from.
        asset: name of the viewing copy, None if there is none.
    """
    shapes = performed.shapes
    return {
        "side": side,
        "title": title,
        "file": performed.file,
        "asset": asset,
        "audio_start_s": performed.audio_start_s,
        "names": list(shapes.names),
        "times_s": packed(shapes.times_s.astype(np.float32)),
        "weights": packed(shapes.weights.astype(np.float32)),
    }


def _track(track: PhoneTrack | None, text: str) -> dict[str, Any]:
    if track is None:
        return {"words": [], "phones": [], "events": []}
    # JavaScript counts in UTF-16 units, Python in characters.
    units = [0, *accumulate(1 + (character > "\uffff") for character in text)]

    def place(at: int) -> int:
        return units[min(at, len(text))]

    return {
        "words": [
            [word.text, round(word.start_s, 4), round(word.end_s, 4), *map(place, word.source)]
            for word in track.words
        ],
        "phones": [
            [
                phone.symbol,
                ipa,
                round(phone.start_s, 4),
                round(phone.end_s, 4),
                None if phone.score is None else round(phone.score, 2),
            ]
            for phone, ipa in zip(track.phones, track.ipa(), strict=True)
        ],
        "events": [[event.tag, round(event.time_s, 4)] for event in track.events],
    }


def _finding(finding: Finding, lead_s: float = 0.0) -> dict[str, Any]:
    when = when_of(finding)
    if when is not None and isinstance(finding, Complaint):  # on the animation's own time axis
        when = (when[0] - lead_s, when[1] - lead_s)
    return {
        "severity": finding.severity.label,
        "code": finding.code,
        "message": finding.message,
        "action": finding.action,
        "place": finding.place,
        "line": finding.line,
        "when_s": None if when is None else list(when),
    }
