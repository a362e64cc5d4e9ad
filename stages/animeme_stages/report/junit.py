"""Findings as JUnit XML, as Jenkins, GitLab and GitHub's test reporters take it.

One test suite per file, or per language and character of a run; one test case per thing that was
looked at. The form is that of Jenkins' xUnit schema (junit-10.xsd): a case has at most one
``failure``; further findings stand in its text.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Sequence
from html import escape  # that of xml.sax would bring http and ssl
from itertools import chain
from pathlib import Path

from animeme.ci import Case
from animeme.files import update_text
from animeme.findings import Finding, RunReport, Severity

# What XML 1.0 cannot say.
_UNSAYABLE = re.compile("[^\t\n\r\u0020-\ud7ff\ue000-\ufffd\U00010000-\U0010ffff]")
_PLAIN = re.compile(r"[\w /.,:;()'-]*")  # needs no second look: most names, of which there are many
_IN_TEXT = str.maketrans({"\r": "&#13;"})
_IN_ATTRIBUTES = str.maketrans({'"': "&quot;", "\n": "&#10;", "\r": "&#13;", "\t": "&#9;"})


def write(report: RunReport, output: Path) -> Path:
    """Write ``junit.xml`` of a run into its output folder and return its path."""
    path = output / "junit.xml"
    junit(_cases(report), path, name=report.job, fail_on=report.fail_on)
    return path


def _cases(report: RunReport) -> Iterator[Case]:
    """One for what concerns no line, then one per line and character."""
    yield Case("run", report.job, report.findings)
    for line in sorted(report.lines, key=lambda line: (line.language, line.character, line.line)):
        yield Case(f"{line.language}/{line.character}", line.line, line.findings)


def junit(
    cases: Iterable[Case], target: Path, *, name: str, fail_on: Severity = Severity.ERROR
) -> None:
    """Write cases to `target`, atomically.

    Args:
        cases: in the order in which they are shown; suites as they first occur. Names that a suite
            has twice are numbered.
        target: the file to write.
        name: of the whole.
        fail_on: findings from here on fail their case; lesser ones are its ``system-out``.
    """
    suites: dict[str, _Suite] = {}
    for case in cases:
        if case.suite not in suites:
            suites[case.suite] = _Suite(_attribute(case.suite), fail_on)
        suites[case.suite].add(case)
    total = [sum(counts) for counts in zip(*(s.counts for s in suites.values()), strict=True)]
    start = (
        '<?xml version="1.0" encoding="UTF-8"?>\n'
        f'<testsuites name="{_attribute(name)}"{_counted(total[:3] or [0, 0, 0])}>\n'
    )
    rows = chain.from_iterable(suite.rows() for suite in suites.values())
    update_text(target, chain([start], rows, ["</testsuites>\n"]))


class _Suite:
    """The cases of one suite, as text: there may be as many as lines.

    Args:
        label: its name, as an attribute.
        fail_on: as of `junit`.
    """

    def __init__(self, label: str, fail_on: Severity) -> None:
        self.counts = [0, 0, 0, 0]
        self._label = label
        self._fail_on = fail_on
        self._cases: list[str] = []
        self._used: dict[str, int] = {}

    def add(self, case: Case) -> None:
        """Take in a case."""
        self._used[case.name] = often = self._used.get(case.name, 0) + 1
        title = _attribute(case.name if often == 1 else f"{case.name} ({often})")
        shown = case.findings or case.skipped
        kind, content = _content(case, self._fail_on) if shown else ("", "")
        self.counts[0] += 1
        if kind:
            self.counts[("failure", "error", "skipped").index(kind) + 1] += 1
        inside = f">\n{content}  </testcase>\n" if content else " />\n"
        self._cases.append(f'name="{title}" time="0"{inside}')

    def rows(self) -> Iterator[str]:
        """The suite, in parts."""
        yield f' <testsuite name="{self._label}"{_counted(self.counts)}>\n'
        yield from (f'  <testcase classname="{self._label}" {case}' for case in self._cases)
        yield " </testsuite>\n"


def _counted(counts: Sequence[int]) -> str:
    names = ("tests", "failures", "errors", "skipped")
    said = "".join(f' {n}="{count}"' for n, count in zip(names, counts, strict=False))
    return f'{said} time="0"'


def _content(case: Case, fail_on: Severity) -> tuple[str, str]:
    """What a case has inside; first "failure", "error" (a fault of ours), "skipped" or ""."""
    bad = [finding for finding in case.findings if finding.severity >= fail_on]
    good = [finding for finding in case.findings if finding.severity < fail_on]
    kind = text = ""
    if bad:
        kind = "error" if all(finding.ours for finding in bad) else "failure"
        head = f'message="{_attribute(bad[0].message)}" type="{_attribute(bad[0].code)}"'
        text = f"   <{kind} {head}>{_lines(bad)}</{kind}>\n"
    elif case.skipped:
        kind = "skipped"
        text = f'   <{kind} message="{_attribute(case.skipped)}" />\n'
    if good:
        text += f"   <system-out>{_lines(good)}</system-out>\n"
    return kind, text


def _lines(findings: Iterable[Finding]) -> str:
    said = "\n".join(str(finding) for finding in findings)
    return _escaped(said).translate(_IN_TEXT)


def _attribute(text: str) -> str:
    if _PLAIN.fullmatch(text):
        return text
    return _escaped(text).translate(_IN_ATTRIBUTES)


def _escaped(text: str) -> str:
    return escape(_UNSAYABLE.sub("\ufffd", text), quote=False)
