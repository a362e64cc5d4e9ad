"""Timed words and subtitles matched with a transcript: anchors for an aligner."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from difflib import SequenceMatcher

from animeme.contracts import Anchor
from animeme_stages.align.interchange import Span
from animeme_stages.align.interchange.track import SUBTITLES
from animeme_stages.align.language import Language
from animeme_stages.align.text import Token, tokens

WORD_SLACK_S = 0.1
"""Recognizers place a word's ends to within this: WhisperX mostly 50 ms, Whisper itself 100."""

SUBTITLE_SLACK_S = 0.5
"""A subtitle comes up early and stays to be read, by up to half a second in common style guides."""

# Real texts of an hour have some 200,000 pairs of equal words; one word over and over has millions.
_MOST_PAIRS = 2_000_000


@dataclass(frozen=True)
class Match:
    """What a transcript and the labels of timings have in common.

    Attributes:
        pairs: (tokens of the transcript, spans) that say the same, as ranges of indices, in order.
        tokens: of the transcript.
        agreeing: share of the longer one's words that the other one has too, 0 to 1.
        difference: the first one in a sentence, with its time; "" where there is none.
    """

    pairs: tuple[tuple[range, range], ...]
    tokens: tuple[Token, ...]
    agreeing: float
    difference: str


def slack_s(span: Span, source: str) -> float:
    """By how much the times of a span may be wrong, seconds either way.

    Args:
        span: a word, or a group of words: a subtitle, a segment, a phrase of an annotator's.
        source: the format it was read from, a key of `FORMATS`.
    """
    group = source in SUBTITLES or len(span.label.split()) > 1
    return SUBTITLE_SLACK_S if group else WORD_SLACK_S


def joined(spans: Sequence[Span], language: Language) -> str:
    """The text that `spans` make together."""
    return _joined(spans, language)[0]


def match(text: str, spans: Sequence[Span], language: Language) -> Match:
    """Find the words of `spans` in `text`, both normalised in the same way.

    Words that one side writes apart and the other together are the same. So are two spellings of a
    number. A span belongs to the transcript as a whole or with those of its words that agree.

    Args:
        text: the transcript.
        spans: words or groups of words, in order.
        language: whose words they are.

    Raises:
        InputError: the language needs a reader whose extra is not installed.
    """
    written = tokens(text, language)
    label_text, starts = _joined(spans, language)
    told = [(token, _spans_of(token, starts)) for token in tokens(label_text, language)]
    pairs: list[tuple[range, range]] = []
    agreeing, difference = 0, ""
    ours, others = [_letters(t.text) for t in written], [_letters(t.text) for t, _ in told]
    for mine, theirs in _blocks(ours, others):
        if "".join(ours[mine.start : mine.stop]) == "".join(others[theirs.start : theirs.stop]):
            agreeing += len(mine)
            for own, other in _parts(ours, mine, others, theirs):
                first, last = told[other.start][1], told[other.stop - 1][1]
                pairs.append((own, range(first.start, last.stop)))
        elif not difference:
            said = [token.text for token, _ in told[theirs.start : theirs.stop]]
            at = told[theirs.start][1].start if theirs.start < len(told) else len(spans)
            difference = _sentence(written[mine.start : mine.stop], said, spans, at)
    longer = max(len(written), len(told), 1)
    return Match(tuple(pairs), tuple(written), min(agreeing / longer, 1.0), difference)


def anchors_of(found: Match, spans: Sequence[Span], source: str) -> tuple[Anchor, ...]:
    """An anchor for each span, or run of spans, that the transcript has.

    What is written as one ("25") and timed as two ("twenty", "five"), or the other way round, is
    one anchor over both.

    Args:
        found: from `match`.
        spans: what was matched.
        source: the format they were read from, which tells how exact they are.
    """
    groups: list[tuple[int, int, range]] = []
    for mine, theirs in found.pairs:
        start, end = found.tokens[mine.start].start, found.tokens[mine.stop - 1].end
        if groups and (start < groups[-1][1] or theirs.start < groups[-1][2].stop):
            first, last, covered = groups.pop()
            start, end = min(first, start), max(last, end)
            theirs = range(covered.start, max(covered.stop, theirs.stop))
        groups.append((start, end, theirs))
    return tuple(
        Anchor(
            start,
            end,
            spans[theirs.start].start_s,
            spans[theirs.stop - 1].end_s,
            max(slack_s(span, source) for span in spans[theirs.start : theirs.stop]),
        )
        for start, end, theirs in groups
    )


def _joined(spans: Sequence[Span], language: Language) -> tuple[str, list[int]]:
    """The labels as one text, and where each starts in it."""
    text, starts = "", []
    for span in spans:
        # Scripts without spaces are read as a whole; a space would end a word.
        together = language.reader and not (text[-1:].isascii() or span.label[:1].isascii())
        text += "" if together or not text else " "
        starts.append(len(text))
        text += span.label
    return text, starts


def _spans_of(token: Token, starts: Sequence[int]) -> range:
    """Indices of the spans that a token of their joined text touches."""
    first = _last_below(starts, token.start)
    return range(first, max(_last_below(starts, token.end - 1), first) + 1)


def _last_below(starts: Sequence[int], position: int) -> int:
    low, high = 0, len(starts)
    while low < high:
        middle = (low + high) // 2
        low, high = (middle + 1, high) if starts[middle] <= position else (low, middle)
    return max(low - 1, 0)


def _blocks(mine: list[str], theirs: list[str]) -> Iterator[tuple[range, range]]:
    """Ranges of both that follow each other: word for word where equal, else as they differ."""
    head = _common(mine, theirs)
    tail = _common(mine[head:][::-1], theirs[head:][::-1])
    yield from ((range(i, i + 1), range(i, i + 1)) for i in range(head))
    ends = len(mine) - tail, len(theirs) - tail
    yield from _middle(mine[head : ends[0]], theirs[head : ends[1]], head)
    for i in range(tail):
        a, b = ends[0] + i, ends[1] + i
        yield range(a, a + 1), range(b, b + 1)


def _middle(mine: list[str], theirs: list[str], offset: int) -> Iterator[tuple[range, range]]:
    if not (mine or theirs):
        return
    counts = Counter(theirs)
    if sum(counts[word] for word in mine) > _MOST_PAIRS:
        yield range(offset, offset + len(mine)), range(offset, offset + len(theirs))
        return
    matcher = SequenceMatcher(None, mine, theirs, autojunk=False)
    for kind, a, a_end, b, b_end in matcher.get_opcodes():
        if kind == "equal":
            for i in range(a_end - a):
                one = range(offset + a + i, offset + a + i + 1)
                yield one, range(offset + b + i, offset + b + i + 1)
        else:
            yield range(offset + a, offset + a_end), range(offset + b, offset + b_end)


def _parts(
    ours: Sequence[str], mine: range, others: Sequence[str], theirs: range
) -> Iterator[tuple[range, range]]:
    """The smallest ranges that have the same letters on both sides, of two that do."""
    a, b = mine.start, theirs.start
    while a < mine.stop and b < theirs.stop:
        i, j, ahead = a + 1, b + 1, len(ours[a]) - len(others[b])
        while ahead:
            if ahead < 0:
                ahead, i = ahead + len(ours[i]), i + 1
            else:
                ahead, j = ahead - len(others[j]), j + 1
        yield range(a, i), range(b, j)
        a, b = i, j


def _common(first: Sequence[str], second: Sequence[str]) -> int:
    pairs = enumerate(zip(first, second, strict=False))
    return next((i for i, (a, b) in pairs if a != b), min(len(first), len(second)))


def _letters(text: str) -> str:
    """A word's letters: "l'" and "homme" are "l'homme", which others write as one."""
    return text.replace("'", "")


def _sentence(written: Iterable[Token], said: Sequence[str], spans: Sequence[Span], at: int) -> str:
    text = _quoted([token.text for token in written])
    time = f"at {spans[at].start_s:.2f} s" if at < len(spans) else "at the end"
    if not said:
        return f"{time} the transcript has {text}, which the timings lack"
    if not text:
        return f"{time} the timings have {_quoted(said)}, which the transcript lacks"
    return f"{time} the transcript has {text}, the timings {_quoted(said)}"


def _quoted(words: Sequence[str]) -> str:
    """The first few words, in quotes; "" if there are none."""
    shown = " ".join(words[:6])[:60]
    return f"'{shown}{' …' if len(words) > 6 else ''}'" if words else ""
