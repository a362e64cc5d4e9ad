"""What runs took up from the store, and what they made anew."""

from __future__ import annotations

import json
from typing import Any

from support.jobs import Capture, SmallJob, animeme, digests
from support.schemas import validate

EVERY_STEP = {"align", "synthesize", "retarget"}


def made(job: SmallJob) -> dict[str, set[str]]:
    """Line → the steps that were not taken from the store, in the last run."""
    return {
        event["line"]: set() if event["outcome"] in ("known", "outdated") else set(event["made"])
        for event in job.log()
        if event["event"] == "line"
    }


def written(job: SmallJob) -> set[str]:
    """Files that the last run wrote anew."""
    return {
        event["output"]
        for event in job.log()
        if event["event"] == "asset" and event["outcome"] != "known"
    }


def results(job: SmallJob) -> dict[str, str]:
    """SHA-256 of every file that a run leaves, but for its log."""
    found = digests(job.output)
    del found["run.jsonl"]
    return found


def rehearsed(capsys: Capture, job: SmallJob, *options: object) -> dict[str, Any]:
    """What a dry run says, which changes nothing."""
    file = job.write()
    before = digests(job.folder)
    ran = animeme(capsys, "run", file, "--dry-run", "--json", *options)
    assert ran.code == 0, ran.err
    assert digests(job.folder) == before
    document: dict[str, Any] = json.loads(ran.out)
    validate("rehearsal", document)
    return document
