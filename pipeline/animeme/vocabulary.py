"""The words of a dialogue that no lexicon and no dictionary has."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import groupby
from typing import Any

from animeme.findings import Finding

# More of a word's lines than this are not named in a lexicon's comment; the document has all.
_NAMED_LINES = 3


@dataclass(frozen=True)
class UnknownWord:
    """A word to review.

    Attributes:
        word: as the text was read, lower case.
        language: primary tag.
        count: how often it is said.
        lines: keys of the lines that it is in, each once, in order.
        pronunciations: proposals, each with a blank between phones; () if there is none.
        source: what proposed them: "analogy" with English words that are known, "espeak",
            "reader", or "" for nothing.
        inventory: of the proposals: "arpabet" or "ipa".
    """

    word: str
    language: str
    count: int
    lines: tuple[str, ...]
    pronunciations: tuple[str, ...]
    source: str
    inventory: str

    def entries(self) -> str:
        """Lines of a lexicon file; a comment in place of what is unknown."""
        more = len(self.lines) - _NAMED_LINES
        named = ", ".join(self.lines[:_NAMED_LINES]) + (f" and {more} more" if more > 0 else "")
        comment = f";;; {self.count}× {named}\n"
        gap = "  " if self.inventory == "arpabet" else "\t"
        if not self.pronunciations:
            return f"{comment};;; {self.word}{gap}\n"
        return comment + "".join(f"{self.word}{gap}{said}\n" for said in self.pronunciations)


@dataclass(frozen=True)
class Survey:
    """What the transcripts of a dialogue need.

    Attributes:
        lines: how many were read.
        words: how many words they have.
        vocabulary: how many different ones.
        unknown: words that are in no lexicon and no dictionary, by language, most frequent first.
        findings: transcripts that could not be read, words that cannot be pronounced.
    """

    lines: int
    words: int
    vocabulary: int
    unknown: tuple[UnknownWord, ...]
    findings: tuple[Finding, ...]

    def to_document(self) -> dict[str, Any]:
        """For programs."""
        return {
            "lines": self.lines,
            "words": self.words,
            "vocabulary": self.vocabulary,
            "unknown": [
                {
                    "word": word.word,
                    "language": word.language,
                    "count": word.count,
                    "lines": list(word.lines),
                    "pronunciations": list(word.pronunciations),
                    "inventory": word.inventory,
                    "source": word.source,
                }
                for word in self.unknown
            ],
            "findings": [finding.to_json() for finding in self.findings],
        }

    def to_lexicon(self) -> str:
        """A lexicon file to review, with a section per language."""
        parts = [";;; Proposed pronunciations: correct them, delete what is right as it is.\n"]
        for language, words in groupby(self.unknown, key=lambda word: word.language):
            parts.append(f"\n;;; [{language}]\n")
            parts += [word.entries() for word in words]
        return "".join(parts)
