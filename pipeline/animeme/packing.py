"""What is said of a line, and handed out of it, as it lies in the store.

Whoever looks up results needs this, and none of what makes them (`animeme.steps`).
"""

from __future__ import annotations

import json
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Any

from animeme.dialogue import Line, voice_of
from animeme.findings import Finding, Severity
from animeme.store.entries import Entry

if TYPE_CHECKING:
    from animeme.tasks import RunContext, Target


def delivered_parts(entry: Entry) -> tuple[bytes, bytes]:
    """The alignment document in an entry of `Steps.align`, and what was spoken (b"" if nothing)."""
    size = entry.value["document"]
    return entry.payload[:size], entry.payload[size:]


def curve_head(payload: bytes) -> tuple[dict[str, Any], bytes]:
    """What curves in an entry are: number of ``keys``, ``names``, ``events``; then the numbers."""
    text, _, rest = payload.partition(b"\n")
    head: dict[str, Any] = json.loads(text)
    return head, rest


def places(line: Line, context: RunContext) -> dict[str, str]:
    """Path as findings say it → the token that stands for it in a store that others use too."""
    files = {
        "lexicon": context.lexicon,
        "voice": voice_of(context.voices, line),
        "audio": line.audio_file,
        "text": line.transcript_file,
        "timings": line.timings_file,
        "origin": line.origin or None,
        **{f"{car.kind} {car.character}": car.path for car in line.side_cars},
    }
    return {str(path): f"\0{name}\0" for name, path in files.items() if path is not None}


def model_places(target: Target) -> dict[str, str]:
    """As `places`, of the files that a target's model is made of."""
    return {str(path): f"\0model {number}\0" for number, path in enumerate(target.model_files)}


def packed(findings: Iterable[Finding], tokens: Mapping[str, str]) -> list[list[Any]]:
    """Findings as JSON, without line and character, and with tokens in place of paths."""
    longest = sorted(tokens, key=len, reverse=True)

    def general(text: str) -> str:
        for path in longest:
            text = text.replace(path, tokens[path])
        return text

    return [
        [
            int(finding.severity),
            finding.code,
            *map(general, (finding.message, finding.place, finding.action)),
            finding.ours,
        ]
        for finding in findings
    ]


def unpacked(
    rows: Iterable[Sequence[Any]],
    tokens: Mapping[str, str],
    *,
    line: str = "",
    character: str = "",
) -> tuple[Finding, ...]:
    """What `packed` packed, said of a line and a character."""

    def special(text: str) -> str:
        for path, token in tokens.items() if "\0" in text else ():
            text = text.replace(token, path)
        return text

    return tuple(
        Finding(
            Severity(severity),
            code,
            special(message),
            special(place),
            special(action),
            line,
            character,
            ours,
        )
        for severity, code, message, place, action, ours in rows
    )


def for_line(findings: Iterable[Finding], line: str) -> tuple[Finding, ...]:
    """The findings, said of a line."""
    return tuple(replace(finding, line=line) for finding in findings)
