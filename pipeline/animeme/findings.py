"""What a run has to say about a line, and how bad it is.

A fault that concerns one line is not an exception but a `Finding`; the batch goes on. Codes are
permanent: people write them into exclusion lists and CI rules.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import asdict, dataclass, field
from enum import IntEnum
from typing import Any, Literal

from animeme.errors import InputError

LineStatus = Literal["ok", "review", "failed"]


class Severity(IntEnum):
    """Ordered, so that ``--fail-on`` is a comparison."""

    INFO = 0
    WARNING = 1
    ERROR = 2

    @property
    def label(self) -> str:
        """The word used in documents and on the command line."""
        return self.name.lower()

    @classmethod
    def parse(cls, label: str) -> Severity:
        """The severity called `label`.

        Raises:
            ValueError: it is none of "info", "warning" and "error".
        """
        labels = {severity.label: severity for severity in cls}
        if label not in labels:
            raise ValueError(f"a severity is one of {', '.join(labels)}, not {label!r}")
        return labels[label]


@dataclass(frozen=True)
class Finding:
    """One remark about one line, character or file.

    Attributes:
        severity: an error fails the line, a warning marks it for review.
        code: permanent, lower-case, hyphenated.
        message: what was found, in a producer's words.
        place: file, JSON pointer, prim path or time, "" if the line itself says it all.
        action: what to do next.
        line: ``<language>/<line>`` the finding is about, "" for the whole run.
        character: the character it concerns, "" for all.
        ours: the fault is animeme's (or a plug-in's), not the input's.
    """

    severity: Severity
    code: str
    message: str
    place: str = ""
    action: str = ""
    line: str = ""
    character: str = ""
    ours: bool = False

    @classmethod
    def from_error(cls, error: InputError, *, line: str = "", character: str = "") -> Finding:
        """The finding that says what `error` says."""
        return cls(
            Severity.ERROR,
            error.code,
            error.problem,
            place=error.place,
            action=error.action,
            line=line,
            character=character,
        )

    def to_json(self) -> dict[str, Any]:
        """As in the ``report`` document: severity by name, empty fields kept."""
        return {**asdict(self), "severity": self.severity.label}

    def __str__(self) -> str:
        where = f" ({self.place})" if self.place else ""
        action = f" {self.action}" if self.action else ""
        return f"{self.severity.label} {self.code}: {self.message}{where}.{action}"


@dataclass(frozen=True)
class Complaint(Finding):
    """A finding about a delivered file.

    Attributes:
        check: id of the check that made it.
        file: the delivered file, as it was named.
        start_s, end_s: when, on the animation's own time axis; None where it is no matter of time.
    """

    check: str = ""
    file: str = ""
    start_s: float | None = None
    end_s: float | None = None

    def to_json(self) -> dict[str, Any]:
        """As in the ``validation`` document."""
        return {**asdict(self), "severity": self.severity.label}

    def __str__(self) -> str:
        when = "" if self.start_s is None else f" at {self.start_s:.2f} s"
        if self.start_s is not None and self.end_s is not None and self.end_s > self.start_s:
            when = f" from {self.start_s:.2f} to {self.end_s:.2f} s"
        where = f" ({self.place})" if self.place else ""
        action = f" {self.action}" if self.action else ""
        return f"{self.severity.label} {self.code}: {self.message}{when}{where}.{action}"


def status_of(findings: Iterable[Finding]) -> LineStatus:
    """The state a line ends in: failed on an error, review on a warning, else ok."""
    worst = max((finding.severity for finding in findings), default=Severity.INFO)
    return {Severity.INFO: "ok", Severity.WARNING: "review", Severity.ERROR: "failed"}[worst]  # type: ignore[return-value]


def exit_code_of(findings: Iterable[Finding], fail_on: Severity) -> int:
    """0 all well; 1 something is at or above `fail_on`; 3 a fault of ours among it."""
    bad = [finding for finding in findings if finding.severity >= fail_on]
    if any(finding.ours for finding in bad):
        return 3
    return 1 if bad else 0


@dataclass(frozen=True, slots=True)
class LineResult:
    """How one line of one character ended.

    Attributes:
        line: ``<language>/<line>``.
        language: BCP-47 tag.
        character: name in the job.
        audio_s: length of the recording in seconds, 0 where it could not be read.
        status: worst of its findings.
        findings: all of them.
        outputs: files that hold it, relative to the output folder.
    """

    line: str
    language: str
    character: str
    audio_s: float
    status: LineStatus
    findings: tuple[Finding, ...] = ()
    outputs: tuple[str, ...] = ()


@dataclass(frozen=True)
class Effort:
    """What a run had to do.

    Attributes:
        lines, files: how many there are to make.
        known_lines, known_files: how many of them were there already.
        step_s: step → CPU seconds that it took, over all workers.
        step_results: step → how many of its results were made, and how many found in the store.
    """

    lines: int = 0
    files: int = 0
    known_lines: int = 0
    known_files: int = 0
    step_s: Mapping[str, float] = field(default_factory=dict)
    step_results: Mapping[str, tuple[int, int]] = field(default_factory=dict)


@dataclass(frozen=True)
class RunReport:
    """The result of a run: every line's end and every finding.

    Attributes:
        job: the job's name.
        lines: sorted by character, language, line.
        findings: those that concern no single line.
        outputs: delivered asset files, relative to the output folder, sorted.
        fail_on: the severity at which the exit code turns 1.
        wall_s, cpu_s: the run's own time; not in ``report.json``, which repeats byte for byte.
        effort: what was done, and what an earlier run had done already; not in it either.
    """

    job: str
    lines: tuple[LineResult, ...]
    findings: tuple[Finding, ...] = ()
    outputs: tuple[str, ...] = ()
    fail_on: Severity = Severity.ERROR
    wall_s: float = field(default=0.0, compare=False)
    cpu_s: float = field(default=0.0, compare=False)
    effort: Effort = field(default_factory=Effort, compare=False)

    @property
    def audio_s(self) -> float:
        """Seconds of audio, each recording once, however many characters speak it."""
        if len({line.character for line in self.lines}) < 2:  # no line is there twice
            return sum(line.audio_s for line in self.lines)
        return sum({line.line: line.audio_s for line in self.lines}.values())

    @property
    def real_time_factor(self) -> float:
        """Seconds of audio per second of the run, 0 where that is not known."""
        return self.audio_s / self.wall_s if self.wall_s else 0.0

    def figures(self) -> dict[str, Any]:
        """What varies from run to run, for ``run.jsonl`` and ``--json``."""
        effort = asdict(self.effort)
        effort["step_results"] = {
            step: {"made": made, "found": found}
            for step, (made, found) in self.effort.step_results.items()
        }
        return {
            "wall_s": self.wall_s,
            "cpu_s": self.cpu_s,
            "real_time_factor": round(self.real_time_factor, 3),
            **effort,
        }

    @property
    def all_findings(self) -> tuple[Finding, ...]:
        """The run's own findings, then those of its lines."""
        return (*self.findings, *(f for line in self.lines for f in line.findings))

    @property
    def exit_code(self) -> int:
        """0 all well; 1 something is at or above `fail_on`; 3 a fault of ours among it."""
        return exit_code_of(self.all_findings, self.fail_on)

    def count(self, status: LineStatus, *, character: str = "", language: str = "") -> int:
        """How many lines ended as `status`, of all or of one character or language."""
        return sum(
            line.status == status
            and line.character == (character or line.character)
            and line.language == (language or line.language)
            for line in self.lines
        )
