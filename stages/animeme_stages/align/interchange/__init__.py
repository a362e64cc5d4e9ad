"""Timings in other tools' formats: read them, make tracks or anchors of them, write them.

A half-written file is refused, never read in part. Where a format has no mark at its end (CTM, HTK,
Polly, WebVTT, SubRip), a file that lacks whole lines cannot be told from a shorter one; what part
of the recording it leaves out is for its user to check against the audio.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

from animeme.errors import InputError
from animeme.files import write_text
from animeme.phones import PhoneTrack
from animeme_stages.align.interchange import (
    alignment_json,
    azure,
    ctm,
    elan,
    htk,
    mfa_json,
    polly,
    rhubarb,
    subtitles,
    textgrid,
    whisper,
)
from animeme_stages.align.interchange.source import (
    Source,
    damaged,
    is_cut_json,
    parse_json,
    read_source,
)
from animeme_stages.align.interchange.timings import DamagedError, Span, Timings
from animeme_stages.align.interchange.track import anchors, track_from

__all__ = [
    "FORMATS",
    "Kind",
    "Span",
    "TimingFormat",
    "Timings",
    "anchors",
    "kind_of",
    "read_timings",
    "suffix_of",
    "track_from",
    "write_timings",
]


@dataclass(frozen=True)
class TimingFormat:
    """One format.

    Attributes:
        suffixes: of its files, in lower case.
        matches: whether a content looks like it; may raise `DamagedError`.
        read: the timings in a content; raises `DamagedError`.
        write: the text for a track and the recording's name, None where it is not written.
    """

    suffixes: tuple[str, ...]
    matches: Callable[[Source], bool] | None
    read: Callable[[Source], Timings] | None
    write: Callable[[PhoneTrack, str], str] | None = None


# In the order in which content is tried.
FORMATS: dict[str, TimingFormat] = {
    "textgrid": TimingFormat((".textgrid",), textgrid.matches, textgrid.read, textgrid.write),
    "elan": TimingFormat((".eaf",), elan.matches, elan.read),
    "webvtt": TimingFormat((".vtt",), subtitles.matches_vtt, subtitles.read_vtt),
    "srt": TimingFormat((".srt",), subtitles.matches_srt, subtitles.read_srt),
    "rhubarb-tsv": TimingFormat(
        (".tsv",), rhubarb.matches_tsv, rhubarb.read_tsv, rhubarb.write_tsv
    ),
    "ctm": TimingFormat((".ctm",), ctm.matches, ctm.read, ctm.write_words),
    "phone-ctm": TimingFormat((".ctm",), None, None, ctm.write_phones),
    "htk": TimingFormat((".lab",), htk.matches, htk.read),
    "polly": TimingFormat((".json", ".jsonl", ".marks"), polly.matches, polly.read),
    "azure": TimingFormat((".json", ".jsonl"), azure.matches, azure.read),
    "alignment": TimingFormat(
        (".json",), alignment_json.matches, alignment_json.read, alignment_json.write
    ),
    "mfa-json": TimingFormat((".json",), mfa_json.matches, mfa_json.read),
    "rhubarb-json": TimingFormat((".json",), rhubarb.matches_json, rhubarb.read_json),
    "whisper": TimingFormat((".json",), whisper.matches, whisper.read),
}
"""Every format by name. ``ctm`` writes words (phones where there are none), ``phone-ctm`` phones;
both are read as ``ctm``."""

Kind = Literal["timings", "mouth shapes", "other"]
"""Timings of words or phones; of visemes alone, from which nothing can be aligned; neither."""

# Suffixes of other things as well → the format that is meant where it is one.
_SHARED_SUFFIXES = {".lab": "htk", ".tsv": "rhubarb-tsv", ".json": "", ".jsonl": ""}
_TELLING_MEMBERS = ("mouthCues", "segments", "word_segments", "words", "phones", "tiers")


def read_timings(path: Path) -> Timings:
    """The timings in a file, whose format is told by its suffix, and by its content where the
    suffix is unknown or shared.

    Raises:
        InputError: it cannot be read (``timings-unreadable``, ``timings-encoding``,
            ``timings-too-large``), is of no known format (``timings-unknown``), or is broken or
            only half there (``timings-damaged``).
    """
    source = read_source(path)
    if not source.text.strip():
        raise damaged(path, "it is empty")
    try:
        found = _format_of(source, path.suffix.lower())
        if found is None or found.read is None:
            if source.first_line.startswith(("{", "[")):
                _ = source.json  # half a JSON text is damaged rather than unknown
            raise _unknown(path)
        return found.read(source)
    except DamagedError as error:
        raise damaged(path, str(error)) from error


def kind_of(path: Path) -> Kind:
    """What a file beside a recording is meant to be, whether or not it is whole.

    Suffixes that only timings have tell by themselves. A ``.lab`` may be a transcript, and a
    ``.json``, ``.jsonl`` or ``.tsv`` anybody's: their content tells. JSON that was cut short, or is
    broken and speaks of timings, is taken for damaged timings rather than for nobody's.
    """
    suffix = path.suffix.lower()
    if suffix not in _SHARED_SUFFIXES:
        return "timings" if any(suffix in form.suffixes for form in FORMATS.values()) else "other"
    try:
        source = read_source(path)
    except InputError as error:
        unreadable = error.code in ("timings-unreadable", "timings-damaged")
        return "timings" if unreadable and suffix.startswith(".json") else "other"
    if suffix.startswith(".json"):
        return _kind_of_json(source, suffix)
    form = FORMATS[_SHARED_SUFFIXES[suffix]]
    matches = form.matches is not None and form.matches(source)
    return ("mouth shapes" if suffix == ".tsv" else "timings") if matches else "other"


def suffix_of(format: str) -> str:
    """The suffix of a format's files, spelt as its own tools do (``.TextGrid``).

    Raises:
        InputError: the format is none, or cannot be written.
    """
    (suffix, *_) = _writable(format, "--format").suffixes
    return ".TextGrid" if suffix == ".textgrid" else suffix


def write_timings(track: PhoneTrack, path: Path, format: str) -> None:
    """Write `track` to `path`, whole or not at all.

    Args:
        track: what to write.
        path: the file; its stem names the recording in CTM.
        format: a key of `FORMATS` that can be written.

    Raises:
        InputError: the format cannot be written, or the file.
    """
    form = _writable(format, str(path))
    assert form.write is not None
    write_text(path, form.write(track, path.stem))


def _writable(format: str, place: str) -> TimingFormat:
    form = FORMATS.get(format)
    if form is None or form.write is None:
        writable = ", ".join(name for name, each in FORMATS.items() if each.write)
        raise InputError(
            "timings-format",
            f"'{format}' is not a format that can be written",
            place=place,
            action=f"Choose one of: {writable}.",
        )
    return form


def _kind_of_json(source: Source, suffix: str) -> Kind:
    if not source.text.strip():
        return "timings"  # whoever writes JSON opens the file first
    if not source.first_line.startswith(("{", "[")):
        return "other"
    try:
        found = _format_of(source, suffix)
        if found is None and suffix == ".jsonl":
            parse_json(source.first_line)
    except DamagedError:
        spoken_of = any(f'"{member}"' in source.text for member in _TELLING_MEMBERS)
        return "timings" if spoken_of or is_cut_json(source.text) else "other"
    if found is None or (found is FORMATS["whisper"] and not whisper.is_timed(source)):
        return "other"
    return "mouth shapes" if found is FORMATS["rhubarb-json"] else "timings"


def _format_of(source: Source, suffix: str) -> TimingFormat | None:
    """The format: the only one with that suffix, else the first whose content matches."""
    readable = [form for form in FORMATS.values() if form.read]
    candidates = [form for form in readable if suffix in form.suffixes]
    if len(candidates) == 1:
        return candidates[0]
    return next((form for form in candidates or readable if _matches(form, source)), None)


def _matches(form: TimingFormat, source: Source) -> bool:
    # Without a suffix that says so, content that is no JSON is not damaged JSON.
    likely_json = source.first_line.startswith(("{", "["))
    if ".json" in form.suffixes and not likely_json:
        return False
    return form.matches is not None and form.matches(source)


def _unknown(path: Path) -> InputError:
    names = ", ".join(name for name, form in FORMATS.items() if form.read)
    return InputError(
        "timings-unknown",
        "is in no known timing format",
        place=str(path),
        action=f"Known formats: {names}.",
    )
