"""Timings that somebody has already made: used instead of aligning, and checked."""

from __future__ import annotations

from pathlib import Path

from animeme.contracts import Alignment, Speech
from animeme.findings import Finding, Severity
from animeme.phones import SILENCE
from animeme_stages.align.doubts import UNTRANSCRIBED_S, doubt, sound_in_pauses
from animeme_stages.align.interchange import read_timings, track_from


def read_alignment(path: Path, speech: Speech, *, language: str) -> Alignment:
    """The phone track in a file of timings.

    Args:
        path: the file, in any format that `read_timings` knows, with phones.
        speech: its recording; what is loud and in no phone is remarked on.
        language: BCP-47 tag.

    Raises:
        InputError: the file is damaged, has no phones, or goes on after the recording's end.
    """
    timings = read_timings(path)
    track = track_from(timings, language=language, duration_s=speech.duration_s, place=str(path))
    findings = [Finding(Severity.INFO, "timings-used", "its timings were given", place=str(path))]
    if any(phone.symbol != SILENCE for phone in track.phones):
        pause, length_s = sound_in_pauses(track, speech)
        if pause is not None and length_s >= UNTRANSCRIBED_S:
            between = f"between {pause.start_s:.1f} and {pause.end_s:.1f} s"
            findings.append(
                doubt("align-untranscribed", f"{length_s:.1f} s of sound {between} are in no word")
            )
    return Alignment(track, tuple(findings))
