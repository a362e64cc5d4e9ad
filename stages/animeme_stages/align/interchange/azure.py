"""Azure Speech: viseme and word events of synthesis, word lists of recognition.

Events come as the SDKs' objects dumped to JSON (a list, lines, or lists under any name), as
``[0001].word.json`` of batch synthesis, or as ``NBest[0].Words`` of recognition. Names of members
are told apart without case, underscores and the JavaScript SDK's ``priv``. Offsets are in ticks of
100 ns in the SDKs and in milliseconds in batch synthesis; which of them is told by what is possible
(see `_unit_s`).
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import pairwise
from statistics import median
from typing import Any

from animeme_stages.align.interchange.source import Source, number, parse_json, string
from animeme_stages.align.interchange.timings import DamagedError, Span, Timings, words_of

_TICK_S = 1e-7
_MILLISECOND_S = 1e-3
# The median word lasts 0.2 s or so: 200 ms or 2,000,000 ticks. The median viseme lasts 0.08 s:
# 80 ms or 800,000 ticks. The thresholds lie a hundredfold from either.
_LONGEST_MEDIAN_MS = 10_000
_VISEME_IDS = range(22)
_OFFSETS = ("audiooffset", "offset")


@dataclass(frozen=True)
class _Event:
    """A word or a viseme, in the file's unit; `duration` is None for visemes."""

    label: str
    offset: float
    duration: float | None


def matches(source: Source) -> bool:
    """Whether this is JSON, or lines of it, with audio offsets."""
    try:
        return any(True for _ in _entries(_root(source), 0))
    except DamagedError:
        return False


def read(source: Source) -> Timings:
    """The words and visemes among the events; punctuation and sentences are left out.

    Raises:
        DamagedError: an event lacks what it needs.
    """
    events = [event for entry in _entries(_root(source), 0) if (event := _event(entry))]
    words = [event for event in events if event.duration is not None]
    visemes = [event for event in events if event.duration is None]
    unit_s = _unit_s(words, visemes)
    spans = [
        Span(w.label, _seconds(w.offset, unit_s), _seconds(w.offset + w.duration, unit_s))
        for w in words
        if w.duration is not None
    ]
    moments = [_seconds(viseme.offset, unit_s) for viseme in visemes]
    points = [Span(v.label, time_s, time_s) for v, time_s in zip(visemes, moments, strict=True)]
    return Timings(words_of(spans), (), tuple(points), None, "azure")


def _root(source: Source) -> Any:
    """The whole text as JSON, or the list of its lines where each is JSON of its own."""
    first, _, rest = source.text.strip().partition("\n")
    if rest and first.startswith("{") and first.endswith("}"):
        return [parse_json(text) for _, text in source.lines()]
    return source.json


def _entries(value: Any, depth: int) -> Iterator[dict[str, Any]]:
    """All objects with an audio offset, in order; of alternatives (NBest) the first."""
    if depth > 6:
        raise DamagedError("its lists are nested too deep")
    if isinstance(value, list):
        for item in value:
            yield from _entries(item, depth + 1)
    elif isinstance(value, dict):
        members = {_plain(name): member for name, member in value.items()}
        if isinstance(members.get("nbest"), list):
            yield from _entries(members["nbest"][:1], depth + 1)
        elif any(name in members for name in _OFFSETS) and not isinstance(
            members.get("words"), list
        ):
            yield members
        else:
            for member in value.values():
                if isinstance(member, list | dict):
                    yield from _entries(member, depth + 1)


def _plain(name: str) -> str:
    return name.replace("_", "").lower().removeprefix("priv")


def _event(members: dict[str, Any]) -> _Event | None:
    offset = number(next(members[name] for name in _OFFSETS if name in members), "an offset")
    if "visemeid" in members:
        identity = number(members["visemeid"], "a viseme")
        if identity not in _VISEME_IDS:
            raise DamagedError(f"{identity} is not a viseme")
        return _Event(str(int(identity)), offset, None)
    kind = str(members.get("boundarytype", "Word")).rsplit(".", 1)[-1].removesuffix("Boundary")
    if kind.lower() != "word":
        return None
    label = string(members.get("text", members.get("word")), "a word")
    duration = number(members.get("duration"), f"the duration of '{label[:40]}'")
    return _Event(label, offset, duration)


def _unit_s(words: list[_Event], visemes: list[_Event]) -> float:
    """Seconds per unit: ticks, unless these would make words or visemes of a few microseconds."""
    lengths = [word.duration for word in words if word.duration is not None]
    if not lengths:
        lengths = [after.offset - before.offset for before, after in pairwise(visemes)]
    return _MILLISECOND_S if lengths and median(lengths) < _LONGEST_MEDIAN_MS else _TICK_S


def _seconds(count: float, unit_s: float) -> float:
    # Rounded to the tick, so that 1,300,000 ticks are 0.13 s and not 0.13 s less a bit.
    return round(count * unit_s, 7)
