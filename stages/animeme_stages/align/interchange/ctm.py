"""CTM, the time-marked conversation format of NIST's sclite and of Kaldi.

A line is ``recording channel start length token [confidence [kind [speaker]]]`` in seconds;
``;;`` starts a comment. A file may hold many recordings, so ours must be named like the file. There
is no mark at the end, so only a missing line end shows that part of a line is gone.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator

from animeme.phones import PhoneTrack
from animeme_stages.align.interchange.source import Source, number
from animeme_stages.align.interchange.symbols import looks_phonetic
from animeme_stages.align.interchange.timings import (
    WORD_SILENCES,
    DamagedError,
    Span,
    Timings,
    words_of,
)


def matches(source: Source) -> bool:
    """Whether the first line that is no comment looks like CTM."""
    for line in source.text.split("\n"):
        if line.strip() and not line.startswith(";;"):
            fields = line.split()
            return 5 <= len(fields) <= 8 and _is_time(fields[2]) and _is_time(fields[3])
    return False


def read(source: Source) -> Timings:
    """The words, or the phones, of the recording that is named like the file.

    Raises:
        DamagedError: a line is not CTM, or it cannot be told which recording is meant.
    """
    by_recording: dict[tuple[str, str], list[Span]] = {}
    for line, text in source.lines():
        if not text.startswith(";;"):
            recording, channel, span = _span(text.split(), line)
            by_recording.setdefault((recording, channel), []).append(span)
    spans = _chosen(by_recording, source.stem)
    # Kaldi gives pauses, and only these, a length of zero at times.
    kept = [s for s in spans if s.end_s > s.start_s or s.label.lower() not in WORD_SILENCES]
    if looks_phonetic(kept):
        return Timings((), tuple(kept), (), None, "ctm")
    return Timings(words_of(kept), (), (), None, "ctm")


def write_words(track: PhoneTrack, name: str) -> str:
    """The words of `track`, under the recording's `name`; its phones where it has no words."""
    if not track.words:
        return write_phones(track, name)
    return _text(((word.text, word.start_s, word.end_s) for word in track.words), name)


def write_phones(track: PhoneTrack, name: str) -> str:
    """The phones of `track`, pauses included, under the recording's `name`."""
    return _text(((phone.symbol, phone.start_s, phone.end_s) for phone in track.phones), name)


def _span(fields: list[str], line: int) -> tuple[str, str, Span]:
    if not 5 <= len(fields) <= 8:
        raise DamagedError(f"line {line} has {len(fields)} fields, not 5 to 8")
    start_s = number(fields[2], f"the start in line {line}")
    length_s = number(fields[3], f"the length in line {line}")
    if len(fields) > 5 and fields[5] != "NA":
        number(fields[5], f"the confidence in line {line}")
    return fields[0], fields[1], Span(fields[4], start_s, round(start_s + length_s, 9))


def _chosen(by_recording: dict[tuple[str, str], list[Span]], stem: str) -> list[Span]:
    """The spans of the recording that is named like the file; never those of another one."""
    names = [key for key in by_recording if _plain(key[0]) == _plain(stem)]
    if not names:
        others = ", ".join(f"'{name[:40]}'" for name, _ in list(by_recording)[:3]) or "none"
        raise DamagedError(f"it has no recording '{stem}' (it has {others})")
    if len(names) > 1:
        raise DamagedError(f"it has {len(names)} channels; keep the one that belongs to the line")
    return by_recording[names[0]]


def _plain(name: str) -> str:
    """A recording's name as CTM can hold it."""
    return "_".join(name.replace(";", "_").split()) or "_"


def _text(spans: Iterable[tuple[str, float, float]], name: str) -> str:
    return "".join(_lines(spans, _plain(name)))


def _lines(spans: Iterable[tuple[str, float, float]], recording: str) -> Iterator[str]:
    for label, start_s, end_s in spans:
        token = "_".join(label.split()) or "<eps>"  # the format knows no quotes
        # Six digits: fewer than 1e-6 s are noise, and exponents are no CTM.
        yield f"{recording} 1 {start_s:.6f} {end_s - start_s:.6f} {token}\n"


def _is_time(field: str) -> bool:
    try:
        number(field, "")
    except DamagedError:
        return False
    return True
