"""The same timed words, as other tools write them."""

from __future__ import annotations

import json
from collections.abc import Callable, Sequence

from animeme.phones import Word


def ctm(words: Sequence[Word]) -> str:
    """CTM of a recording called ``boat``."""
    return "".join(f"boat 1 {w.start_s:.3f} {w.end_s - w.start_s:.3f} {w.text}\n" for w in words)


def lab(words: Sequence[Word]) -> str:
    """HTK labels."""
    return "".join(f"{w.start_s * 1e7:.0f} {w.end_s * 1e7:.0f} {w.text}\n" for w in words)


def whisperx(words: Sequence[Word]) -> str:
    """WhisperX's JSON, one segment."""
    entries = [{"word": w.text, "start": w.start_s, "end": w.end_s} for w in words]
    segment = {"start": words[0].start_s, "end": words[-1].end_s, "words": entries, "text": ""}
    return json.dumps({"segments": [segment]})


def azure(words: Sequence[Word]) -> str:
    """Azure's word boundary events."""
    return json.dumps(
        [
            {
                "Text": w.text,
                "AudioOffset": round(w.start_s * 1000),
                "Duration": round((w.end_s - w.start_s) * 1000),
                "BoundaryType": "WordBoundary",
            }
            for w in words
        ]
    )


def polly(words: Sequence[Word]) -> str:
    """Polly's speech marks."""
    marks = [{"time": round(w.start_s * 1000), "type": "word", "value": w.text} for w in words]
    return "".join(json.dumps(mark) + "\n" for mark in marks)


def clock_of(seconds: float, mark: str) -> str:
    """A time of a subtitle, with its mark before the milliseconds."""
    return f"00:00:{int(seconds):02d}{mark}{round(seconds % 1 * 1000):03d}"


def cues(words: Sequence[Word]) -> list[Sequence[Word]]:
    """The words as two subtitles."""
    return [words[:5], words[5:]]


def vtt(words: Sequence[Word]) -> str:
    """WebVTT with a speaker's tag, capitals and exclamation marks."""
    blocks = (
        f"{clock_of(cue[0].start_s, '.')} --> {clock_of(cue[-1].end_s, '.')}\n"
        f"<v Ada>{' '.join(w.text.title() for w in cue)}!\n"
        for cue in cues(words)
    )
    return "WEBVTT\n\n" + "\n".join(blocks)


def srt(words: Sequence[Word]) -> str:
    """SubRip with a style."""
    return "\n".join(
        f"{number}\n{clock_of(cue[0].start_s, ',')} --> {clock_of(cue[-1].end_s, ',')}\n"
        f"<i>{' '.join(w.text for w in cue)}</i>\n"
        for number, cue in enumerate(cues(words), 1)
    )


WRITERS: dict[str, Callable[[Sequence[Word]], str]] = {
    "boat.ctm": ctm,
    "boat.lab": lab,
    "boat.json": whisperx,
    "boat.JSON": azure,
    "boat.marks": polly,
    "boat.jsonl": polly,
    "boat.vtt": vtt,
    "boat.srt": srt,
}
