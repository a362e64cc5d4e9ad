"""Pairs of phones that transcripts have and a set of bigrams lacks."""

from __future__ import annotations

from collections import Counter, defaultdict
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from itertools import pairwise
from pathlib import Path

from animeme.bigrams import Coverage, MissingPair
from animeme.dialogue import Line
from animeme.errors import InputError
from animeme.findings import Finding
from animeme.phones import ARPABET_TO_IPA, plain_ipa
from animeme_stages.align.language import Language, language
from animeme_stages.align.lexicon import Lexicon, read_lexicon
from animeme_stages.align.pronounce import pronounce
from animeme_stages.align.survey import text_of
from animeme_stages.align.text import Token, tokens
from animeme_stages.synthesize.bigram_files import find_set
from animeme_stages.synthesize.bigram_set import PAUSE, BigramSet


def cover_bigrams(lines: Sequence[Line], bigrams: str, lexicon: Path | None) -> Coverage:
    """See `animeme.bigrams.cover_bigrams`."""
    set_ = find_set(bigrams).set_
    counts: Counter[tuple[str, str]] = Counter()
    where: dict[tuple[str, str], dict[str, None]] = defaultdict(dict)
    examples: dict[tuple[str, str], str] = {}
    findings: list[Finding] = []
    speakers: dict[str, _Speaker] = {}
    read = 0
    for line in lines:
        try:
            spoken_in = language(line.language)
            if spoken_in.tag not in speakers:
                own = read_lexicon(lexicon, spoken_in) if lexicon else Lexicon("")
                speakers[spoken_in.tag] = _Speaker(spoken_in, own, set_)
            words = tokens(text_of(line, spoken_in), spoken_in)
        except InputError as error:
            if lexicon is not None and error.place.startswith(str(lexicon)):
                raise
            findings.append(Finding.from_error(error, line=line.key))
            continue
        read += 1
        for first, second in speakers[spoken_in.tag].pairs(words, line, findings):
            pair = first.name, second.name
            counts[pair] += 1
            where[pair][line.key] = None
            examples.setdefault(pair, " ".join(dict.fromkeys((first.word, second.word))).strip())
    missing = [pair for pair in counts if "|".join(pair) not in set_.polygons]
    missing.sort(key=lambda pair: (-counts[pair], pair))
    return Coverage(
        read,
        counts.total(),
        len(counts),
        counts.total() - sum(counts[pair] for pair in missing),
        tuple(
            MissingPair(
                "|".join(pair), counts[pair], tuple(where[pair]), set_.source(*pair), examples[pair]
            )
            for pair in missing
        ),
        tuple(findings),
    )


@dataclass(frozen=True)
class _Sound:
    """A class of phones in a word; "" at a word that nobody can pronounce."""

    name: str
    word: str


@dataclass
class _Speaker:
    """One language's words as classes of phones, each looked up once."""

    language: Language
    lexicon: Lexicon
    set_: BigramSet
    known: dict[tuple[str, tuple[str, ...]], tuple[_Sound, ...]] = field(default_factory=dict)

    def pairs(
        self, words: Sequence[Token], line: Line, findings: list[Finding]
    ) -> Iterator[tuple[_Sound, _Sound]]:
        """Neighbouring sounds of a line, from pause to pause; none across an unknown word."""
        sounds = [_Sound(PAUSE, "")]
        for word in words:
            key = word.text, word.phones
            if key not in self.known:
                self.known[key] = self._look_up(word, line, findings)
            sounds += self.known[key]
        sounds.append(_Sound(PAUSE, ""))
        if len(sounds) > 2:
            yield from (pair for pair in pairwise(sounds) if pair[0].name and pair[1].name)

    def _look_up(self, word: Token, line: Line, findings: list[Finding]) -> tuple[_Sound, ...]:
        try:
            (spoken,) = pronounce(
                [word], self.language, line.origin or str(line.transcript), self.lexicon
            )
        except InputError as error:
            if error.code == "transcript-empty":  # it has no sound
                return ()
            findings.append(Finding.from_error(error, line=line.key))
            return (_Sound("", word.text),)
        symbols = [symbol for symbol, _ in spoken.variants[0]]
        if self.language.inventory == "arpabet":
            symbols = [ARPABET_TO_IPA[symbol] for symbol in symbols]
        return tuple(_Sound(self.set_.class_of(plain_ipa(s)), word.text) for s in symbols)
