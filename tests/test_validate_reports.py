"""What continuous integration is told, and the page of all checks."""

from __future__ import annotations

import json
import tomllib
from pathlib import Path
from xml.etree import ElementTree

import jsonschema
import pytest

import animeme_schemas
from animeme.check_catalogue import catalogue
from animeme.check_profiles import read_profile
from animeme.ci import Case
from animeme.findings import Finding, Severity
from animeme.validation import delivery_checks, rules, validate
from animeme_stages.report.junit import junit
from animeme_stages.report.sarif import sarif
from conftest import ROOT
from support.jobs import SAMPLE, animeme

BAD = Finding(Severity.ERROR, "line-bad", "is \x00 <bad>", place="a.wav", line="en/a")
DOUBT = Finding(Severity.WARNING, "line-odd", "is odd", line="en/a")
OURS = Finding(Severity.ERROR, "check-failed", "broke", ours=True)


def test_the_page_of_checks_is_current() -> None:
    page = (ROOT / "docs" / "checks.md").read_text(encoding="utf-8")
    assert page == catalogue(), "run python -m animeme.check_catalogue docs/checks.md"


def test_every_code_belongs_to_one_check() -> None:
    codes = [code for check in delivery_checks().values() for code in check.codes]
    assert len(set(codes)) == len(codes)


def test_the_profile_in_the_docs_can_be_used(tmp_path: Path) -> None:
    text = (ROOT / "docs" / "ci.md").read_text(encoding="utf-8")
    own = tmp_path / "own.toml"
    own.write_text(text.partition("```toml\n")[2].partition("```")[0], encoding="utf-8")
    jsonschema.validate(tomllib.loads(own.read_text()), animeme_schemas.load("check-profile"))
    profile = read_profile(str(own), delivery_checks())
    assert profile.lines == {"Take_017": "en/boat"}
    assert profile.limits_of(delivery_checks()["frame-rate"])["rate"] == "30"


def test_junit(tmp_path: Path) -> None:
    cases = [
        Case("a.glb", "en/a", (BAD, DOUBT)),
        Case("a.glb", "en/b", (DOUBT,)),
        Case("a.glb", "rate", skipped="nobody said"),
        Case("b.glb", "file", (OURS,)),
    ]
    junit(cases, tmp_path / "junit.xml", name="delivery")
    root = ElementTree.parse(tmp_path / "junit.xml").getroot()
    assert {k: root.get(k) for k in ("tests", "failures", "errors")} == {
        "tests": "4",
        "failures": "1",
        "errors": "1",
    }
    first, second = root.findall("testsuite")
    assert (first.get("tests"), first.get("failures"), first.get("skipped")) == ("3", "1", "1")
    failure = first.find("testcase/failure")
    assert failure is not None
    assert (failure.get("type"), failure.get("message")) == ("line-bad", "is \ufffd <bad>")
    assert "line-odd" in (first.findtext("testcase/system-out") or "")
    assert second.find("testcase/error") is not None
    junit(cases, tmp_path / "strict.xml", name="delivery", fail_on=Severity.WARNING)
    assert ElementTree.parse(tmp_path / "strict.xml").getroot().get("failures") == "2"


def test_sarif(tmp_path: Path) -> None:
    report = validate([SAMPLE / "crab.glb"])
    sarif([*report.all_findings, BAD], tmp_path / "a.sarif", rules=rules())
    document = json.loads((tmp_path / "a.sarif").read_text(encoding="utf-8"))
    assert document["version"] == "2.1.0"
    (run,) = document["runs"]
    listed = run["tool"]["driver"]["rules"]
    for result in run["results"]:
        assert listed[result["ruleIndex"]]["id"] == result["ruleId"]
        assert result["message"]["text"]
        location = result["locations"][0]["physicalLocation"]["artifactLocation"]
        assert location["uri"].endswith((".glb", ".wav"))
        assert result["partialFingerprints"]
    assert [result["level"] for result in run["results"]] == ["warning", "error"]


def test_the_command_writes_all_forms(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    ran = animeme(
        capsys, "validate", SAMPLE / "crab.glb", "--json",
        "--junit", tmp_path / "j.xml", "--sarif", tmp_path / "s.sarif",
    )  # fmt: skip
    assert ran.code == 0
    document = json.loads(ran.out)
    jsonschema.validate(document, animeme_schemas.load("validation"))
    assert document["files"][0]["findings"][0]["code"] == "rig-unknown"
    assert document["totals"]["warnings"] == 1
    assert ElementTree.parse(tmp_path / "j.xml").getroot().tag == "testsuites"
    assert json.loads((tmp_path / "s.sarif").read_text())["runs"][0]["results"]
