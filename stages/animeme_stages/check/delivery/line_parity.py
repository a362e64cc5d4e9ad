"""Check ``line-parity``."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any, ClassVar

from animeme.delivery import Code, Complaint, Deliveries, LimitSpec, Skip, complain
from animeme.findings import Severity


class LineParity:
    """Each language has every line."""

    id: ClassVar[str] = "line-parity"
    subject: ClassVar[str] = "deliveries"
    rationale: ClassVar[str] = (
        "A line that one language lacks is silent in the localised game, where nobody of the "
        "team looks."
    )
    source: ClassVar[str] = "the layout <language>/<file> of dialogue and delivery"
    codes: ClassVar[Mapping[str, Code]] = {
        "language-lacks-line": Code(
            Severity.ERROR,
            "A line is there in one language and not in another.",
            "Deliver it, or exclude it with a reason.",
        ),
    }
    limits: ClassVar[Mapping[str, LimitSpec]] = {}

    def run(self, deliveries: Deliveries, limits: Mapping[str, Any]) -> Iterable[Complaint]:
        """Complain of each line and character that a language lacks."""
        had: dict[tuple[str, str], dict[str, set[str]]] = {}
        where: dict[tuple[str, str, str], Any] = {}
        for file in deliveries.files:
            key = (_character(file.path, [p.language for p in file.performances]), file.path.suffix)
            for p in file.performances:
                if p.language:
                    line = p.line.partition("/")[2] or p.line
                    had.setdefault(key, {}).setdefault(p.language, set()).add(line)
                    where.setdefault((*key, p.language), file.path)
        if all(len(by_language) < 2 for by_language in had.values()):
            raise Skip("there is one language at most")
        for key, by_language in sorted(had.items()):
            every = set().union(*by_language.values())
            for language, lines in sorted(by_language.items()):
                for line in sorted(every - lines):
                    yield complain(
                        "language-lacks-line",
                        f"'{language}' has no {line}",
                        file=where[(*key, language)],
                        line=f"{language}/{line}",
                    )


def _character(path: Path, languages: Sequence[str]) -> str:
    """What a file and its translations have in common: a file of one line is its character's."""
    below = [i for i, part in enumerate(path.parts[:-1]) if part in languages]
    parts = path.parts[below[-1] + 1 :] if below else path.parts[-1:]
    return Path(parts[0]).stem
