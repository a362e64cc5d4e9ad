"""``summary.md``: the run on one page, for people."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator
from pathlib import Path

from animeme.files import update_text
from animeme.findings import Finding, LineResult, RunReport, Severity
from animeme_stages.report.tally import Tally, tallies

# More would not be read; report.json has them all.
MOST_FINDINGS = 40
MOST_OUTPUTS = 200


def write(report: RunReport, output: Path) -> Path:
    """Write ``summary.md`` into the output folder and return its path."""
    path = output / "summary.md"
    update_text(path, [text(report)])
    return path


def text(report: RunReport) -> str:
    """The summary as Markdown."""
    return "\n".join(
        [
            f"# {report.job}",
            "",
            *_partial(report),
            *_table(report),
            *_unrecorded(report),
            *_findings(report),
            *_outputs(report),
        ]
    )


def _partial(report: RunReport) -> Iterator[str]:
    """Where a run was about some of the lines, which."""
    for finding in report.findings:
        if finding.code == "run-partial":
            yield f"{finding.message}. {finding.action}"
            yield ""


def _table(report: RunReport) -> Iterator[str]:
    counted = tallies(report.lines)
    yield "| language | character | lines | ok | review | failed | audio |"
    yield "| --- | --- | ---: | ---: | ---: | ---: | ---: |"
    for (language, character), tally in counted.groups.items():
        yield _row(language, character, tally)
    if len(counted.languages) > 1 and len(counted.characters) > 1:
        yield from (_row(f"**{name}**", "all", tally) for name, tally in counted.languages.items())
        yield from (_row("all", f"**{name}**", tally) for name, tally in counted.characters.items())
    yield _row("**all**", "", counted.all)
    yield ""


def _row(language: str, character: str, tally: Tally) -> str:
    cells = [language, character, tally.lines, *tally.counts.values(), f"{tally.audio_s:.1f} s"]
    return f"| {' | '.join(map(str, cells))} |"


def _unrecorded(report: RunReport) -> Iterator[str]:
    """Lines that must not ship as they are, although nothing is wrong with them."""
    lines = dict.fromkeys(
        line.line for line in report.lines for f in line.findings if f.code == "line-synthetic"
    )
    if not lines:
        return
    more = len(lines) - MOST_FINDINGS
    named = ", ".join(f"`{line}`" for line in list(lines)[:MOST_FINDINGS])
    yield "## Not recorded"
    yield ""
    yield f"A program spoke {len(lines)} of the lines, no actor: {named}" + (
        f" and {more} more in `report.json`. `line-synthetic`" if more > 0 else ". `line-synthetic`"
    )
    yield ""


def _findings(report: RunReport) -> Iterator[str]:
    worth = [f for f in report.findings if f.severity > 0]
    worth += [f for line in _worst_first(report) for f in line.findings if f.severity > 0]
    if not worth:
        return
    yield "## To look at"
    yield ""
    for finding in worth[:MOST_FINDINGS]:
        yield f"- {_sentence(finding)}"
    if len(worth) > MOST_FINDINGS:
        yield f"- … and {len(worth) - MOST_FINDINGS} more in `report.json`"
    yield ""


def _worst_first(report: RunReport) -> list[LineResult]:
    """Lines that are not ok: those that failed, then by how much there is to look at."""
    bad = [line for line in report.lines if line.status != "ok"]

    def order(line: LineResult) -> tuple[int, ...]:
        counts = Counter(finding.severity for finding in line.findings)
        return (-counts[Severity.ERROR], -counts[Severity.WARNING])

    return sorted(bad, key=order)


def _sentence(finding: Finding) -> str:
    who = " ".join(part for part in (finding.line, finding.character) if part)
    where = f" (`{finding.place}`)" if finding.place else ""
    return f"**{who or 'run'}**: {finding.message}{where}. {finding.action} `{finding.code}`"


def _outputs(report: RunReport) -> Iterator[str]:
    if not report.outputs:
        return
    yield "## Written"
    yield ""
    yield from (f"- `{path}`" for path in report.outputs[:MOST_OUTPUTS])
    if len(report.outputs) > MOST_OUTPUTS:
        yield f"- … and {len(report.outputs) - MOST_OUTPUTS} more in `report.json`"
    yield ""
