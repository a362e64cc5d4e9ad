"""Findings as JUnit XML, as Jenkins, GitLab and GitHub's test reporters take it.

One test suite per file, one test case per thing that was looked at. The form is that of Jenkins'
xUnit schema (junit-10.xsd): a case has at most one ``failure``; further findings stand in its text.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence
from pathlib import Path
from xml.etree import ElementTree as Xml

from animeme.ci import Case
from animeme.files import write_text
from animeme.findings import Severity

# What XML 1.0 cannot say.
_UNSAYABLE = re.compile("[^\t\n\r\u0020-\ud7ff\ue000-\ufffd\U00010000-\U0010ffff]")


def junit(
    cases: Iterable[Case], target: Path, *, name: str, fail_on: Severity = Severity.ERROR
) -> None:
    """Write cases to `target`, atomically.

    Args:
        cases: in the order in which they are shown.
        target: the file to write.
        name: of the whole.
        fail_on: findings from here on fail their case; lesser ones are its ``system-out``.
    """
    suites: dict[str, list[Case]] = {}
    for case in cases:
        suites.setdefault(case.suite, []).append(case)
    root = Xml.Element("testsuites", name=_said(name))
    total = [0, 0, 0, 0]
    for suite, inside in suites.items():
        element = Xml.SubElement(root, "testsuite", name=_said(suite))
        counts = [len(inside), 0, 0, 0]
        for case in inside:
            kind = _case(element, case, fail_on)
            counts[1] += kind == "failure"
            counts[2] += kind == "error"
            counts[3] += kind == "skipped"
        _count(element, counts)
        total = [a + b for a, b in zip(total, counts, strict=True)]
    _count(root, total[:3])
    Xml.indent(root)
    text = Xml.tostring(root, encoding="unicode")
    write_text(target, f'<?xml version="1.0" encoding="UTF-8"?>\n{text}\n')


def _count(element: Xml.Element, counts: Sequence[int]) -> None:
    names = ("tests", "failures", "errors", "skipped")
    for name, count in zip(names, counts, strict=False):
        element.set(name, str(count))
    element.set("time", "0")


def _case(suite: Xml.Element, case: Case, fail_on: Severity) -> str:
    """Add a case; gives "failure", "error" (a fault of ours), "skipped" or ""."""
    element = Xml.SubElement(
        suite, "testcase", classname=suite.get("name", ""), name=_said(case.name), time="0"
    )
    bad = [finding for finding in case.findings if finding.severity >= fail_on]
    good = [finding for finding in case.findings if finding.severity < fail_on]
    kind = ""
    if bad:
        kind = "error" if all(finding.ours for finding in bad) else "failure"
        worst = bad[0]
        child = Xml.SubElement(element, kind, message=_said(worst.message), type=worst.code)
        child.text = _said("\n".join(str(finding) for finding in bad))
    elif case.skipped:
        kind = "skipped"
        Xml.SubElement(element, kind, message=_said(case.skipped))
    if good:
        said = "\n".join(str(finding) for finding in good)
        Xml.SubElement(element, "system-out").text = _said(said)
    return kind


def _said(text: str) -> str:
    return _UNSAYABLE.sub("\ufffd", text)
