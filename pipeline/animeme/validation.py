"""``animeme validate``: delivered files, judged without a job."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cache
from importlib.metadata import version
from pathlib import Path
from typing import Any, cast

from animeme import registry
from animeme.check_profiles import CheckProfile, read_profile
from animeme.ci import Case, Rule
from animeme.deliveries import read_deliveries
from animeme.delivery import (
    Complaint,
    Deliveries,
    Delivery,
    DeliveryCheck,
    Performance,
    Skip,
)
from animeme.errors import InputError
from animeme.findings import Finding, LineStatus, Severity, exit_code_of, status_of

DEFAULT_PROFILE = "delivery"
FAILED = "check-failed"
READABLE = "readable"  # the one check that looks at files which cannot be read


@dataclass(frozen=True)
class Skipped:
    """A check that could not judge something, and why."""

    check: str
    file: str
    line: str
    reason: str

    def to_json(self) -> dict[str, str]:
        """As in the ``validation`` document."""
        return {"check": self.check, "file": self.file, "line": self.line, "reason": self.reason}


@dataclass(frozen=True)
class JudgedFile:
    """How one file was judged.

    Attributes:
        file: as it was named.
        lines: (animation, line) of each animation that was judged.
        findings: the worst first.
    """

    file: str
    lines: tuple[tuple[str, str], ...]
    findings: tuple[Complaint, ...]

    @property
    def status(self) -> LineStatus:
        """Worst of what was found; faults of checks fail no file."""
        return status_of(finding for finding in self.findings if not finding.ours)


@dataclass(frozen=True)
class ValidationReport:
    """How a delivery was judged.

    Attributes:
        profile: by what.
        checks: ids of the checks that were asked, sorted.
        files: sorted by name.
        findings: those that concern no single file.
        skipped: what could not be judged.
        accepted: findings that the baseline knows.
        fail_on: the severity at which the exit code turns 1.
    """

    profile: CheckProfile
    checks: tuple[str, ...]
    files: tuple[JudgedFile, ...]
    findings: tuple[Complaint, ...]
    skipped: tuple[Skipped, ...]
    accepted: tuple[Complaint, ...] = ()
    fail_on: Severity = Severity.ERROR

    @property
    def all_findings(self) -> tuple[Complaint, ...]:
        """Everything found, the worst first."""
        found = (*self.findings, *(f for file in self.files for f in file.findings))
        return tuple(sorted(found, key=_order))

    @property
    def exit_code(self) -> int:
        """0 all well; 1 something is at or above `fail_on`; 3 a fault of ours among it."""
        return exit_code_of(self.all_findings, self.fail_on)

    def cases(self) -> Iterator[Case]:
        """A case per animation and one per file for the rest, then one for the whole delivery."""
        whole = [entry for entry in self.findings if not entry.file]
        suites = [*self.files, JudgedFile("delivery", (), tuple(whole))]
        by_name = {file.file: file for file in suites}
        for entry in self.findings:
            by_name.setdefault(entry.file, JudgedFile(entry.file, (), (entry,)))
        for file in by_name.values():
            lines = dict.fromkeys(line for _, line in file.lines)
            own = [finding for finding in file.findings if finding.line not in lines]
            yield Case(file.file, "file", own)
            for line in lines:
                yield Case(file.file, line, [f for f in file.findings if f.line == line])
        for skipped in self.skipped:
            name = f"{skipped.line}: {skipped.check}" if skipped.line else skipped.check
            yield Case(skipped.file or "delivery", name, skipped=skipped.reason)

    def to_document(self) -> dict[str, Any]:
        """An ``animeme.validation/1`` document."""
        count = Counter(finding.severity for finding in self.all_findings)
        return {
            "schema": "animeme.validation/1",
            "animeme": version("animeme"),
            "profile": self.profile.name,
            "exit_code": self.exit_code,
            "totals": {
                "files": len(self.files),
                "lines": sum(len(file.lines) for file in self.files),
                **{f"{severity.label}s": count[severity] for severity in reversed(Severity)},
                "skipped": len(self.skipped),
                "accepted": len(self.accepted),
            },
            "checks": list(self.checks),
            "excluded": dict(self.profile.excluded),
            "findings": [finding.to_json() for finding in self.findings],
            "files": [
                {
                    "file": file.file,
                    "status": file.status,
                    "lines": [{"animation": a, "line": line} for a, line in file.lines],
                    "findings": [finding.to_json() for finding in file.findings],
                }
                for file in self.files
            ],
            "skipped": [entry.to_json() for entry in self.skipped],
            "accepted": [finding.to_json() for finding in self.accepted],
        }


@cache
def delivery_checks() -> Mapping[str, DeliveryCheck]:
    """Every registered check of deliveries by id."""
    found = registry.checks(registry.DELIVERY_CHECKS)
    return {check.id: cast(DeliveryCheck, check) for check in found}


def rules() -> dict[str, Rule]:
    """What every code of every check means."""
    return {
        code: Rule(entry.meaning, check.rationale, entry.action, entry.severity)
        for check in delivery_checks().values()
        for code, entry in check.codes.items()
    }


def validate(
    paths: Sequence[Path],
    *,
    against: Path | None = None,
    dialogue: Path | None = None,
    profile: str = DEFAULT_PROFILE,
    rig: str = "auto",
    language: str | None = None,
    aligner: str = "pocketsphinx",
    lexicon: Path | None = None,
    baseline: Iterable[Mapping[str, Any]] = (),
    fail_on: Severity = Severity.ERROR,
    listener: Callable[[int, int], None] = lambda done, total: None,
) -> ValidationReport:
    """Judge delivered files; nothing is written, and nothing of theirs is changed.

    Args:
        paths: files, or folders that are searched for them.
        against: the file that they were made from, or a folder of such, by the same names.
        dialogue: folder of recordings with their transcripts.
        profile: name of a profile, or its file.
        rig: "auto", a shipped rig profile, or a rig document.
        language: of the whole dialogue, where its folders are no languages.
        aligner: a registered aligner.
        lexicon: pronunciations that go before the aligner's own.
        baseline: findings of an earlier report that are accepted.
        fail_on: severity at which the report's exit code turns 1.
        listener: told how many files are done, of how many.

    Raises:
        InputError: a path cannot be used, or there is nothing to judge.
        JobError: the profile is broken.
        PluginError: a plug-in that is needed cannot be loaded.
    """
    chosen = read_profile(profile, delivery_checks())
    subjects, unread = read_deliveries(
        paths,
        against=against,
        dialogue=dialogue,
        names=chosen.lines,
        rig=rig,
        language=language,
        aligner=aligner,
        lexicon=lexicon,
    )
    return judge(subjects, unread, chosen, baseline=baseline, fail_on=fail_on, listener=listener)


def judge(
    subjects: Deliveries,
    unread: Iterable[tuple[Path, str]],
    chosen: CheckProfile,
    *,
    baseline: Iterable[Mapping[str, Any]] = (),
    fail_on: Severity = Severity.ERROR,
    listener: Callable[[int, int], None] = lambda done, total: None,
) -> ValidationReport:
    """Judge what `read_deliveries` has read.

    Args:
        subjects, unread: its answer.
        chosen: what to judge by.
        baseline, fail_on, listener: as for `validate`.
    """
    asked = {id: check for id, check in delivery_checks().items() if id not in chosen.excluded}
    asks = _Judge(chosen, asked)
    files = []
    for done, delivery in enumerate(subjects.files, 1):
        files.append((delivery, list(asks.file(delivery))))
        listener(done, len(subjects.files))
    common = list(asks.all(subjects))
    known = _Baseline(baseline)
    by_file = {str(delivery.path): delivery for delivery in subjects.files}
    for delivery, found in files:
        found += [f for f in common if f.file == str(delivery.path)]
    judged = tuple(
        JudgedFile(
            str(delivery.path),
            tuple((p.name, p.line) for p in delivery.performances),
            tuple(sorted(filter(known.is_new, found), key=_order)),
        )
        for delivery, found in files
    )
    rest = tuple(
        sorted((f for f in common if f.file not in by_file and known.is_new(f)), key=_order)
    )
    skipped = [Skipped(READABLE, str(path), "", reason) for path, reason in unread]
    return ValidationReport(
        chosen,
        tuple(sorted(asked)),
        judged,
        rest,
        (*skipped, *asks.skipped),
        tuple(known.accepted),
        fail_on,
    )


class _Judge:
    """Asks every check, and notes what could not be judged."""

    def __init__(self, profile: CheckProfile, checks: Mapping[str, DeliveryCheck]) -> None:
        self._profile, self._checks = profile, checks
        self.skipped: list[Skipped] = []

    def all(self, subjects: Deliveries) -> Iterator[Complaint]:
        """What is found of all files together."""
        for check in self._of("deliveries"):
            yield from self._ask(check, subjects, "", "", "")

    def file(self, delivery: Delivery) -> Iterator[Complaint]:
        """What is found of one file; if it cannot be read, that alone."""
        file = str(delivery.path)
        for check in self._of("delivery"):
            if delivery.character is None and check.id != READABLE:
                self.skipped.append(Skipped(check.id, file, "", "the file cannot be read"))
            else:
                yield from self._ask(check, delivery, file, "", "")
        for performance in delivery.performances:
            for check in self._of("performance"):
                yield from self._ask(check, performance, file, performance.line, performance.place)

    def _of(self, subject: str) -> Iterator[DeliveryCheck]:
        return (check for check in self._checks.values() if check.subject == subject)

    def _ask(
        self,
        check: DeliveryCheck,
        subject: Delivery | Performance | Deliveries,
        file: str,
        line: str,
        place: str,
    ) -> Iterator[Complaint]:
        try:
            found = list(check.run(subject, self._profile.limits_of(check)))
        except Skip as skip:
            self.skipped.append(Skipped(check.id, file, line, str(skip)))
            return
        except InputError as error:
            reason = f"{error.place}: {error.problem} [{error.code}]"
            self.skipped.append(Skipped(check.id, file, line, reason))
            return
        except Exception as error:  # noqa: BLE001  a check's own fault must not fail the asset
            yield Complaint(
                Severity.WARNING,
                FAILED,
                f"the check '{check.id}' failed: {type(error).__name__}: {error}",
                action="Please report it to whoever wrote the check; the asset is not at fault.",
                line=line,
                ours=True,
                check=check.id,
                file=file,
            )
            return
        for entry in found:
            if entry.code in self._profile.excluded:
                continue
            code = check.codes[entry.code]
            yield replace(
                entry,
                severity=self._profile.severities.get(entry.code, code.severity),
                action=entry.action or code.action,
                check=check.id,
                file=entry.file or file,
                line=entry.line or line,
                place=entry.place or place,
            )


class _Baseline:
    """Findings that are known, each as often as it was found then."""

    def __init__(self, known: Iterable[Mapping[str, Any]]) -> None:
        self._left = Counter(
            (f.get("file", ""), f["code"], f.get("line", ""), f.get("place", "")) for f in known
        )
        self.accepted: list[Complaint] = []

    def is_new(self, finding: Complaint) -> bool:
        """Whether a finding is not among the known; notes it if it is."""
        key = (finding.file, finding.code, finding.line, finding.place)
        if self._left[key] <= 0:
            return True
        self._left[key] -= 1
        self.accepted.append(finding)
        return False


def baseline_of(document: Mapping[str, Any]) -> list[Mapping[str, Any]]:
    """Every finding of a ``validation`` document, those that it accepted among them."""
    found = [*document["findings"], *document["accepted"]]
    return [*found, *(f for file in document["files"] for f in file["findings"])]


def _order(finding: Finding) -> tuple[Any, ...]:
    file = finding.file if isinstance(finding, Complaint) else ""
    return (-finding.severity, file, finding.line, finding.code, finding.place, finding.message)
