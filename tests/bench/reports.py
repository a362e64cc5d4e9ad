"""CPU time that the reports of a run take: ``python tests/bench/reports.py [LINES]``."""

from __future__ import annotations

import sys
import tempfile
import time
from pathlib import Path

from animeme.findings import Finding, LineResult, RunReport, Severity, status_of
from animeme_stages.report import json_report, junit, sarif, summary


def report_of(count: int) -> RunReport:
    """Lines of two languages, each with an info, every tenth with a warning, some with errors."""
    lines = []
    for number in range(count):
        key = f"{'en' if number % 2 else 'de'}/act1/line_{number:05}"
        severities = [Severity.INFO]
        severities += [Severity.WARNING] if number % 10 == 0 else []
        severities += [Severity.ERROR] if number % 500 == 0 else []
        findings = tuple(
            Finding(
                severity,
                "mouth-closed-late",
                "'p' of \"puppet\" <never> quite closes the lips",
                place=f"/data/dialogue/{key}.wav",
                action="Listen to it & look.",
                line=key,
                character="ada",
            )
            for severity in severities
        )
        outputs = (f"{key.partition('/')[0]}/ada/line_{number:05}.glb",)
        lines.append(LineResult(key, key[:2], "ada", 2.9, status_of(findings), findings, outputs))
    return RunReport("bench", tuple(lines), (), tuple(line.outputs[0] for line in lines))


def main() -> None:
    """Write them twice; the second time nothing has changed."""
    report = report_of(int(sys.argv[1]) if len(sys.argv) > 1 else 10_000)
    with tempfile.TemporaryDirectory() as folder:
        for turn in ("anew", "unchanged"):
            whole = time.process_time()
            for module in (json_report, junit, sarif, summary):
                started = time.process_time()
                path = module.write(report, Path(folder))
                took_s = time.process_time() - started
                print(f"{turn:<10} {path.name:<13} {took_s:.3f} s {path.stat().st_size:>10} bytes")
            print(f"{turn:<10} together      {time.process_time() - whole:.3f} s")


if __name__ == "__main__":
    main()
