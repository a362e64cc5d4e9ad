"""Check ``sync``."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from contextlib import suppress
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from animeme.contracts import Speech
from animeme.curves import Floats
from animeme.delivery import Code, Complaint, LimitSpec, Performance, Skip, complain
from animeme.errors import InputError
from animeme.findings import Severity
from animeme.phones import PhoneTrack
from animeme_stages.check.delivery.expected import (
    expected_opening,
    opening_by_rule,
    opening_of_models,
)
from animeme_stages.check.delivery.signals import frames_s, opening_at, speech_of, track_of
from animeme_stages.check.delivery.sound import (
    RATE_HZ,
    VOICED_DB,
    fit_of,
    level_db,
    without_posture,
)


class Sync:
    """The mouth opens when the sound says so."""

    id: ClassVar[str] = "sync"
    subject: ClassVar[str] = "performance"
    rationale: ClassVar[str] = (
        "Viewers notice sound that is 45 ms early or 125 ms late, and mind it at 90 and 185 ms; "
        "a line with another line's audio they notice at once."
    )
    source: ClassVar[str] = (
        "ITU-R BT.1359-1, figure 2; the lag and likeness of captured lips: tests/bench/sync.py"
    )
    codes: ClassVar[Mapping[str, Code]] = {
        "sync-lag": Code(
            Severity.WARNING,
            "The mouth moves too early or too late for its sound.",
            "Shift the animation by this much, or check where its recording starts.",
        ),
        "sync-unrelated": Code(
            Severity.WARNING,
            "The mouth does not move as the sound says.",
            "Check that this is the animation of this recording, and of its present take.",
        ),
    }
    limits: ClassVar[Mapping[str, LimitSpec]] = {
        "lag_s": LimitSpec(
            0.06, "largest lag, either way, seconds; 98 % of captured lines have less"
        ),
        "rival": LimitSpec(0.38, "how much a likeness at other lags tells against that at these"),
        "likeness": LimitSpec(
            0.46,
            "least likeness of the opening and what lips do at these sounds and phones, less what "
            "tells against it",
        ),
        "likeness_of_models": LimitSpec(0.48, "or of the opening and what models do at them"),
        "likeness_of_rules": LimitSpec(0.5, "or of the opening and what animators do at them"),
        "likeness_of_sound": LimitSpec(0.38, "the same where the phones are not known"),
        "usual_s": LimitSpec(
            2.2, "speech for which likenesses are meant, seconds; chance does less in more"
        ),
        "most_s": LimitSpec(0.4, "largest lag that is looked for, seconds"),
        "least_s": LimitSpec(0.8, "least speech that can be judged, seconds"),
    }

    def run(self, performance: Performance, limits: Mapping[str, Any]) -> Iterable[Complaint]:
        """Complain of a lag or, if nothing fits, of that."""
        speech = speech_of(performance)
        loud_s = loud_of(speech)
        if loud_s < limits["least_s"]:
            raise Skip(f"{loud_s:.1f} s of speech are too little to tell")
        at_s = frames_s(speech)
        moved = opening_at(performance, at_s)
        if np.ptp(moved) < 1e-3:
            raise Skip("the mouth does not move")
        found = verdict(moved, guesses(speech, _track_of(performance)), loud_s, limits)
        if found.passes:
            return
        if found.is_lag:
            when = "late" if found.lag_s > 0 else "early"
            said = f"the mouth is {abs(found.lag_s) * 1000:.0f} ms {when}"
            yield complain("sync-lag", f"{said} (likeness {found.likeness:.2f})")
        else:
            yield complain(
                "sync-unrelated",
                f"the mouth's opening and the sound have a likeness of {found.clear:.2f}, where "
                f"at least {found.least:.2f} is usual",
            )


@dataclass(frozen=True)
class Verdict:
    """How a mouth fits what is heard.

    Attributes:
        clear: likeness at small lags, less what tells against it.
        late: likeness at the best lag, less what tells against it.
        least: of either that passes.
        lag_s: the best lag; positive if the mouth is late.
        likeness: there.
    """

    clear: float
    late: float
    least: float
    lag_s: float
    likeness: float

    @property
    def passes(self) -> bool:
        """Whether it fits as it is."""
        return self.clear >= self.least

    @property
    def is_lag(self) -> bool:
        """Whether it would fit, were it shifted."""
        return not self.passes and self.late >= self.least


def verdict(
    moved: Floats, expected: Mapping[str, Floats], loud_s: float, limits: Mapping[str, Any]
) -> Verdict:
    """The most favourable verdict that any guess gives.

    Args:
        moved: opening at `RATE_HZ`, shape (F,).
        expected: name of a limit → guess that it is for, of F frames or fewer.
        loud_s: how much speech there is.
        limits: of `Sync`.
    """
    scale = min(1.0, float(np.sqrt(limits["usual_s"] / loud_s)))
    found = []
    for name, guess in expected.items():
        size = min(len(moved), len(guess))
        wanted = without_posture(guess[:size])
        fit = fit_of(without_posture(moved[:size]), wanted, limits["most_s"])
        near, rival = fit.best(limits["lag_s"])
        clear = near - limits["rival"] * rival
        late = fit.likeness - limits["rival"] * near
        found.append(Verdict(clear, late, scale * limits[name], fit.lag_s, fit.likeness))
    return max(found, key=lambda entry: max(entry.clear, entry.late) - entry.least)


def guesses(speech: Speech, track: PhoneTrack | None) -> dict[str, Floats]:
    """Name of a limit → how far the mouth should be open in each frame."""
    if track is None:
        return {"likeness_of_sound": expected_opening(speech)}
    expected = expected_opening(speech, track)
    size = len(expected)
    return {
        "likeness": expected,
        "likeness_of_models": opening_of_models(track, size),
        "likeness_of_rules": opening_by_rule(track, size),
    }


def loud_of(speech: Speech) -> float:
    """How much of a recording is speech, seconds."""
    return float((level_db(speech) > VOICED_DB).sum()) / RATE_HZ


def _track_of(performance: Performance) -> PhoneTrack | None:
    """The phones, None if the words are not known or do not fit the recording."""
    with suppress(InputError):
        return track_of(performance)
    return None
