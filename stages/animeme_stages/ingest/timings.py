"""Timings that somebody has already made: used instead of aligning, or as its anchors; checked."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path

from animeme.contracts import Alignment, Anchor, Speech
from animeme.errors import InputError
from animeme.findings import Finding, Severity
from animeme.phones import SILENCE, PhoneTrack
from animeme_stages.align.anchors import Match, anchors_of, joined, match
from animeme_stages.align.doubts import UNTRANSCRIBED_S, doubt, sound_in_pauses
from animeme_stages.align.interchange import Span, Timings, anchors, read_timings, track_from
from animeme_stages.align.language import language as language_of

Align = Callable[[str, Sequence[Anchor]], Alignment]
"""Aligns a text with the recording, given what is known of its times."""

Text = Callable[[], str]
"""Gives the transcript, when it is needed."""

LEAST_AGREEING = 0.5
"""Timings that share a smaller part of their words with the transcript are another line's."""


def read_alignment(
    path: Path,
    speech: Speech,
    *,
    language: str,
    text: Text | None = None,
    align: Align | None = None,
) -> Alignment:
    """The phones of a recording that has a file of timings.

    Phones in the file are taken as they are. Where it has words or groups of words only (subtitles,
    segments), their times become anchors, between which `align` finds the phones: of the
    transcript, or of the timings' own text where there is no transcript. From mouth shapes alone
    nothing can be found, so the transcript is aligned without them.

    Args:
        path: the file, in any format that `read_timings` knows.
        speech: its recording; what is loud and in no phone is remarked on.
        language: BCP-47 tag.
        text: gives the transcript; None where there is none.
        align: the aligner, ready for this recording and language; None if only phones will do.

    Raises:
        InputError: the file is damaged, goes on after the recording's end, has text that is not the
            transcript's (``timings-text-differs``), mouth shapes only and no transcript
            (``timings-without-words``), or no phones (``timings-without-phones``) where they must
            have them.
    """
    timings = read_timings(path)
    if timings.phones or align is None:
        alignment = _given(timings, path, speech, language, text)
    elif timings.words or text is None:
        alignment = _anchored(timings, path, speech, language, text, align)
    else:
        alignment = align(text(), ())
        message = "it has mouth shapes only, so the line was aligned from its transcript"
        return _remarked(alignment, _info("timings-without-words", message, path))
    return _remarked(alignment, *_sound_left_out(alignment, speech))


def _given(
    timings: Timings, path: Path, speech: Speech, language: str, text: Text | None
) -> Alignment:
    """The phones of the file, its words tied to their places in the transcript."""
    track = track_from(timings, language=language, duration_s=speech.duration_s, place=str(path))
    findings = [_info("timings-used", "its timings were given", path)]
    if track.words and text is not None:
        spans = [Span(word.text, word.start_s, word.end_s) for word in track.words]
        try:
            found = match(text(), spans, language_of(language))
        except InputError as error:
            # Whoever gives phones needs neither a transcript nor a language that we can read.
            reason = f"they were not compared with the transcript: it {error.problem}"
            findings.append(_info("timings-not-compared", reason, path))
        else:
            _require_likeness(found, path)
            track = _tied(track, found)
            findings += _differing(found, path)
    return Alignment(track, tuple(findings))


def _anchored(
    timings: Timings, path: Path, speech: Speech, language: str, text: Text | None, align: Align
) -> Alignment:
    """The phones that `align` finds where the file's words are."""
    spans = anchors(timings, duration_s=speech.duration_s, place=str(path))
    settings = language_of(language)
    said = text() if text is not None else joined(spans, settings)
    found = match(said, spans, settings)
    _require_likeness(found, path)
    try:
        alignment = align(said, anchors_of(found, spans, timings.source))
    except InputError as error:
        if error.code != "align-failed":
            raise
        raise InputError(
            error.code,
            "the recording does not say the transcript at the times that are given here",
            place=str(path),
            action="Listen to the line: if they fit together, take these timings away.",
        ) from error
    message = "the times of its words were given, those of its phones found"
    return _remarked(alignment, _info("timings-used", message, path), *_differing(found, path))


def _require_likeness(found: Match, path: Path) -> None:
    """Refuse timings that are not of this transcript."""
    if found.agreeing < LEAST_AGREEING and found.difference:
        raise InputError(
            "timings-text-differs",
            f"its words are not those of the transcript: {found.difference}",
            place=str(path),
            action="They are another line's or version's: mend one, or take the timings away.",
        )


def _tied(track: PhoneTrack, found: Match) -> PhoneTrack:
    """The track with each word's place in the transcript."""
    sources: dict[int, tuple[int, int]] = {}
    for mine, theirs in found.pairs:
        start, end = found.tokens[mine.start].start, found.tokens[mine.stop - 1].end
        for index in theirs:
            first, last = sources.get(index, (start, end))
            sources[index] = min(first, start), max(last, end)
    words = (
        replace(word, source=sources.get(index, word.source))
        for index, word in enumerate(track.words)
    )
    return replace(track, words=tuple(words))


def _differing(found: Match, path: Path) -> list[Finding]:
    if not found.difference:
        return []
    message = f"the timings and the transcript differ: {found.difference}"
    action = "Mend the one that is wrong."
    finding = Finding(Severity.WARNING, "timings-text-differs", message, str(path), action)
    return [finding]


def _sound_left_out(alignment: Alignment, speech: Speech) -> list[Finding]:
    """A doubt where speech is in no phone, unless the aligner has had it already."""
    track, code = alignment.track, "align-untranscribed"
    told = any(finding.code == code for finding in alignment.findings)
    if told or all(phone.symbol == SILENCE for phone in track.phones):
        return []
    pause, length_s = sound_in_pauses(track, speech)
    if pause is None or length_s < UNTRANSCRIBED_S:
        return []
    between = f"between {pause.start_s:.1f} and {pause.end_s:.1f} s"
    return [doubt(code, f"{length_s:.1f} s of sound {between} are in no word")]


def _info(code: str, message: str, path: Path) -> Finding:
    return Finding(Severity.INFO, code, message, place=str(path))


def _remarked(alignment: Alignment, *findings: Finding) -> Alignment:
    return replace(alignment, findings=(*alignment.findings, *findings))
