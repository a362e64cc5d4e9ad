"""Transcripts: plain text beside the recording."""

from __future__ import annotations

from pathlib import Path

from animeme.errors import InputError
from animeme.files import unreadable


def read_transcript(path: Path) -> str:
    """Text of a transcript: UTF-8 or UTF-16 with BOM; surrounding white space dropped.

    Raises:
        InputError: missing, not text, or empty.
    """
    if not path.is_file():
        raise InputError(
            "transcript-missing",
            "the recording has no transcript",
            place=str(path),
            action="Write what is said into that file.",
        )
    try:
        data = path.read_bytes()
    except OSError as error:
        raise unreadable(path, "transcript-unreadable", error) from error
    utf16 = data.startswith((b"\xff\xfe", b"\xfe\xff"))
    try:
        text = data.decode("utf-16" if utf16 else "utf-8-sig").strip()
    except UnicodeDecodeError as error:
        raise InputError(
            "transcript-unreadable",
            f"is not UTF-8 text (byte {error.start})",
            place=str(path),
            action="Save it as UTF-8.",
        ) from error
    if not text:
        raise InputError(
            "transcript-empty",
            "the transcript is empty",
            place=str(path),
            action="Write what is said in the recording, or take the line out of the folder.",
        )
    return text
