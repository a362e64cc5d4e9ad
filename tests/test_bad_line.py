"""One bad line: it fails alone, and works once mended."""

from __future__ import annotations

import os
import shutil
import struct
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest
import soundfile

from support.bad_input import BAD, GOOD, expect_success
from support.jobs import Capture, SmallJob, run_inline

RATE_HZ = 16_000


@dataclass(frozen=True)
class BadLine:
    """One way to break a line, and what must be said about it.

    Attributes:
        id: of the case.
        spoil: does it, given the line's recording.
        code: of the finding.
        words: what, where and what to do, in the message.
    """

    id: str
    spoil: Callable[[Path], object]
    code: str
    words: tuple[str, ...]


def _text(content: bytes) -> Callable[[Path], object]:
    return lambda audio: audio.with_suffix(".txt").write_bytes(content)


def _bytes(content: bytes) -> Callable[[Path], object]:
    return lambda audio: audio.write_bytes(content)


def _cut(share: float) -> Callable[[Path], object]:
    def cut(audio: Path) -> None:
        data = audio.read_bytes()
        audio.write_bytes(data[: int(len(data) * share)])

    return cut


def _samples(count: int, level: float) -> Callable[[Path], object]:
    return lambda audio: soundfile.write(audio, np.full(count, level, np.float32), RATE_HZ, "FLOAT")


def _cut_flac(audio: Path) -> None:
    samples, rate_hz = soundfile.read(audio)
    flac = audio.with_suffix(".flac")
    soundfile.write(flac, samples, rate_hz)
    audio.unlink()
    _cut(0.5)(flac)


def _second_recording(audio: Path) -> None:
    samples, rate_hz = soundfile.read(audio)
    soundfile.write(audio.with_suffix(".flac"), samples, rate_hz)


def _second_transcript(audio: Path) -> None:
    shutil.copy(audio.with_suffix(".txt"), audio.with_suffix(".lab"))


BAD_LINES = (
    BadLine(
        "no-transcript",
        lambda audio: audio.with_suffix(".txt").unlink(),
        "transcript-missing",
        ("has no transcript", "five.txt", "Write what is said"),
    ),
    BadLine(
        "no-recording", Path.unlink, "audio-missing", ("no such recording", "five.wav", "Deliver")
    ),
    BadLine("empty-text", _text(b""), "transcript-empty", ("empty", "five.txt", "Write what")),
    BadLine("blank-text", _text(b" \r\n\t"), "transcript-empty", ("empty", "five.txt")),
    BadLine("bom-only", _text(b"\xef\xbb\xbf"), "transcript-empty", ("empty", "five.txt")),
    BadLine(
        "punctuation", _text("… — ?! «»".encode()), "transcript-empty", ("no word", "Write what")
    ),
    BadLine("tags", _text(b"<sigh> [laughs]"), "transcript-empty", ("no word", "Write what")),
    BadLine(
        "latin-1",
        _text("Fünf große Bäume".encode("latin-1")),
        "transcript-unreadable",
        ("not UTF-8", "byte 1", "five.txt", "Save it as UTF-8"),
    ),
    BadLine(
        "binary-text", _text(bytes(range(256))), "transcript-unreadable", ("five.txt", "UTF-8")
    ),
    BadLine("zero-bytes", _bytes(b""), "audio-empty", ("no samples", "five.wav", "Export")),
    BadLine(
        "header-only", lambda a: _bytes(_header(a))(a), "audio-empty", ("no samples", "Export")
    ),
    BadLine("cut-header", _bytes(b"RIFF\x00\x00"), "audio-unreadable", ("five.wav", "Export")),
    BadLine("cut-half", _cut(0.5), "audio-truncated", ("cut off", "five.wav", "Copy or export")),
    BadLine("cut-last-byte", _cut(0.9999), "audio-truncated", ("cut off", "five.wav")),
    BadLine("cut-flac", _cut_flac, "audio-", ("five.flac", "xport")),
    BadLine("silent", _samples(RATE_HZ, 0.0), "audio-silent", ("silent", "five.wav", "level")),
    BadLine("too-short", _samples(RATE_HZ // 20, 0.5), "audio-too-short", ("50 ms", "five.wav")),
    BadLine("one-sample", _samples(1, 0.5), "audio-too-short", ("0 ms", "five.wav", "export")),
    BadLine("not-numbers", _samples(RATE_HZ, np.nan), "audio-unreadable", ("not numbers",)),
    BadLine(
        "text-as-wav",
        _bytes(b"Five little fishes, and not a sound.\n"),
        "audio-unreadable",
        ("cannot be decoded", "five.wav", "WAV or FLAC"),
    ),
    BadLine(
        "two-recordings",
        _second_recording,
        "line-duplicate",
        ("2 recordings", "five.flac", "five.wav", "Keep one"),
    ),
    BadLine(
        "two-transcripts",
        _second_transcript,
        "line-duplicate",
        ("2 transcripts", "five.lab", "five.txt", "Keep one"),
    ),
    BadLine(
        "book-for-a-line",
        _text(b"one two three four five six seven eight nine ten " * 9),
        "transcript-too-long",
        ("cannot be spoken", "five.wav", "longer recording"),
    ),
)


def _header(audio: Path) -> bytes:
    """A WAV header that promises no samples."""
    fmt = struct.pack("<HHIIHH", 1, 1, RATE_HZ, 2 * RATE_HZ, 2, 16)
    body = b"WAVEfmt " + struct.pack("<I", len(fmt)) + fmt + b"data" + struct.pack("<I", 0)
    return b"RIFF" + struct.pack("<I", len(body)) + body


@pytest.mark.parametrize("case", BAD_LINES, ids=lambda case: case.id)
def test_a_bad_line_fails_alone_and_works_once_mended(
    case: BadLine, job: SmallJob, capsys: Capture
) -> None:
    case.spoil(job.dialogue / f"{BAD}.wav")
    ran = run_inline(capsys, job)
    ran.says(BAD, case.code, *case.words)
    assert ran.code == 1
    assert job.statuses() == {GOOD: "ok", BAD: "failed"}
    (finding,) = job.findings(BAD)
    assert finding["code"].startswith(case.code)
    assert finding["action"]
    assert not finding["ours"]
    assert job.animations() == {"boat"}
    assert not (job.output / "alignments" / f"{BAD}.json").exists()

    for file in job.dialogue.glob(f"{BAD}.*"):
        file.unlink()
    job.line(BAD, like=BAD)
    expect_success(job, run_inline(capsys, job))
    assert job.animations() == {"boat", "five"}


def test_a_folder_of_an_unknown_language_fails_its_lines_and_no_others(
    job: SmallJob, capsys: Capture
) -> None:
    job.line("klingon/boat")
    ran = run_inline(capsys, job)
    ran.says("klingon/boat", "'klingon' is not a language", "BCP-47")
    assert ran.code == 1
    assert job.statuses() == {GOOD: "ok", BAD: "ok", "klingon/boat": "failed"}
    assert not (job.output / "klingon").exists()

    (job.dialogue / "klingon").rename(job.dialogue / "en-GB")
    expect_success(job, run_inline(capsys, job))


def test_a_file_name_that_is_no_unicode_fails_at_most_its_own_line(
    job: SmallJob, capsys: Capture
) -> None:
    for suffix in (b".wav", b".txt"):
        name = os.fsencode(job.dialogue / BAD)
        os.rename(name + suffix, name.replace(b"five", b"f\xfcnf") + suffix)
    ran = run_inline(capsys, job)
    ran.says()
    assert ran.code in (0, 1)
    assert job.statuses()[GOOD] == "ok"
    assert "boat" in job.animations()


def test_a_name_too_long_for_our_files_fails_at_most_its_own_line(
    job: SmallJob, capsys: Capture
) -> None:
    """A recording's name may take all of a file system's 255 bytes; ours are made from it."""
    longest = "en/" + 83 * "あ"
    job.line(longest)
    ran = run_inline(capsys, job)
    ran.says()
    assert ran.code in (0, 1)
    assert job.statuses()[GOOD] == "ok"
    assert not any(finding["ours"] for finding in job.findings(longest))


def test_names_that_look_like_markup_are_shown_as_they_are(job: SmallJob, capsys: Capture) -> None:
    job.line("en/[red] take [/2]").write_bytes(b"")
    ran = run_inline(capsys, job)
    ran.says("en/[red] take [/2]", "[red] take [/2].wav", "audio-empty")
    assert ran.code == 1


def test_a_line_of_all_and_one_of_a_character_may_share_their_name(
    job: SmallJob, capsys: Capture
) -> None:
    """The character's own recording takes the place of the one for all."""
    job.line("en/crab/boat", like="en/moon")
    ran = run_inline(capsys, job)
    ran.says()
    assert ran.code == 0
    assert job.statuses() == {BAD: "ok", "en/crab/boat": "ok"}
    assert job.animations() == {"boat", "five"}
