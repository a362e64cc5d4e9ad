"""Bad input, from outside: what people are told of it, and that it works once mended."""

from __future__ import annotations

from support.jobs import Ran, SmallJob

GOOD, BAD = "en/boat", "en/five"


def expect_success(job: SmallJob, ran: Ran) -> None:
    assert ran.code == 0, ran.err
    assert set(job.statuses().values()) == {"ok"}


def expect_refused(job: SmallJob, ran: Ran, *words: str) -> None:
    """Nothing could be done, nothing was written, and the message says all of `words`."""
    ran.says(*words)
    assert ran.code == 2
    assert ran.out == ""
    assert not job.output.exists()
