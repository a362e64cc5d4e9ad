"""``report.json``: the run as a document, the same bytes for the same work."""

from __future__ import annotations

import json
from collections.abc import Iterable, Iterator
from importlib.metadata import version
from itertools import chain
from pathlib import Path
from typing import Any

from animeme.files import update_text
from animeme.findings import Finding, LineResult, RunReport
from animeme_stages.report.tally import tallies


def write(report: RunReport, output: Path) -> Path:
    """Write ``report.json`` into the output folder and return its path."""
    path = output / "report.json"
    rows = {
        "findings": map(_finding, report.findings),
        "lines": map(_line, report.lines),
        "outputs": map(said, report.outputs),
    }
    head = json.dumps(_head(report), ensure_ascii=False, indent=1).removesuffix("\n}")
    members = chain.from_iterable(as_rows(name, own) for name, own in rows.items())
    update_text(path, chain([head], members, ["\n}\n"]))
    return path


# Of a text; its own encoder is spared for rows, of which there may be many thousands.
said = json.JSONEncoder(ensure_ascii=False).encode


def as_rows(name: str, rows: Iterable[str]) -> Iterator[str]:
    """A member of a document, in parts: one element (as JSON) to a text line."""
    yield f',\n "{name}": ['
    before, end = "\n  ", "]"
    for row in rows:
        yield before + row
        before, end = ",\n  ", "\n ]"
    yield end


def _head(report: RunReport) -> dict[str, Any]:
    """The ``animeme.report/1`` document of a run, but for rows; times are in ``run.jsonl``."""
    counted = tallies(report.lines)
    return {
        "schema": "animeme.report/1",
        "animeme": version("animeme"),
        "job": report.job,
        "exit_code": report.exit_code,
        "totals": {name: tally.counts for name, tally in counted.characters.items()},
        "languages": {name: tally.counts for name, tally in counted.languages.items()},
        "audio_s": round(counted.all.audio_s, 3),
    }


def _line(line: LineResult) -> str:
    return (
        f'{{"line": {said(line.line)}, "language": {said(line.language)}, '
        f'"character": {said(line.character)}, "audio_s": {round(line.audio_s, 3)!r}, '
        f'"status": "{line.status}", "findings": [{", ".join(map(_finding, line.findings))}], '
        f'"outputs": [{", ".join(map(said, line.outputs))}]}}'
    )


def _finding(finding: Finding) -> str:
    return (
        f'{{"severity": "{finding.severity.label}", "code": {said(finding.code)}, '
        f'"message": {said(finding.message)}, "place": {said(finding.place)}, '
        f'"action": {said(finding.action)}, "line": {said(finding.line)}, '
        f'"character": {said(finding.character)}, "ours": {"true" if finding.ours else "false"}}}'
    )
