"""Strange recordings, noise, music and silence, all the way to an alignment: none passes unmarked.

Each is given a transcript that is not in it. What comes out is a refusal, or a track with at least
one finding that asks for a person.
"""

from __future__ import annotations

from importlib.util import find_spec
from pathlib import Path

import numpy as np
import pytest
import soundfile

from animeme import align
from animeme.errors import InputError
from animeme.findings import Finding, Severity
from animeme.phones import PhoneTrack
from support.sounds import RATE_HZ, SOUNDS

TEXT = "The old boat left the harbour before the sun came up."

# What each file must at least be marked with by its reader, "" where it is a sound recording and
# only the transcript is wrong. The aligner may refuse it altogether, or doubt it as well.
VIDEO = bool(find_spec("av"))
NARROW = "audio-narrowband"
EXPECTED: dict[str, str] = {
    "16-bit-8kHz-noBext-mono.wav": "audio-no-speech",  # beeps
    "16bit-16kHz-2markers-mono.wav": "",
    "16bit-16kHz-markers-mono.wav": "",
    "16bit-8kHz-1c-reaper-region.wav": "audio-silent",
    "16bit-8kHz-1c-reaper-utf8cue-issue13.wav": "audio-silent",
    "16bit-8kHz-1c-reaper-utf8cue.wav": "audio-silent",
    "16bit-8khz-bext-mono.wav": NARROW,
    "16bit-9khz-1c-1region-reaper.wav": "audio-silent",
    "27bit-8kHz-noBext-mono.wav": "audio-no-speech",
    "32bit-48kHz-noBext-mono.wav": "audio-no-speech",
    "32bitIEEE-16kHz-bext-mono.wav": "audio-no-speech",
    "4-bit-imaadpcm-8kHz-noBext-mono-reaper.wav": NARROW,
    "4bit-imaadpcm-8kHz-noBext-mono-encoded.wav": NARROW,
    "4bit-imaadpcm-8kHz-noBext-mono.wav": NARROW,
    "8bit-16kHz-bext-mono.wav": "",
    "8bit-alaw-8kHz-noBext-mono-encoded.wav": NARROW,
    "8bit-mulaw-8kHz-noBext-mono-encoded.wav": NARROW,
    "Audacity-16bit.wav": "audio-voices",
    "LICENSE.aeneas": "audio-unreadable",
    "LICENSE.wavefile": "audio-unreadable",
    "M1F1-int12WE-AFsp-NEW-TAGS.wav": "audio-voices",
    "M1F1-int12WE-AFsp.wav": "audio-voices",
    "RIFX-16bit-mono.wav": "audio-no-speech",
    "ima22m.wav": "",
    "mono.empty.wav": "audio-empty",
    "mono.invalid.wav": "audio-unreadable",
    "mono.zero.wav": "audio-empty",
    "p001.aiff": "audio-channels",
    "p001.mp3": "audio-channels",
    "p001.mp4": "audio-channels" if VIDEO else "extra-missing",
    "p001.ogg": "audio-channels",
    "test-1234Hz-le-1ch-10S-20bit-extra.wav": "audio-too-short",
    "test-44100Hz-2ch-32bit-float-le.wav": "audio-too-short",
    "test-44100Hz-le-1ch-4bytes-early-eof-no-data.wav": "audio-unreadable",
    "test-44100Hz-le-1ch-4bytes-incomplete-chunk.wav": "audio-unreadable",
    "test-44100Hz-le-1ch-4bytes.wav": "",
    "test-8000Hz-be-3ch-5S-24bit.wav": "audio-too-short",
    "test-8000Hz-le-2ch-1byteu.wav": NARROW,
    "test-8000Hz-le-3ch-5S-24bit-rf64.wav": "audio-too-short",
    "test-8000Hz-le-3ch-5S-36bit.wav": "audio-unreadable",
    "test-8000Hz-le-3ch-5S-53bit.wav": "audio-unreadable",
    "test-8000Hz-le-4ch-9S-12bit.wav": "audio-too-short",
    "test-cue-reaper.wav": "audio-silent",
}
REFUSALS = {"audio-silent", "audio-unreadable", "audio-empty", "audio-too-short", "extra-missing"}


def outcome(path: Path, text: str = TEXT) -> tuple[PhoneTrack | None, tuple[Finding, ...]]:
    """The track and findings, or no track and the refusal as a finding."""
    try:
        alignment = align(path, text, language="en")
    except InputError as error:
        return None, (Finding.from_error(error),)
    return alignment.track, alignment.findings


def require_marked(found: tuple[Finding, ...], expected: str) -> None:
    """At least a warning; `expected` among the codes, unless the aligner refused the line."""
    assert any(finding.severity >= Severity.WARNING for finding in found)
    assert all(finding.message for finding in found)
    assert all(f.action for f in found if f.severity >= Severity.WARNING)
    codes = {finding.code for finding in found}
    aligner_refused = len(found) == 1 and found[0].code.startswith(("align-", "transcript-"))
    assert aligner_refused or not expected or expected in codes


def test_the_list_has_every_odd_file(shared: Path) -> None:
    assert sorted(p.name for p in (shared / "data" / "odd-audio").iterdir()) == sorted(EXPECTED)


@pytest.mark.parametrize("name", EXPECTED)
def test_no_odd_file_passes_with_a_foreign_transcript(name: str, shared: Path) -> None:
    track, found = outcome(shared / "data" / "odd-audio" / name)
    require_marked(found, EXPECTED[name])
    if EXPECTED[name] in REFUSALS:
        assert track is None
        assert [finding.code for finding in found] == [EXPECTED[name]]


def test_one_recording_ends_alike_in_every_encoding(shared: Path) -> None:
    names = [name for name in EXPECTED if name.startswith("p001") and (VIDEO or "mp4" not in name)]
    outcomes = [outcome(shared / "data" / "odd-audio" / name, "One.") for name in names]
    assert len({tuple(finding.code for finding in found) for _, found in outcomes}) == 1
    starts = [track.words[0].start_s for track, _ in outcomes if track is not None]
    assert len(starts) in (0, len(names))
    assert max(starts, default=0.0) - min(starts, default=0.0) < 0.05


# Made here


@pytest.mark.parametrize("name", SOUNDS)
def test_no_noise_passes(name: str, tmp_path: Path) -> None:
    path = tmp_path / "a.wav"
    soundfile.write(path, SOUNDS[name](), RATE_HZ)
    _, found = outcome(path)
    require_marked(found, "audio-no-speech")


@pytest.mark.parametrize("level", [0.0, 0.5, 1e-5])
def test_no_silence_passes(level: float, tmp_path: Path) -> None:
    path = tmp_path / "a.wav"
    soundfile.write(path, np.full(3 * RATE_HZ, level), RATE_HZ, "FLOAT")
    track, found = outcome(path)
    assert track is None
    assert [finding.code for finding in found] == ["audio-silent"]
