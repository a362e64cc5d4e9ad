"""How many lines of a run ended how, counted once: there may be many thousands."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterable
from dataclasses import dataclass, field

from animeme.findings import LineResult, LineStatus

STATUSES: tuple[LineStatus, ...] = ("ok", "review", "failed")


@dataclass
class Tally:
    """Lines that belong together.

    Attributes:
        counts: status → how many.
        audio_s: seconds of audio, each recording once, however many characters speak it.
    """

    counts: dict[LineStatus, int] = field(default_factory=lambda: dict.fromkeys(STATUSES, 0))
    audio_s: float = 0.0

    @property
    def lines(self) -> int:
        """How many there are."""
        return sum(self.counts.values())


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
    everything = Tally()
    languages: dict[str, Tally] = defaultdict(Tally)
    characters: dict[str, Tally] = defaultdict(Tally)
    groups: dict[tuple[str, str], Tally] = defaultdict(Tally)
    heard: set[str] = set()
    for line in lines:
        own = groups[line.language, line.character], characters[line.character]
        shared = languages[line.language], everything
        for tally in (*own, *shared):
            tally.counts[line.status] += 1
        for tally in own if line.line in heard else (*own, *shared):
            tally.audio_s += line.audio_s
        heard.add(line.line)
    return Tallies(
        everything,
        dict(sorted(languages.items())),
        dict(sorted(characters.items())),
        dict(sorted(groups.items())),
    )
