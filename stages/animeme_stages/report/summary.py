"""``summary.md``: the run on one page, for people."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

from animeme.files import write_text
from animeme.findings import Finding, LineResult, LineStatus, RunReport
from animeme_stages.report.json_report import STATUSES, spoken_s

# More would not be read; report.json has them all.
MOST_FINDINGS = 40


def write(report: RunReport, output: Path) -> Path:
    """Write ``summary.md`` into the output folder and return its path."""
    path = output / "summary.md"
    write_text(path, text(report))
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
    yield "| language | character | lines | ok | review | failed | audio |"
    yield "| --- | --- | ---: | ---: | ---: | ---: | ---: |"
    groups = sorted({(line.language, line.character) for line in report.lines})
    for language, character in groups:
        own = [li for li in report.lines if (li.language, li.character) == (language, character)]
        counts = [report.count(s, character=character, language=language) for s in STATUSES]
        yield _row([language, character, len(own), *counts, f"{spoken_s(own):.1f} s"])
    totals = [report.count(status) for status in STATUSES]
    yield _row(["**all**", "", len(report.lines), *totals, f"{spoken_s(report.lines):.1f} s"])
    yield ""


def _row(cells: list[object]) -> str:
    return f"| {' | '.join(str(cell) for cell in cells)} |"


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
    rank: dict[LineStatus, int] = {"failed": 0, "review": 1, "ok": 2}
    return sorted(report.lines, key=lambda line: rank[line.status])


def _sentence(finding: Finding) -> str:
    who = " ".join(part for part in (finding.line, finding.character) if part)
    where = f" (`{finding.place}`)" if finding.place else ""
    return f"**{who or 'run'}**: {finding.message}{where}. {finding.action} `{finding.code}`"


def _outputs(report: RunReport) -> Iterator[str]:
    if report.outputs:
        yield "## Written"
        yield ""
        yield from (f"- `{path}`" for path in report.outputs)
        yield ""
