"""Whisper's and WhisperX's JSON: segments of text, with their words where these were timed.

WhisperX gives no time to words it cannot spell in its model's letters ("2014", "£5"), and Whisper
gives some no length. Such a word joins the one before it, which then lasts until the next one
starts; at the start of a segment it joins the one behind it. So every time is one that was
measured, and no text is lost.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import zip_longest
from typing import Any

from animeme_stages.align.interchange.source import Source, listing, mapping, number, string
from animeme_stages.align.interchange.timings import DamagedError, Span, Timings, words_of


def matches(source: Source) -> bool:
    """Whether this is a JSON object with segments or words."""
    if not isinstance(source.json, dict):
        return False
    return any(isinstance(source.json.get(key), list) for key in ("segments", "word_segments")) or (
        isinstance(source.json.get("words"), list) and "text" in source.json
    )


def is_timed(source: Source) -> bool:
    """Whether a content that matches has times; others' segments and words may have none."""
    lists = (source.json.get(key) for key in ("segments", "word_segments", "words"))
    entries = [entry for each in lists if isinstance(each, list) for entry in each]
    return any(isinstance(e, dict) and not e.keys().isdisjoint(("start", "words")) for e in entries)


def read(source: Source) -> Timings:
    """The words, or the text of the segments where no words were timed.

    Raises:
        DamagedError: its structure is another.
    """
    root = mapping(source.json, "the top level")
    duration = root.get("duration")
    duration_s = None if duration is None else number(duration, "duration")
    return Timings(words_of(_spans(root)), (), (), duration_s, "whisper")


def _spans(root: dict[str, Any]) -> Iterator[Span]:
    segments = [mapping(s, "a segment") for s in listing(root.get("segments", []), "segments")]
    if any("words" in segment for segment in segments):
        for segment in segments:
            start_s, end_s = _bounds(segment)
            words = listing(segment.get("words", []), "a segment's words")
            yield from _grouped(words, start_s, end_s) if words else iter([_whole(segment)])
        return
    for key in ("word_segments", "words"):
        if listing(root.get(key, []), key):
            yield from _grouped(root[key], None, None)
            return
    for segment in segments:
        yield _whole(segment)


def _whole(segment: dict[str, Any]) -> Span:
    return Span(string(segment.get("text"), "a segment's text"), *_bounds(segment))


def _bounds(entry: dict[str, Any]) -> tuple[float, float]:
    return number(entry.get("start"), "a start"), number(entry.get("end"), "an end")


@dataclass
class _Group:
    """A timed word with the untimed ones that joined it; `open` where these came behind it."""

    labels: list[str]
    start_s: float
    end_s: float
    open: bool = False


def _grouped(words: list[Any], start_s: float | None, end_s: float | None) -> Iterator[Span]:
    """Words in order; those without time or length joined to a neighbour.

    Args:
        words: of one segment, or of the whole file.
        start_s, end_s: of the segment, None where there is none.
    """
    groups, waiting = _groups(words, start_s)
    if waiting:
        if start_s is None or end_s is None:
            raise DamagedError("none of its words has a time")
        groups = [_Group(waiting, start_s, end_s)]
    for group, following in zip_longest(groups, groups[1:]):
        until_s = end_s if following is None else following.start_s
        last_s = group.end_s
        if group.open and until_s is not None:
            last_s = max(last_s, until_s)
        yield Span(" ".join(group.labels), group.start_s, last_s)


def _groups(words: list[Any], start_s: float | None) -> tuple[list[_Group], list[str]]:
    """Groups, and the words that none could take: all of them, or none."""
    groups: list[_Group] = []
    waiting: list[str] = []
    for entry in words:
        label, bounds = _word(mapping(entry, "a word"))
        if bounds is not None:
            first_s = bounds[0] if not waiting or start_s is None else min(start_s, bounds[0])
            groups.append(_Group([*waiting, label], first_s, bounds[1]))
            waiting = []
        elif groups:
            groups[-1].labels.append(label)
            groups[-1].open = True
        else:
            waiting.append(label)
    return groups, waiting


def _word(entry: dict[str, Any]) -> tuple[str, tuple[float, float] | None]:
    label = string(entry.get("word", entry.get("text")), "a word").strip()
    if entry.get("start") is None and entry.get("end") is None:
        return label, None
    start_s, end_s = _bounds(entry)
    return label, None if start_s == end_s else (start_s, end_s)
