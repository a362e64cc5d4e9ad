"""How many lines of a run ended how, counted once: there may be many thousands."""

from __future__ import annotations

from collections import Counter, defaultdict
from collections.abc import Iterable
from dataclasses import dataclass

from animeme.findings import LineResult, LineStatus

STATUSES: tuple[LineStatus, ...] = ("ok", "review", "failed")


@dataclass
class Tally:
    """Lines that belong together.

    Attributes:
        counts: status → how many.
        heard_s: line → its length in seconds; one recording may be spoken by several characters.
    """

    counts: dict[LineStatus, int]
    heard_s: dict[str, float]

    @classmethod
    def of(cls, lines: Iterable[LineResult]) -> Tally:
        """Count lines."""
        listed = list(lines)
        counts = Counter(line.status for line in listed)
        return cls(
            {status: counts[status] for status in STATUSES},
            {line.line: line.audio_s for line in listed},
        )

    @classmethod
    def sum(cls, parts: Iterable[Tally]) -> Tally:
        """All of them together."""
        counts: Counter[LineStatus] = Counter()
        heard_s: dict[str, float] = {}
        for part in parts:
            counts.update(part.counts)
            heard_s |= part.heard_s
        return cls({status: counts[status] for status in STATUSES}, heard_s)

    @property
    def lines(self) -> int:
        """How many there are."""
        return sum(self.counts.values())

    @property
    def audio_s(self) -> float:
        """Seconds of audio, each recording once."""
        return sum(self.heard_s.values())


@dataclass
class Tallies:
    """A run's lines, counted in each way that people ask for; keys sorted.

    Attributes:
        all: every line.
        languages, characters: by these.
        groups: by (language, character).
    """

    all: Tally
    languages: dict[str, Tally]
    characters: dict[str, Tally]
    groups: dict[tuple[str, str], Tally]


def tallies(lines: Iterable[LineResult]) -> Tallies:
    """Count lines."""
    own: dict[tuple[str, str], list[LineResult]] = defaultdict(list)
    for line in lines:
        own[line.language, line.character].append(line)
    groups = {key: Tally.of(own[key]) for key in sorted(own)}
    languages, characters = (
        {
            name: Tally.sum(tally for key, tally in groups.items() if key[place] == name)
            for name in sorted({key[place] for key in groups})
        }
        for place in (0, 1)
    )
    return Tallies(Tally.sum(groups.values()), languages, characters, groups)
