"""Findings as SARIF 2.1.0, as GitHub's and GitLab's code scanning take it (OASIS standard)."""

from __future__ import annotations

import hashlib
import json
import re
from collections.abc import Iterable, Iterator, Mapping
from importlib.metadata import version
from itertools import chain
from pathlib import Path
from typing import Any
from urllib.parse import quote

from animeme.ci import Rule
from animeme.files import update_text
from animeme.findings import Complaint, Finding, RunReport, Severity
from animeme_stages.report.json_report import as_rows, said

_SCHEMA = "https://json.schemastore.org/sarif-2.1.0.json"
_LEVELS = {Severity.INFO: "note", Severity.WARNING: "warning", Severity.ERROR: "error"}

# GitHub refuses a file with more.
MOST_RESULTS = 25_000
_FILE = re.compile(r"(?P<file>.*?\.\w{1,8})(:\d+)?")


def write(report: RunReport, output: Path) -> Path:
    """Write ``report.sarif`` of a run into its output folder and return its path."""
    path = output / "report.sarif"
    sarif(_of_run(report), path)
    return path


def _of_run(report: RunReport) -> Iterator[Finding]:
    """The run's findings, those of lines at the file that they are about or in."""
    for finding in report.findings:
        yield _at_file(finding, "")
    for line in report.lines:
        for finding in line.findings:
            yield _at_file(finding, line.outputs[0] if line.outputs else "")


def _at_file(finding: Finding, output: str) -> Complaint:
    """The finding, with its place told from the file; in `output` if it names none."""
    named = _FILE.fullmatch(finding.place)
    file = named["file"] if named else output
    place = "" if named else finding.place
    return Complaint(
        finding.severity,
        finding.code,
        finding.message,
        place,
        finding.action,
        finding.line,
        finding.character,
        finding.ours,
        file=file,
    )


def sarif(
    findings: Iterable[Finding], target: Path, *, rules: Mapping[str, Rule] | None = None
) -> None:
    """Write findings to `target`, atomically.

    Args:
        findings: in the order in which they are shown.
        target: the file to write.
        rules: what is known of codes; every code that is found becomes a rule.
    """
    listed = list(findings)
    notes = []
    if len(listed) > MOST_RESULTS:
        rest = f"{len(listed) - MOST_RESULTS} findings of the least severity are left out"
        notes = [{"level": "note", "message": {"text": f"{rest}: more would not be taken."}}]
        listed = sorted(listed, key=lambda finding: -finding.severity)[:MOST_RESULTS]
    known = rules or {}
    codes = sorted({finding.code for finding in listed})
    indices = {code: index for index, code in enumerate(codes)}
    driver = {
        "name": "animeme",
        "version": version("animeme"),
        "rules": [_rule(code, known.get(code)) for code in codes],
    }
    run: dict[str, Any] = {"tool": {"driver": driver}, "columnKind": "unicodeCodePoints"}
    if notes:
        run["invocations"] = [{"executionSuccessful": True, "toolExecutionNotifications": notes}]
    head = json.dumps(run, ensure_ascii=False, indent=1).removesuffix("\n}")
    results = as_rows("results", (_result(f, indices[f.code]) for f in listed))
    start = f'{{\n "$schema": "{_SCHEMA}",\n "version": "2.1.0",\n "runs": ['
    update_text(target, chain([start, head], results, ["\n}]\n}\n"]))


def _rule(code: str, rule: Rule | None) -> dict[str, Any]:
    if rule is None:
        return {"id": code, "shortDescription": {"text": code}}
    return {
        "id": code,
        "shortDescription": {"text": rule.meaning},
        "fullDescription": {"text": rule.rationale},
        "help": {"text": rule.action},
        "defaultConfiguration": {"level": _LEVELS[rule.severity]},
    }


def _result(finding: Finding, rule: int) -> str:
    """A result as JSON, put together by hand: there may be many thousands."""
    file = finding.file if isinstance(finding, Complaint) else finding.place
    place = finding.place if isinstance(finding, Complaint) else ""
    parts = (finding.message, when(finding), finding.action)
    text = ". ".join(part.rstrip(".") for part in parts if part)
    label = " ".join(filter(None, (finding.character, finding.line)))
    logical = ", ".join(
        f'{{"fullyQualifiedName": {said(name)}, "kind": "{kind}"}}'
        for name, kind in ((place, "object"), (label, "resource"))
        if name
    )
    # GitHub shows only what has a file; a finding of the whole call points at the folder.
    location = (
        f'"physicalLocation": {{"artifactLocation": {{"uri": {said(_uri(file or "."))}}}, '
        '"region": {"startLine": 1}}'
    )
    location += f', "logicalLocations": [{logical}]' if logical else ""
    identity = "\0".join((finding.code, file, finding.line, place))
    return (
        f'{{"ruleId": {said(finding.code)}, "ruleIndex": {rule}, '
        f'"level": "{_LEVELS[finding.severity]}", '
        f'"message": {{"text": {said(f"{label}: {text}." if label else f"{text}.")}}}, '
        f'"locations": [{{{location}}}], "partialFingerprints": '
        f'{{"animeme/v1": "{hashlib.sha256(identity.encode()).hexdigest()}"}}}}'
    )


def _uri(file: str) -> str:
    """A file as SARIF names it: GitHub finds its own by what it has checked out where."""
    return f"file://{quote(file)}" if file.startswith("/") else quote(file)


def when(finding: Finding) -> str:
    """The time range of a finding, "" if it has none."""
    start_s = finding.start_s if isinstance(finding, Complaint) else None
    if start_s is None:
        return ""
    end_s = finding.end_s if isinstance(finding, Complaint) else None
    return f"at {start_s:.2f} s" if end_s is None else f"from {start_s:.2f} to {end_s:.2f} s"
