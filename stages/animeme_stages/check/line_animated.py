"""Check ``line-animated``."""

from __future__ import annotations

from collections.abc import Iterable
from typing import ClassVar, Literal

import numpy as np

from animeme.contracts import AssetSubject, LineAnimation
from animeme.curves import CurveSet
from animeme.findings import Finding, Severity

# Files hold float32: weights to 6e-8, times of a long line to 3e-5 s at up to 20 weight units/s.
FLOAT_ERROR = 1e-3


class LineAnimated:
    """Every line is in the file, with the weights that were meant."""

    id: ClassVar[str] = "line-animated"
    subject: ClassVar[Literal["line", "asset"]] = "asset"
    rationale: ClassVar[str] = (
        "What was written is read back: a file that looks right may play wrong."
    )

    def run(self, subject: AssetSubject) -> Iterable[Finding]:
        """Report an error for each line that is missing or differs."""
        found = subject.format.read_animations(subject.output)
        for line in subject.lines:
            # Where somebody else's animation has the line's name, ours has its language too.
            names = (line.name, f"{line.name}_{line.language}", f"{line.name}_{line.language}_2")
            problems = [_difference(line, found[name]) for name in names if name in found]
            if not problems:
                problem = "its animation is not in the file"
                yield _finding("animation-missing", line, problem, subject)
            elif all(problems):
                yield _finding("animation-differs", line, problems[0], subject)


def _difference(line: LineAnimation, animation: CurveSet) -> str:
    """What differs between a line and the animation read back, "" if nothing does."""
    lacking = [name for name in line.curves.names if name not in animation.names]
    if lacking:
        return f"the file lacks the shapes {', '.join(lacking)}"
    columns = [animation.names.index(name) for name in line.curves.names]
    written = animation.sample(line.curves.times_s)[:, columns]
    error = np.abs(written - line.curves.weights).max(initial=0.0)
    if error > FLOAT_ERROR:
        return f"weights differ by up to {error:.4f}"
    if abs(animation.duration_s - line.curves.duration_s) > FLOAT_ERROR:
        return f"it ends at {animation.duration_s:.3f} s, not at {line.curves.duration_s:.3f} s"
    return ""


def _finding(code: str, line: LineAnimation, problem: str, subject: AssetSubject) -> Finding:
    return Finding(
        Severity.ERROR,
        code,
        problem,
        place=str(subject.output),
        action="Do not use this file; please report it.",
        line=line.name,
        ours=True,
    )
