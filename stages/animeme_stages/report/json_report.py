"""``report.json``: the run as a document, the same bytes for the same work."""

from __future__ import annotations

import json
from collections.abc import Iterable
from importlib.metadata import version
from pathlib import Path
from typing import Any

from animeme.files import write_text
from animeme.findings import LineResult, LineStatus, RunReport

STATUSES: tuple[LineStatus, ...] = ("ok", "review", "failed")


def write(report: RunReport, output: Path) -> Path:
    """Write ``report.json`` into the output folder and return its path."""
    path = output / "report.json"
    content = document(report)
    rows = {name: content.pop(name) for name in ("findings", "lines", "outputs")}
    head = json.dumps(content, ensure_ascii=False, indent=1).removesuffix("\n}")
    write_text(path, f"{head}{''.join(_rows(name, own) for name, own in rows.items())}\n}}\n")
    return path


def _rows(name: str, rows: list[Any]) -> str:
    """A member of the document, one element to a text line: there may be many thousands."""
    texts = [json.dumps(row, ensure_ascii=False) for row in rows]
    content = "\n  " + ",\n  ".join(texts) + "\n " if texts else ""
    return f',\n "{name}": [{content}]'


def document(report: RunReport) -> dict[str, Any]:
    """The ``animeme.report/1`` document of a run. Times it took are in ``run.jsonl``."""
    characters = dict.fromkeys(line.character for line in report.lines)
    return {
        "schema": "animeme.report/1",
        "animeme": version("animeme"),
        "job": report.job,
        "exit_code": report.exit_code,
        "totals": {
            name: {status: report.count(status, character=name) for status in STATUSES}
            for name in characters
        },
        "audio_s": round(spoken_s(report.lines), 3),
        "findings": [finding.to_json() for finding in report.findings],
        "lines": [_line(line) for line in report.lines],
        "outputs": list(report.outputs),
    }


def spoken_s(lines: Iterable[LineResult]) -> float:
    """Seconds of audio, each recording once, however many characters speak it."""
    return sum({line.line: line.audio_s for line in lines}.values())


def _line(line: LineResult) -> dict[str, Any]:
    return {
        "line": line.line,
        "language": line.language,
        "character": line.character,
        "audio_s": round(line.audio_s, 3),
        "status": line.status,
        "findings": [finding.to_json() for finding in line.findings],
        "outputs": list(line.outputs),
    }
