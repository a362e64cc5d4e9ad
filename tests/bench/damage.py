"""Lines of real data, and transcripts of them that are wrong in a known way."""

from __future__ import annotations

import random
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cache
from pathlib import Path

from animeme_stages.align.language import language as language_of
from animeme_stages.align.pronounce import dictionary
from animeme_stages.align.text import tokens
from animeme_stages.ingest.transcript import read_transcript

SHARED = Path(__file__).parents[2].parent / "shared" / "data"
GRID = SHARED / "grid-s1" / "lines"
PROMPTS = SHARED / "prompts" / "vo"
PROMPT_LANGUAGES = ("en", "es", "fr", "it", "ru")

# Its transcript begins with the name of its file, which nobody says.
MISMATCHED = {("ru", "conf-adminmenu")}

KINDS = ("another", "replaced", "inserted", "two removed")


@dataclass(frozen=True)
class RealLine:
    """A recording with its right transcript.

    Attributes:
        id: for people.
        language: BCP-47 tag.
        audio: the recording.
        words: what is said, normalised.
    """

    id: str
    language: str
    audio: Path
    words: tuple[str, ...]


@dataclass(frozen=True)
class Case:
    """A line with a transcript.

    Attributes:
        line: the line.
        kind: "right", or of `KINDS`; replaced and inserted words may be "from the dictionary".
        words: of the transcript.
    """

    line: RealLine
    kind: str
    words: tuple[str, ...]


@cache
def grid_lines() -> tuple[RealLine, ...]:
    """The 700 lines of one English speaker, by name."""
    return tuple(_line(path, "en") for path in sorted(GRID.glob("*.flac")))


@cache
def prompt_lines(language: str) -> tuple[RealLine, ...]:
    """The 60 prompts of one language, by name; of one speaker."""
    paths = sorted((PROMPTS / language).glob("*.flac"))
    return tuple(_line(path, language) for path in paths)


def _line(audio: Path, language: str) -> RealLine:
    text = read_transcript(audio.with_suffix(".txt"))
    words = tuple(token.text for token in tokens(text, language_of(language)))
    return RealLine(audio.stem, language, audio, words)


def cases(lines: Sequence[RealLine], seed: int, each: int = 1) -> Iterator[Case]:
    """Every line with its own transcript and with damaged ones.

    Words come from the transcripts of `lines` themselves, which makes it hard: they are short and
    alike. In English replaced and inserted words come from CMUdict as well, as cases of their own.

    Args:
        lines: of one language.
        seed: of all choices.
        each: how many damaged transcripts of each kind.
    """
    chance = random.Random(seed)
    own = sorted({word for line in lines for word in line.words})
    english = lines[0].language == "en"
    known = sorted(w for w in dictionary() if w.isalpha() and len(w) > 1) if english else []
    for line in lines:
        yield Case(line, "right", line.words)
        for _ in range(each):
            other = chance.choice([each for each in lines if each.words != line.words])
            yield Case(line, "another", other.words)
            yield Case(line, "replaced", _replaced(line.words, own, chance))
            yield Case(line, "inserted", _inserted(line.words, own, chance))
            if len(line.words) > 3:
                yield Case(line, "two removed", _removed(line.words, chance))
            if known:
                words = _replaced(line.words, known, chance)
                yield Case(line, "replaced from the dictionary", words)
                words = _inserted(line.words, known, chance)
                yield Case(line, "inserted from the dictionary", words)


def _replaced(
    words: tuple[str, ...], vocabulary: Sequence[str], chance: random.Random
) -> tuple[str, ...]:
    at = chance.randrange(len(words))
    new = chance.choice([word for word in vocabulary if word != words[at]])
    return (*words[:at], new, *words[at + 1 :])


def _inserted(
    words: tuple[str, ...], vocabulary: Sequence[str], chance: random.Random
) -> tuple[str, ...]:
    at = chance.randrange(len(words) + 1)
    return (*words[:at], chance.choice(vocabulary), *words[at:])


def _removed(words: tuple[str, ...], chance: random.Random) -> tuple[str, ...]:
    """Without two words: half the time neighbours, half the time any."""
    if chance.random() < 0.5:
        at = chance.randrange(len(words) - 1)
        return (*words[:at], *words[at + 2 :])
    first, second = sorted(chance.sample(range(len(words)), 2))
    return tuple(word for at, word in enumerate(words) if at not in (first, second))
