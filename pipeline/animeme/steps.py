"""From a recording to the curves of a rig, step by step.

Each step is taken from the store where it is there, and put there where it is not, under a key
that says what it was made from (`animeme.store.keys`). The alignment depends on the recording and
what is said in it, the model's curves on the alignment, those of a rig on the model's and on what
was done by hand: so a new model leaves the alignments, and a new rig or an edit leaves both.
"""

from __future__ import annotations

import hashlib
import json
import secrets
import time
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING, Any

import numpy as np

from animeme import registry
from animeme.contracts import Alignment, Anchor, LineSubject, Model, Speech, Spoken
from animeme.curves import CurveSet
from animeme.dialogue import Line, has_transcript, is_spoken, transcript_of, voice_of
from animeme.errors import InputError
from animeme.files import json_text
from animeme.findings import Finding
from animeme.packing import curve_head, model_places, packed, places
from animeme.phones import Event, PhoneTrack
from animeme.shaping import LineMotion
from animeme.store.entries import Entry, Store

if TYPE_CHECKING:
    from animeme.tasks import RunContext, Target

# What these say was not so a moment ago, or will not be so a moment later.
_PASSING_CODES = ("output-unwritable", "store-unwritable")


@dataclass(frozen=True)
class Means:
    """With what a line is aligned.

    Attributes:
        aligner: name of the aligner.
        lexicon: pronunciations of the user's, or None.
        voice: how the speaker sounds, as the aligner learned it, or None.
    """

    aligner: str
    lexicon: Path | None = None
    voice: Path | None = None


@dataclass(frozen=True)
class Timed:
    """A line with its phones, or why it has none.

    Attributes:
        audio_s: length of the recording, 0 if it could not be read.
        findings: of the recording and of the alignment.
        track: its phones, None where there is an error.
        score: the aligner's confidence, 0 to 1, or None.
        spoken: what a program spoke, for want of a recording.
        passing: the error may be gone the next time, though nothing of the line changes.
    """

    audio_s: float
    findings: tuple[Finding, ...]
    track: PhoneTrack | None = None
    score: float | None = None
    spoken: Spoken | None = None
    passing: bool = False


def time_line(line: Line, means: Means, *, speak: bool = False) -> Timed:
    """Ingest and align one line; with `speak`, one without a recording is spoken."""
    speech: Speech | None = None
    try:
        if is_spoken(line, speak, line.audio.exists()):
            spoken = _speak(line)
            speech, alignment = spoken.speech, spoken.alignment
        else:
            spoken = None
            speech = registry.stage("read-speech")(line.audio)
            assert speech is not None
            alignment = align_speech(
                speech,
                _transcript(line),
                line.timings,
                language=line.language,
                means=means,
            )
    except InputError as error:
        seconds = speech.duration_s if speech else 0.0
        own = speech.findings if speech else ()
        return Timed(seconds, (*own, Finding.from_error(error)), passing=is_passing(error))
    findings = (*speech.findings, *alignment.findings)
    return Timed(speech.duration_s, findings, alignment.track, alignment.score, spoken)


def is_passing(error: InputError) -> bool:
    """Whether an error may be gone the next time: a disk, a share or a permission failed."""
    cause = error.__cause__
    absent = isinstance(cause, (FileNotFoundError, IsADirectoryError, NotADirectoryError))
    return error.code in _PASSING_CODES or (isinstance(cause, OSError) and not absent)


def _transcript(line: Line) -> Callable[[], str] | None:
    """Reads the line's transcript; None where timings may do without."""
    if line.timings_file is not None and not has_transcript(line):
        return None
    return partial(transcript_of, line)


def align_speech(
    speech: Speech,
    text: Callable[[], str] | None,
    timings: Path | None,
    *,
    language: str,
    means: Means,
) -> Alignment:
    """The phones of a recording: as somebody timed them, or as the aligner finds them.

    Args:
        speech: the recording.
        text: gives what is said in it; None if only `timings` tell.
        timings: of phones or words, or None.
        language: BCP-47 tag.
        means: how to align.

    Raises:
        InputError: one of them cannot be used, or they do not fit together.
    """

    def align(words: str, anchors: Sequence[Anchor] = ()) -> Alignment:
        return registry.aligner(means.aligner).align(
            speech,
            words,
            language=language,
            lexicon=means.lexicon,
            anchors=anchors,
            voice=means.voice,
        )

    if timings is None:
        return align(text() if text else "")
    alignment: Alignment = registry.stage("read-timings")(
        timings, speech, language=language, text=text, align=align
    )
    return alignment


def _speak(line: Line) -> Spoken:
    """The line as a program speaks it, until there is a recording."""
    text = transcript_of(line)
    spoken: Spoken = registry.stage("speak")(text, language=line.language, source=line.transcript)
    return spoken


def alignment_bytes(track: PhoneTrack) -> bytes:
    """A track as the ``animeme.alignment`` document that a run delivers."""
    return json_text(track.to_document()).encode()


@dataclass
class Steps:
    """The steps of one line.

    Attributes:
        store: where results are kept.
        private: where those are kept that are good for this run only.
        unchanged: whether the files that a result is made from are still those of its key.
        effort: (step, CPU seconds, whether it was in the store), in order.
        final: what has been found holds until something that it was made from changes.
    """

    store: Store
    private: Store
    unchanged: Callable[[], bool]
    effort: list[tuple[str, float, bool]] = field(default_factory=list)
    final: bool = True

    def align(self, key: str, line: Line, context: RunContext) -> tuple[str, Entry]:
        """Key and entry of the line's alignment; see `aligned`."""

        def make() -> tuple[dict[str, Any], bytes]:
            voice = voice_of(context.voices, line)
            means = Means(context.aligner, context.lexicon, voice)
            timed = time_line(line, means, speak=context.speak)
            self.final &= not timed.passing
            document = b"" if timed.track is None else alignment_bytes(timed.track)
            value = {
                "audio_s": timed.audio_s,
                "score": timed.score,
                "spoken": timed.spoken is not None,
                "findings": packed(timed.findings, places(line, context)),
                "document": len(document),
                "digest": hashlib.sha256(document).hexdigest() if document else "",
            }
            return value, document + _wave(timed.spoken)

        return self._step("align", key, make)

    def controls(
        self,
        key: str,
        motion: LineMotion,
        model: Callable[[], Model],
        target: Target,
        rate_hz: float,
    ) -> Entry:
        """The entry of the curves of a target's model."""
        tokens = model_places(target)

        def make() -> tuple[dict[str, Any], bytes]:
            chosen = model()
            try:
                curves = chosen.synthesize(motion.track, rate_hz=rate_hz)
                remarks = tuple(chosen.remarks(motion.track))
            except InputError as error:
                return self._failed(error, tokens)
            return {"findings": packed(remarks, tokens)}, curve_bytes(curves, ())

        return self._step("synthesize", key, make)[1]

    def shapes(
        self,
        key: str,
        motion: LineMotion,
        controls: Callable[[], CurveSet | None],
        target: Target,
        tokens: Mapping[str, str],
    ) -> tuple[str, Entry]:
        """Key and entry of the curves of a target's rig; `controls` gives None if drawn by hand."""

        def make() -> tuple[dict[str, Any], bytes]:
            try:
                made = motion.of(target.character, target.asset, target.rig, controls())
                subject = LineSubject(motion.track, made.controls, target.rig, made.heard)
                found = [
                    f for check in registry.checks(registry.LINE_CHECKS) for f in check.run(subject)
                ]
            except InputError as error:
                return self._failed(error, tokens)
            findings = packed((*made.findings, *found), tokens)
            return {"findings": findings}, curve_bytes(made.shapes, motion.track.events)

        return self._step("retarget", key, make)

    def _failed(self, error: InputError, tokens: Mapping[str, str]) -> tuple[dict[str, Any], bytes]:
        """The result of a step that could not use what it was given."""
        self.final &= not is_passing(error)
        return {"findings": packed([Finding.from_error(error)], tokens)}, b""

    def _step(
        self, step: str, key: str, make: Callable[[], tuple[dict[str, Any], bytes]]
    ) -> tuple[str, Entry]:
        started = time.process_time()
        entry = self.store.get(key) if key else None
        if entry is not None:
            self.store.touch(key)
        found = entry is not None
        if entry is None:
            value, payload = make()
            self.final &= self.unchanged()
            if key and self.final:
                entry = self.store.put(key, value, payload)
            else:
                key = secrets.token_hex(32)
                entry = self.private.put(key, value, payload)
        self.effort.append((step, time.process_time() - started, found))
        return key, entry


def track_of(entry: Entry) -> PhoneTrack | None:
    """The phones in an entry of `Steps.align`."""
    size = entry.value["document"]
    return PhoneTrack.from_document(json.loads(entry.payload[:size])) if size else None


def _wave(spoken: Spoken | None) -> bytes:
    if spoken is None:
        return b""
    with TemporaryDirectory() as folder:
        path = Path(folder) / "speech.wav"
        registry.stage("write-speech")(spoken, path)
        return path.read_bytes()


def curve_bytes(curves: CurveSet, events: Iterable[Event]) -> bytes:
    """Curves and events as bytes: a line of JSON, then float64 times and weights (T, N)."""
    head = {
        "keys": len(curves.times_s),
        "names": curves.names,
        "events": [[event.tag, event.time_s] for event in events],
    }
    text = json.dumps(head, ensure_ascii=False, separators=(",", ":"))
    arrays = [np.ascontiguousarray(a, "<f8").tobytes() for a in (curves.times_s, curves.weights)]
    return b"".join([text.encode(), b"\n", *arrays])


def curves_of(payload: bytes) -> tuple[CurveSet, tuple[Event, ...]]:
    """What `curve_bytes` packed."""
    head, rest = curve_head(payload)
    values = np.frombuffer(rest, "<f8")
    keys, names = head["keys"], tuple(head["names"])
    curves = CurveSet(values[:keys], names, values[keys:].reshape(keys, len(names)))
    return curves, tuple(Event(tag, time_s) for tag, time_s in head["events"])
