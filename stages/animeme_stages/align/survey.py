"""The words of many transcripts that are in no lexicon and no dictionary."""

from __future__ import annotations

from collections import Counter, defaultdict
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path

from animeme.dialogue import Line, has_transcript, transcript_of
from animeme.errors import InputError
from animeme.findings import Finding, Severity
from animeme.vocabulary import Survey, UnknownWord
from animeme_stages.align.anchors import joined
from animeme_stages.align.interchange import read_timings
from animeme_stages.align.language import Language, language
from animeme_stages.align.lexicon import Lexicon, read_lexicon
from animeme_stages.align.pronounce import dictionary, guess, proposer
from animeme_stages.align.text import Token, tokens


@dataclass
class _Seen:
    """Where a language's words were seen: one token of each, and its lines."""

    language: Language
    counts: Counter[str] = field(default_factory=Counter)
    lines: dict[str, dict[str, None]] = field(default_factory=lambda: defaultdict(dict))
    readings: dict[str, dict[Token, None]] = field(default_factory=lambda: defaultdict(dict))


def survey(lines: Sequence[Line], lexicon: Path | None = None) -> Survey:
    """Read the transcripts of `lines` and look their words up; no recording is touched.

    Args:
        lines: whose transcripts.
        lexicon: the user's.

    Raises:
        InputError: the lexicon is broken.
    """
    seen: dict[str, _Seen] = {}
    findings: list[Finding] = []
    read = 0
    for line in lines:
        try:
            spoken_in = language(line.language)
            found = tokens(text_of(line, spoken_in), spoken_in)
        except InputError as error:
            findings.append(Finding.from_error(error, line=line.key))
            continue
        read += 1
        words = seen.setdefault(spoken_in.tag, _Seen(spoken_in))
        for token in found:
            words.counts[token.text] += 1
            words.lines[token.text][line.key] = None
            words.readings[token.text][Token(token.text, 0, 0, token.phones)] = None
    unknown: list[UnknownWord] = []
    for tag in sorted(seen):
        own = read_lexicon(lexicon, seen[tag].language) if lexicon else Lexicon("")
        findings += [_unused(place) for place in own.unused]
        missing = [
            word for word in seen[tag].counts if not _is_known(word, seen[tag].language, own)
        ]
        missing.sort(key=lambda word: (-seen[tag].counts[word], word))
        unknown += [_proposed(word, seen[tag], findings) for word in missing]
    return Survey(
        read,
        sum(words.counts.total() for words in seen.values()),
        sum(len(words.counts) for words in seen.values()),
        tuple(unknown),
        tuple(findings),
    )


def text_of(line: Line, spoken_in: Language) -> str:
    """What the line's transcript says, or its timings where they are all there is.

    Raises:
        InputError: it cannot be read.
    """
    if line.timings is None or has_transcript(line):
        return transcript_of(line)
    timings = read_timings(line.timings)
    # Phones need no pronunciation.
    return "" if timings.phones else joined(timings.words, spoken_in)


def _is_known(word: str, spoken_in: Language, lexicon: Lexicon) -> bool:
    if word in lexicon.entries:
        return True
    return spoken_in.inventory == "arpabet" and word in dictionary()


def _proposed(word: str, seen: _Seen, findings: list[Finding]) -> UnknownWord:
    """The word with its proposals; why there is none goes to `findings`."""
    said: dict[str, None] = {}
    source = ""
    for token in seen.readings[word]:
        try:
            pronunciations = guess(token, seen.language)
        except InputError as error:
            findings.append(Finding.from_error(error, line=next(iter(seen.lines[word]))))
            continue
        said |= {" ".join(symbol for symbol, _ in phones): None for phones in pronunciations}
        source = proposer(token, seen.language)
    return UnknownWord(
        word,
        seen.language.tag,
        seen.counts[word],
        tuple(seen.lines[word]),
        tuple(said),
        source if said else "",
        seen.language.inventory,
    )


def _unused(place: str) -> Finding:
    return Finding(
        Severity.WARNING,
        "lexicon-unused",
        "the entry is not one word, so no text matches it",
        place=place,
        action="Write an entry for each word.",
    )
