"""Findings as SARIF 2.1.0, as GitHub's and GitLab's code scanning take it (OASIS standard)."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Iterable, Mapping
from importlib.metadata import version
from pathlib import Path
from typing import Any
from urllib.parse import quote

from animeme.ci import Rule
from animeme.delivery import Complaint
from animeme.files import write_text
from animeme.findings import Finding, Severity

_SCHEMA = "https://json.schemastore.org/sarif-2.1.0.json"
_LEVELS = {Severity.INFO: "note", Severity.WARNING: "warning", Severity.ERROR: "error"}


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
    known = rules or {}
    codes = sorted({finding.code for finding in listed})
    indices = {code: index for index, code in enumerate(codes)}
    document = {
        "$schema": _SCHEMA,
        "version": "2.1.0",
        "runs": [
            {
                "tool": {
                    "driver": {
                        "name": "animeme",
                        "version": version("animeme"),
                        "rules": [_rule(code, known.get(code)) for code in codes],
                    }
                },
                "columnKind": "unicodeCodePoints",
                "results": [_result(finding, indices[finding.code]) for finding in listed],
            }
        ],
    }
    write_text(target, json.dumps(document, ensure_ascii=False, indent=1) + "\n")


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


def _result(finding: Finding, rule: int) -> dict[str, Any]:
    file = finding.file if isinstance(finding, Complaint) else finding.place
    place = finding.place if isinstance(finding, Complaint) else ""
    parts = [finding.message, when(finding), finding.action]
    said = ". ".join(part.rstrip(".") for part in parts if part)
    label = " ".join(filter(None, (finding.character, finding.line)))
    logical = [
        {"fullyQualifiedName": name, "kind": kind}
        for name, kind in ((place, "object"), (label, "resource"))
        if name
    ]
    # GitHub shows only what has a file; a finding of the whole call points at the folder.
    location: dict[str, Any] = {
        "physicalLocation": {
            "artifactLocation": {"uri": quote(Path(file or ".").as_posix())},
            "region": {"startLine": 1},
        }
    }
    if logical:
        location["logicalLocations"] = logical
    identity = "\0".join((finding.code, file, finding.line, place))
    return {
        "ruleId": finding.code,
        "ruleIndex": rule,
        "level": _LEVELS[finding.severity],
        "message": {"text": f"{label}: {said}." if label else f"{said}."},
        "locations": [location],
        "partialFingerprints": {"animeme/v1": hashlib.sha256(identity.encode()).hexdigest()},
    }


def when(finding: Finding) -> str:
    """The time range of a finding, "" if it has none."""
    start_s = finding.start_s if isinstance(finding, Complaint) else None
    if start_s is None:
        return ""
    end_s = finding.end_s if isinstance(finding, Complaint) else None
    return f"at {start_s:.2f} s" if end_s is None else f"from {start_s:.2f} to {end_s:.2f} s"
