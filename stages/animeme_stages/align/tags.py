"""Inline tags: never spoken, kept as timed events of the line.

A tag is what stands in ``[…]`` or ``<…>``: stage directions, FaceFX, SGX and SSML. The outermost
brackets make it, so a tag may hold others. A bracket without its partner is ordinary text, as is a
``<`` that no tag could start with ("5 < 6", "<3"): no word is lost to a typing error.
"""

from __future__ import annotations

import re
import unicodedata
from bisect import bisect_left, bisect_right
from collections.abc import Iterator, Sequence

from animeme.findings import Finding, Severity
from animeme.phones import Event, Word

# Possessive, and stopped by the next "<", so that no character is looked at more than twice. An
# attribute's value in quotes may hold ">" (XML 1.0, §2.3).
_ANGLED = re.compile(
    r"""<(?:\d++(?:\.\d++)?+\s*+>"""  # FaceFX's chunk times
    r"""|(?![\s\d=<>+.,;:-])(?:[^<>=]|=\s*+(?:"[^"<]*+"|'[^'<]*+')|=)++>)"""
)


def tag_spans(text: str) -> list[tuple[int, int]]:
    """The characters [start, end) of each tag, brackets included, in order, without overlap."""
    pairs, _ = _square_pairs(text)
    angled = [match.span() for match in _ANGLED.finditer(text)]
    spans: list[tuple[int, int]] = []
    end = 0
    for span in sorted([*pairs, *angled]):
        if span[0] >= end:
            spans.append(span)
            end = span[1]
    return spans


def untagged(text: str) -> str:
    """`text`, as long as before, with blanks in place of its tags."""
    parts: list[str] = []
    cursor = 0
    for start, end in tag_spans(text):
        parts += (text[cursor:start], " " * (end - start))
        cursor = end
    return "".join((*parts, text[cursor:]))


def timed_tags(text: str, words: Sequence[Word]) -> tuple[Event, ...]:
    """The inline tags of a transcript as events, in the order in which they are written.

    A tag happens when the first word after it starts, or when the last word ends if none follows.
    One that closes another (``[/happy]``, ``</b>``) happens when the word before it ends. Without
    any word all is at 0 s.

    Args:
        text: the transcript.
        words: those found in it, in order, with their places in `text`.

    Example:
        >>> words = (Word("oh", 0.5, 0.9, (9, 11)), Word("no", 1.4, 1.8, (19, 21)))
        >>> [(event.tag, event.time_s) for event in timed_tags("[laughs] Oh</b> <b>no", words)]
        [('laughs', 0.5), ('/b', 0.9), ('b', 1.4)]
    """
    starts = [word.source[0] for word in words]
    events: list[Event] = []
    time_s = 0.0
    for start, end in tag_spans(text):
        tag = _tidy(text[start + 1 : end - 1])
        if not tag:
            continue
        following = bisect_left(starts, end)
        before = bisect_right(starts, start) - 1
        if words and tag.startswith("/"):
            at_s = words[before].end_s if before >= 0 else words[0].start_s
        elif words:
            at_s = words[following].start_s if following < len(words) else words[-1].end_s
        else:
            at_s = 0.0
        time_s = max(time_s, at_s)  # what closes behind what has opened does not run back
        events.append(Event(tag, time_s, (start, end)))
    return tuple(events)


def unpaired_brackets(text: str) -> Iterator[Finding]:
    """A warning where a square bracket lacks its partner: what it was to hide is read as spoken."""
    _, alone = _square_pairs(text)
    if alone:
        at = alone[0]
        more = f" (and {len(alone) - 1} more)" if len(alone) > 1 else ""
        yield Finding(
            Severity.WARNING,
            "transcript-bracket",
            f"the '{text[at]}' at character {at + 1} of the transcript has no partner{more}, so "
            "the words after or before it are taken as spoken",
            action="Close the tag, or take the bracket away.",
        )


def _square_pairs(text: str) -> tuple[list[tuple[int, int]], list[int]]:
    """Spans of ``[…]``, inner ones included, and the places of brackets without partner."""
    pairs: list[tuple[int, int]] = []
    opened: list[int] = []
    alone: list[int] = []
    for match in re.finditer(r"[\[\]]", text):
        if match[0] == "[":
            opened.append(match.start())
        elif opened:
            pairs.append((opened.pop(), match.end()))
        else:
            alone.append(match.start())
    return pairs, sorted(alone + opened)


def _tidy(content: str) -> str:
    """A tag's text on one line, without control characters and the end of an empty element."""
    shown = "".join(" " if unicodedata.category(c) in ("Cc", "Cs") else c for c in content)
    return " ".join(shown.split()).removesuffix("/").rstrip()
