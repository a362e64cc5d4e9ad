"""What a run leaves for people and for continuous integration."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import pytest

from animeme.cli import running
from animeme.findings import Finding, LineResult, RunReport, Severity, status_of
from animeme_stages.report import json_report, junit, sarif, summary
from support.jobs import Capture, run_inline, small_job
from support.schemas import validate

INFO = Finding(Severity.INFO, "line-quiet", "is quiet", place="0.50–0.61 s")
DOUBT = Finding(Severity.WARNING, "line-odd", 'says "ö" & <b>\x07', place="vo/a.wav", action="Ask.")
BAD = Finding(Severity.ERROR, "audio-missing", "there is no recording", place="/vo/ä b.wav")
GENERAL = Finding(Severity.WARNING, "output-stale", "is from an earlier run", place="en/eve.glb")


def line(key: str, character: str, *findings: Finding) -> LineResult:
    own = tuple(replace(f, line=key, character=character) for f in findings)
    output = (f"{key[:2]}/{character}.glb",)
    return LineResult(key, key[:2], character, 1.25, status_of(own), own, output)


REPORT = RunReport(
    "night",
    (
        line("de/a", "ada", INFO),
        line("en/a", "ada", DOUBT),
        line("en/b", "ada", DOUBT, DOUBT),
        line("en/b", "ada"),
        line("en/a", "bob", BAD),
        line("en/c", "bob"),
    ),
    (GENERAL,),
    ("de/ada.glb", "en/ada.glb", "en/bob.glb"),
)


def test_report_json(tmp_path: Path) -> None:
    text = json_report.write(REPORT, tmp_path).read_text(encoding="utf-8")
    document = json.loads(text)
    validate("report", document)
    for entry, told in zip(document["lines"], REPORT.lines, strict=True):
        assert entry["findings"] == [finding.to_json() for finding in told.findings]
        assert entry["outputs"] == list(told.outputs)
    assert document["findings"] == [GENERAL.to_json()]
    assert document["totals"]["ada"] == {"ok": 2, "review": 2, "failed": 0}
    assert document["languages"]["en"] == {"ok": 2, "review": 2, "failed": 1}
    assert document["audio_s"] == 5.0  # four recordings, of which two are spoken twice
    rows = [row for row in text.splitlines() if row.startswith('  {"line"')]
    assert len(rows) == len(REPORT.lines)


def test_junit_has_a_suite_per_language_and_character(tmp_path: Path) -> None:
    root = ElementTree.parse(junit.write(REPORT, tmp_path)).getroot()
    suites = {suite.get("name"): suite for suite in root}
    assert list(suites) == ["run", "de/ada", "en/ada", "en/bob"]
    cases = [(case.get("classname"), case.get("name")) for case in root.iter("testcase")]
    assert len(set(cases)) == len(cases) == len(REPORT.lines) + 1
    assert (root.get("tests"), root.get("failures")) == ("7", "1")
    failure = suites["en/bob"].find("testcase/failure")
    assert failure is not None
    assert failure.get("type") == "audio-missing"
    said = suites["en/ada"].findtext("testcase/system-out") or ""
    assert 'says "ö" & <b>\ufffd' in said
    strict = junit.write(replace(REPORT, fail_on=Severity.WARNING), tmp_path)
    assert ElementTree.parse(strict).getroot().get("failures") == "4"


def test_sarif_points_at_files(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (run,) = json.loads(sarif.write(REPORT, tmp_path).read_text(encoding="utf-8"))["runs"]
    rules = [rule["id"] for rule in run["tool"]["driver"]["rules"]]
    found = [(rules[result["ruleIndex"]], result) for result in run["results"]]
    assert [code for code, _ in found] == [f.code for f in REPORT.all_findings]

    def places(code: str) -> list[Any]:
        locations = [result["locations"][0] for own, result in found if own == code]
        return [place["physicalLocation"]["artifactLocation"]["uri"] for place in locations]

    assert places("output-stale") == ["en/eve.glb"]
    assert places("line-quiet") == ["de/ada.glb"], "it names a time, and no file"
    assert places("audio-missing") == ["file:///vo/%C3%A4%20b.wav"]
    assert len({result["partialFingerprints"]["animeme/v1"] for _, result in found}) == 5

    monkeypatch.setattr(sarif, "MOST_RESULTS", 2)
    (run,) = json.loads(sarif.write(REPORT, tmp_path).read_text(encoding="utf-8"))["runs"]
    assert [result["level"] for result in run["results"]] == ["error", "warning"]
    assert "4 findings" in json.dumps(run["invocations"])


def test_the_summary_has_the_worst_first_and_all_totals(tmp_path: Path) -> None:
    text = summary.write(REPORT, tmp_path).read_text(encoding="utf-8")
    assert "| **en** | all | 5 | 2 | 2 | 1 | 3.8 s |" in text
    assert "| all | **bob** | 2 | 1 | 0 | 1 | 2.5 s |" in text
    assert "| **all** |  | 6 | 3 | 2 | 1 | 5.0 s |" in text
    places = [text.index(f"**{who}**: ") for who in ("run", "en/a bob", "en/b ada", "en/a ada")]
    assert places == sorted(places)


def test_a_report_that_says_the_same_is_left_alone(tmp_path: Path) -> None:
    def write(report: RunReport) -> list[int]:
        paths = [m.write(report, tmp_path) for m in (json_report, junit, sarif, summary)]
        return [path.stat().st_mtime_ns for path in paths]

    first = write(REPORT)
    assert write(REPORT) == first
    other = write(replace(REPORT, lines=REPORT.lines[1:]))
    assert all(new != old for new, old in zip(other, first, strict=True))


def test_figures_of_a_run_and_its_summary_for_github(
    tmp_path: Path, capsys: Capture, monkeypatch: pytest.MonkeyPatch
) -> None:
    page = tmp_path / "step.md"
    page.write_text("# What the step said before\n", encoding="utf-8")
    monkeypatch.setenv("GITHUB_STEP_SUMMARY", str(page))
    job = small_job(tmp_path / "job", "en/boat")
    ran = run_inline(capsys, job, "--json")
    assert ran.code == 0
    text = page.read_text(encoding="utf-8")
    assert text.startswith("# What the step said before\n# small\n")
    assert "times real time" in text
    end = job.log()[-1]
    assert end["step_results"]["align"] == {"made": 1, "found": 0}
    told = json.loads(ran.out)
    for name in ("real_time_factor", "step_s", "step_results", "known_lines", "known_files"):
        assert told[name] == end[name]
    names = {"report.json", "summary.md", "junit.xml", "report.sarif", "run.jsonl"}
    assert names <= {path.name for path in job.output.iterdir()}


def test_github_is_not_told_more_than_it_takes(
    tmp_path: Path, capsys: Capture, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(running, "MOST_STEP_SUMMARY_BYTES", 200)
    page = tmp_path / "step.md"
    running._add_to_step(page, "- füńf\n" * 100)
    text = page.read_bytes().decode()
    assert len(text.encode()) <= 200
    assert text.count("- füńf\n") > 5
    assert "summary.md" in text
    running._add_to_step(page, "- füńf\n" * 100)
    assert page.read_bytes().decode() == text, "there was no more room"
    running._add_to_step(tmp_path / "no folder" / "step.md", "x")
    assert "cannot be written" in capsys.readouterr().err
