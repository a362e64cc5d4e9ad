"""Check ``bilabials-close``."""

from __future__ import annotations

from collections.abc import Iterable
from typing import ClassVar, Literal

import numpy as np

from animeme.contracts import LineSubject
from animeme.findings import Finding, Severity
from animeme_stages.check.opening import opening

# On the ICT head jawOpen 0.05 parts the lips by 1 mm; what is below cannot be seen.
CLOSED_BELOW = 0.05
# A closure may be a frame early or late of its phone, as hearers do not notice it.
TOLERANCE_S = 0.02


class BilabialsClose:
    """/p b m/ bring the lips together."""

    id: ClassVar[str] = "bilabials-close"
    subject: ClassVar[Literal["line", "asset"]] = "line"
    rationale: ClassVar[str] = (
        "Viewers notice an open mouth during p, b or m at once (Albrecht et al. 2002, section 3.2)."
    )

    def run(self, subject: LineSubject) -> Iterable[Finding]:
        """Warn once, of all bilabials during which the mouth stays open."""
        opened = opening(subject)
        if opened is None:
            return
        open_ones = []
        for symbol, phone in zip(subject.track.ipa(), subject.track.phones, strict=True):
            if symbol in ("p", "b", "m"):
                at_s = np.linspace(phone.start_s - TOLERANCE_S, phone.end_s + TOLERANCE_S, 16)
                least = float(np.interp(at_s, subject.shapes.times_s, opened).min())
                if least > CLOSED_BELOW:
                    open_ones.append((least, symbol, phone))
        if open_ones:
            least, symbol, phone = max(open_ones, key=lambda entry: entry[0])
            yield Finding(
                Severity.WARNING,
                "bilabial-open",
                f"the mouth stays open during {len(open_ones)} of /p b m/, most during /{symbol}/ "
                f"({least:.2f} of jawOpen)",
                place=f"{phone.start_s:.2f}–{phone.end_s:.2f} s",
                action="Check that the rig profile drives jawOpen and mouthClose rightly, and "
                "that the rig rests with its mouth shut.",
            )
