"""Checks of lines, of written files and of deliveries: a run depends on those that it asks."""

from __future__ import annotations

import json
import os
from pathlib import Path

import pytest

from support.jobs import SmallJob, console, small_job
from support.stores import made, written
from test_worker_death import studio

CHECK = '''
from animeme.findings import Finding, Severity


class Says:
    """Remarks that it was asked."""

    id = "studio-{subject}"
    subject = "{subject}"
    rationale = "The studio wants to know that it was asked."
    source = "the studio's own wishes"
    codes, limits = {{}}, {{}}

    def run(self, subject, limits=None):
        yield Finding(Severity.INFO, "studio-{subject}", "{said}")
'''
GROUPS = {"line": "line_checks", "asset": "asset_checks", "delivery": "delivery_checks"}
FILE = "en/crab.glb"


def check(subject: str, said: str = "one") -> str:
    return CHECK.format(subject=subject, said=said)


def site(folder: Path, groups: dict[str, str]) -> dict[str, str]:
    """Install a check per subject, each under a group; gives the environment that finds them."""
    entry_points = "".join(
        f"[animeme.{group}]\nstudio-{subject} = studio_{subject}:Says\n"
        for subject, group in groups.items()
    )
    modules = {f"studio_{subject}": check(subject) for subject in groups}
    studio(folder, "studio-checks", entry_points, modules)
    path = [str(folder), *filter(None, [os.environ.get("PYTHONPATH")])]
    return {"PYTHONPATH": os.pathsep.join(path)}


@pytest.mark.slow
def test_a_change_of_a_check_does_again_what_it_judged_and_nothing_else(tmp_path: Path) -> None:
    env = site(tmp_path / "site", GROUPS)
    job = small_job(tmp_path / "job")
    job.timed_line()
    file = job.write()

    def run() -> tuple[set[str], set[str]]:
        ran = console("run", file, "--executor", "inline", env=env)
        assert ran.code == 0, ran.err
        return made(job)["en/boat"], written(job)

    assert run() == ({"align", "synthesize", "retarget"}, {FILE})
    assert said(job) == {"studio-line": "one", "studio-asset": "one"}
    assert run() == (set(), set())

    (tmp_path / "site" / "studio_delivery.py").write_text(check("delivery", "two"))
    assert run() == (set(), set())

    (tmp_path / "site" / "studio_line.py").write_text(check("line", "two"))
    assert run() == ({"retarget"}, set())  # the same curves, so the file is as it was
    assert said(job) == {"studio-line": "two", "studio-asset": "one"}

    (tmp_path / "site" / "studio_asset.py").write_text(check("asset", "two"))
    assert run() == (set(), {FILE})
    assert said(job) == {"studio-line": "two", "studio-asset": "two"}


def said(job: SmallJob) -> dict[str, str]:
    """Code → message of what the studio's checks found in the last run."""
    report = job.report()
    found = [*report["findings"], *(f for line in report["lines"] for f in line["findings"])]
    return {f["code"]: f["message"] for f in found if f["code"].startswith("studio-")}


def test_a_check_that_its_group_has_no_use_for_is_refused(tmp_path: Path) -> None:
    groups = {"line": "delivery_checks", "asset": "asset_checks", "delivery": "checks"}
    env = site(tmp_path / "site", groups)
    ran = console("doctor", "--json", env=env)
    assert ran.code == 3
    problems = {plugin["name"]: plugin["problem"] for plugin in json.loads(ran.out)["plugins"]}
    assert "'line'" in problems["studio-line"]
    assert "no such group" in problems["studio-delivery"]
    assert problems["studio-asset"] == ""
    ran = console("validate", "--list-checks", env=env)
    assert ran.code == 2
    ran.says("studio-line", "studio-checks", "'line'", "Register it under animeme.line_checks.")
