"""``animeme validate``."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import click

from animeme import documents, registry
from animeme.check_profiles import CheckProfile
from animeme.cli import options as shared
from animeme.delivery import DeliveryCheck
from animeme.errors import InputError
from animeme.findings import Severity
from animeme.validation import (
    DEFAULT_PROFILE,
    ValidationReport,
    baseline_of,
    delivery_checks,
    rules,
    validate,
)

# More findings or skipped checks than this are not shown on a terminal; --json has all.
SHOWN = 40


@click.command(
    "validate",
    epilog="Example: animeme validate out/sample --dialogue sample_assets/dialogue "
    "--against sample_assets --junit report.xml",
)
@click.argument("paths", nargs=-1, type=click.Path(path_type=Path))
@click.option(
    "--against",
    type=click.Path(path_type=Path),
    help="What the files were made from: a file, or a folder of files of the same names.",
)
@click.option(
    "--dialogue",
    type=click.Path(path_type=Path),
    help="Recordings with their transcripts: <language>/[character/]<line>.wav and .txt.",
)
@click.option(
    "--profile",
    default=DEFAULT_PROFILE,
    show_default=True,
    metavar="NAME|FILE",
    help="What to judge by.",
)
@click.option("--rig", default="auto", show_default=True, help="A shipped rig profile, or a file.")
@click.option("--language", help="BCP-47 tag of a dialogue whose folders are no languages.")
@shared.aligner
@shared.lexicon
@click.option(
    "--baseline",
    type=click.Path(path_type=Path),
    help="Accept what this earlier --json report found.",
)
@click.option("--junit", type=click.Path(path_type=Path), help="Write JUnit XML to this file.")
@click.option("--sarif", type=click.Path(path_type=Path), help="Write SARIF 2.1.0 to this file.")
@shared.fail_on
@click.option("--list-checks", is_flag=True, help="List all checks and what they find.")
@click.option("--json", "as_json", is_flag=True, help="Print the result as JSON on stdout.")
def command(
    paths: tuple[Path, ...],
    against: Path | None,
    dialogue: Path | None,
    profile: str,
    rig: str,
    language: str | None,
    aligner: str,
    lexicon: Path | None,
    baseline: Path | None,
    junit: Path | None,
    sarif: Path | None,
    fail_on: str,
    list_checks: bool,
    as_json: bool,
) -> int:
    """Judge delivered animation: every glTF, VRM or USD file that PATHS name or contain.

    Needs no job. Files are read and never changed. With --dialogue, each animation is judged
    against its recording and its words.
    """
    if list_checks:
        _list(as_json)
        return 0
    if not paths:
        raise click.UsageError("Name at least one file or folder to validate.")
    known = [] if baseline is None else baseline_of(documents.read("validation", baseline))
    for target in (junit, sarif):
        _require_apart(target, (*paths, baseline))
    report = validate(
        paths,
        against=against,
        dialogue=dialogue,
        profile=profile,
        rig=rig,
        language=language,
        aligner=aligner,
        lexicon=lexicon,
        baseline=known,
        fail_on=Severity.parse(fail_on),
    )
    if junit is not None:
        registry.stage("junit")(
            report.cases(), junit, name="animeme validate", fail_on=report.fail_on
        )
    if sarif is not None:
        registry.stage("sarif")(report.all_findings, sarif, rules=rules())
    if as_json:
        click.echo(json.dumps(report.to_document(), ensure_ascii=False, indent=1))
    _tell(report, to_stderr=as_json)
    return report.exit_code


def _require_apart(target: Path | None, inputs: tuple[Path | None, ...]) -> None:
    if target is not None and any(
        path is not None and path.is_file() and path.resolve() == target.resolve()
        for path in inputs
    ):
        raise InputError(
            "output-is-input", "is read, and would be written", place=str(target),
            action="Choose another name.",
        )  # fmt: skip


def _tell(report: ValidationReport, *, to_stderr: bool) -> None:
    """The worst first, by file; then what was not judged, and counts."""
    found = report.all_findings
    shown_of = ""
    for finding in found[:SHOWN]:
        head = " ".join(filter(None, (finding.file, finding.line)))
        if head != shown_of:
            click.echo(head or "the whole delivery", err=to_stderr)
            shown_of = head
        click.echo(f"    {finding}", err=to_stderr)
    if len(found) > SHOWN:
        click.echo(f"and {len(found) - SHOWN} more: --json has them all", err=to_stderr)
    reasons: dict[tuple[str, str], int] = {}
    for entry in report.skipped:
        key = (entry.check, entry.reason)
        reasons[key] = reasons.get(key, 0) + 1
    for (check, reason), times in list(reasons.items())[:SHOWN]:
        often = f" ({times} times)" if times > 1 else ""
        click.echo(f"not judged  {check}: {reason}{often}", err=to_stderr)
    if len(reasons) > SHOWN:
        click.echo(f"and {len(reasons) - SHOWN} more: --json has them all", err=to_stderr)
    for name, reason in _excluded(report.profile):
        click.echo(f"excluded    {name}: {reason}", err=to_stderr)
    counts: dict[str, Any] = report.to_document()["totals"]
    accepted = f", {counts['accepted']} accepted" if counts["accepted"] else ""
    click.echo(
        f"{counts['files']} files, {counts['lines']} animations, {len(report.checks)} checks: "
        f"{counts['errors']} errors, {counts['warnings']} warnings{accepted}.",
        err=to_stderr,
    )


def _excluded(profile: CheckProfile) -> list[tuple[str, str]]:
    return sorted(profile.excluded.items())


def _list(as_json: bool) -> None:
    checks = delivery_checks()
    if as_json:
        document = {"checks": [_entry(check) for check in checks.values()]}
        click.echo(json.dumps(document, ensure_ascii=False, indent=1))
        return
    for check in sorted(checks.values(), key=lambda check: check.id):
        click.echo(f"{check.id}: {check.rationale}")
        for code, entry in check.codes.items():
            click.echo(f"    {entry.severity.label:<7} {code}: {entry.meaning}")


def _entry(check: DeliveryCheck) -> dict[str, Any]:
    return {
        "id": check.id,
        "subject": check.subject,
        "rationale": check.rationale,
        "source": check.source,
        "codes": {
            code: {
                "severity": entry.severity.label,
                "meaning": entry.meaning,
                "action": entry.action,
            }
            for code, entry in check.codes.items()
        },
        "limits": {
            name: {"value": spec.value, "meaning": spec.meaning}
            for name, spec in check.limits.items()
        },
    }
