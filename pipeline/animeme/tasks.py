"""The kinds of work in a run, as functions that any executor can call.

What goes in and out is small: paths, names, findings. Curves travel through files in the run's
spool folder.
"""

from __future__ import annotations

import json
import pickle
from collections.abc import Callable, Hashable, Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache, partial
from pathlib import Path

import numpy as np

from animeme import registry
from animeme.contracts import (
    Alignment,
    Anchor,
    AssetSubject,
    Format,
    LineAnimation,
    LineSubject,
    Model,
    Speech,
    Spoken,
)
from animeme.curves import CurveSet, drop_still
from animeme.dialogue import Line, has_transcript, transcript_of, voice_of
from animeme.errors import InputError
from animeme.files import unwritable, write_text
from animeme.findings import Finding, Severity
from animeme.job import ModelChoice
from animeme.phones import Event
from animeme.rig import BoundRig, Character
from animeme.shaping import CurveOptions, LineMotion


@dataclass(frozen=True)
class Target:
    """One asset of one character, ready to be driven.

    Attributes:
        character: the character's name in the job.
        asset: what its format read.
        rig: its bound profile.
        model: the character's own, None for the job's.
        layout: how its lines are laid out in files.
    """

    character: str
    asset: Character
    rig: BoundRig
    model: ModelChoice | None = None
    layout: str = "per-character"

    @property
    def format(self) -> Format:
        """The format that writes it."""
        form = registry.format_named(self.asset.format)
        return form.for_layout(self.layout, self.asset)


@dataclass(frozen=True)
class RunContext:
    """What every task of a run shares.

    Attributes:
        targets: assets in the job's order.
        aligner: name of the aligner.
        lexicon: pronunciations of the user's, or None.
        voices: folder of learned voices, or None.
        model: name of the model, or None if there is a file.
        model_file: model document.
        curves: how they are sampled, placed and handed out.
        output: the run's output folder.
        speak: speak transcripts that have no recording.
    """

    targets: tuple[Target, ...]
    aligner: str
    lexicon: Path | None
    voices: Path | None
    model: str | None
    model_file: Path | None
    curves: CurveOptions
    output: Path
    speak: bool


@dataclass(frozen=True)
class LineItem:
    """Work on one line: recording to shape curves.

    Attributes:
        line: the line.
        targets: indices of the context's targets that speak it.
        spool: the run's spool folder; it holds the context.
        number: of the line, names its files in the spool.
    """

    line: Line
    targets: tuple[int, ...]
    spool: Path
    number: int


@dataclass(frozen=True)
class LineOutcome:
    """What became of a line.

    Attributes:
        audio_s: length of the recording, 0 if it could not be read.
        findings: those of the line itself have no character; the others name theirs.
        score: the aligner's confidence, 0 to 1, or None.
        spoken: there is no recording, the line was spoken.
    """

    audio_s: float
    findings: tuple[Finding, ...]
    score: float | None = None
    spoken: bool = False


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
class AlignItem:
    """Work on one line whose timings are all that is wanted.

    Attributes:
        line: the line.
        aligner: name of the aligner.
        lexicon: pronunciations of the user's, or None.
        voices: folder of learned voices, or None.
        output: file to write if the line is good, or None.
        format: its format, as the stage ``write-timings`` calls it.
    """

    line: Line
    aligner: str
    lexicon: Path | None
    voices: Path | None
    output: Path | None
    format: str


@dataclass(frozen=True)
class AssetItem:
    """Work on one file: curves of its lines into an asset.

    Attributes:
        target: index into the context's targets.
        language: folder name and tag.
        lines: (number of the line, animation name, length in seconds, recording).
        output: file to write.
        spool: the run's spool folder.
        exports: (place in `lines`, kind, file) of each curve file to write as well.
    """

    target: int
    language: str
    lines: tuple[tuple[int, str, float, Path], ...]
    output: Path
    spool: Path
    exports: tuple[tuple[int, str, Path], ...] = ()


@dataclass(frozen=True)
class AssemblyItem:
    """Work on the file that joins one asset's languages.

    Attributes:
        target: index into the context's targets.
        files: (language, file) of each language that was written.
        output: file to write.
        spool: the run's spool folder.
        package: file to pack it all into, or None.
    """

    target: int
    files: tuple[tuple[str, Path], ...]
    output: Path
    spool: Path
    package: Path | None


@dataclass(frozen=True)
class AssetOutcome:
    """What became of a file: the files written, and what its checks found."""

    outputs: tuple[Path, ...]
    findings: tuple[Finding, ...]


def save_context(context: RunContext, spool: Path) -> None:
    """Put the context where every worker finds it."""
    path = spool / "context.pickle"
    try:
        path.write_bytes(pickle.dumps(context))
    except OSError as error:
        raise unwritable(path, error) from error


@lru_cache(maxsize=1)
def _context(spool: Path) -> RunContext:
    # Our own file, in a folder that only this user can write to.
    context: RunContext = pickle.loads((spool / "context.pickle").read_bytes())
    return context


def make_line(item: LineItem) -> LineOutcome:
    """Ingest, align, synthesize and retarget one line; its curves go to the spool."""
    context = _context(item.spool)

    def animate(alignment: Alignment) -> Iterator[Finding]:
        yield from _animate(item, context, alignment)

    def save(alignment: Alignment, spoken: Spoken | None) -> None:
        _save_alignment(context.output, item.line, alignment)
        if spoken is not None:
            registry.stage("write-speech")(spoken, speech_path(context.output, item.line))

    return _timed_line(
        item.line,
        Means(context.aligner, context.lexicon, voice_of(context.voices, item.line)),
        animate,
        save,
        speak=context.speak,
    )


def align_line(item: AlignItem) -> LineOutcome:
    """Ingest and align one line, and write its timings."""

    def save(alignment: Alignment, _: Spoken | None) -> None:
        if item.output is not None:
            registry.stage("write-timings")(alignment.track, item.output, item.format)

    means = Means(item.aligner, item.lexicon, voice_of(item.voices, item.line))
    return _timed_line(item.line, means, lambda _: (), save)


def _timed_line(
    line: Line,
    means: Means,
    use: Callable[[Alignment], Iterable[Finding]],
    save: Callable[[Alignment, Spoken | None], None],
    *,
    speak: bool = False,
) -> LineOutcome:
    """Ingest and align one line, `use` its alignment, and `save` it if nothing is wrong.

    With `speak`, a line without a recording is spoken.
    """
    findings = list(line.findings)
    if findings:
        return LineOutcome(0.0, tuple(replace(f, line=line.key) for f in findings))
    speech: Speech | None = None
    alignment: Alignment | None = None
    spoken: Spoken | None = None
    try:
        if speak and line.timings is None and not line.audio.exists():
            spoken = _speak(line)
            speech, alignment = spoken.speech, spoken.alignment
        else:
            speech = registry.stage("read-speech")(line.audio)
            assert speech is not None
            alignment = align_speech(
                speech,
                _transcript(line),
                line.timings,
                language=line.language,
                means=means,
            )
        findings += [*speech.findings, *alignment.findings, *use(alignment)]
        if not any(finding.severity == Severity.ERROR for finding in findings):
            save(alignment, spoken)
    except InputError as error:
        findings.append(Finding.from_error(error))
    return LineOutcome(
        speech.duration_s if speech else 0.0,
        tuple(replace(f, line=line.key) for f in findings),
        alignment.score if alignment else None,
        spoken is not None,
    )


def _transcript(line: Line) -> Callable[[], str] | None:
    """Reads the line's transcript; None where timings may do without."""
    if line.timings is not None and not has_transcript(line):
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


def alignment_path(output: Path, line: Line) -> Path:
    """Where a run puts a line's alignment."""
    return output / "alignments" / f"{line.key}.json"


def speech_path(output: Path, line: Line) -> Path:
    """Where a run puts what it spoke for a line without a recording."""
    return output / "speech" / f"{line.key}.wav"


def _save_alignment(output: Path, line: Line, alignment: Alignment) -> None:
    document = json.dumps(alignment.track.to_document(), ensure_ascii=False, indent=1)
    write_text(alignment_path(output, line), document + "\n")


@lru_cache(maxsize=8)
def _model(spool: Path, own: ModelChoice | None) -> Model:
    # Once per run and process: the next run may find another model in the same file.
    if own is not None:
        return registry.load_model(own.name, file=own.file)
    context = _context(spool)
    return registry.load_model(context.model, file=context.model_file)


def _animate(item: LineItem, context: RunContext, alignment: Alignment) -> Iterator[Finding]:
    def model(own: Hashable) -> Model:
        assert own is None or isinstance(own, ModelChoice)
        return _model(item.spool, own)

    targets = [context.targets[index] for index in item.targets]
    motion = LineMotion(item.line, alignment.track, context.curves, model)
    yield from motion.strangers([target.character for target in targets])
    for index, target in zip(item.targets, targets, strict=True):
        try:
            made = motion.of(target.character, target.asset, target.rig, target.model)
        except InputError as error:
            yield Finding.from_error(error, character=target.character)
            continue
        subject = LineSubject(motion.track, made.controls, target.rig, made.heard)
        checked = (found for check in registry.checks("line") for found in check.run(subject))
        for finding in (*made.findings, *checked):
            yield replace(finding, character=target.character)
        path = _spooled(item.spool, item.number, index)
        _save_curves(path, made.shapes, motion.track.events)
    # What a character's own model says is a finding of that character.
    for own, character in dict.fromkeys((t.model, t.character if t.model else "") for t in targets):
        for finding in motion.remarks(own):
            yield replace(finding, character=character)


def _spooled(spool: Path, number: int, target: int) -> Path:
    return spool / f"{number}-{target}.npz"


def _save_curves(path: Path, curves: CurveSet, events: tuple[Event, ...]) -> None:
    try:
        np.savez(
            path,
            times_s=curves.times_s,
            names=np.array(curves.names),
            weights=curves.weights,
            tags=np.array([event.tag for event in events], str),
            tag_times_s=np.array([event.time_s for event in events], float),
        )
    except OSError as error:
        raise unwritable(path, error) from error


def _load_curves(path: Path) -> tuple[CurveSet, tuple[Event, ...]]:
    with np.load(path, allow_pickle=False) as data:
        names = tuple(str(name) for name in data["names"])
        curves = CurveSet(data["times_s"], names, data["weights"])
        tags = zip(data["tags"].tolist(), data["tag_times_s"].tolist(), strict=True)
        return curves, tuple(Event(tag, time_s) for tag, time_s in tags)


def _animations(item: AssetItem, target: Target, context: RunContext) -> tuple[LineAnimation, ...]:
    """What goes into one file."""
    loaded = [_load_curves(_spooled(item.spool, n, item.target)) for n, *_ in item.lines]
    curves = [shapes for shapes, _ in loaded]
    if not target.asset.animations:  # else theirs would show where ours has no curve
        meshes = [[target.asset.canonical[s] for s in mesh.shapes] for mesh in target.asset.meshes]
        curves = drop_still(curves, target.asset.rest_weights(), meshes)
    lead_s = context.curves.preroll_s
    return tuple(
        LineAnimation(name, item.language, shapes, length_s, events, lead_s, audio)
        for (_, name, length_s, audio), shapes, (_, events) in zip(
            item.lines, curves, loaded, strict=True
        )
    )


def _exported(
    item: AssetItem,
    lines: Sequence[LineAnimation],
    rig: BoundRig,
    context: RunContext,
    findings: list[Finding],
) -> Iterator[Path]:
    """Write the curve files; one that cannot be written is a finding of its line."""
    for place, kind, path in item.exports:
        line = lines[place]
        try:
            noted = registry.stage("write-curves")(
                line.curves, path, kind, rig=rig, frame_rate=context.curves.frame_rate
            )
        except InputError as error:
            # The line itself is in its asset: what a format has no place for is for review.
            lost = error.code == "output-unwritable"
            found = Finding.from_error(error, line=line.name)
            severity = Severity.ERROR if lost else Severity.WARNING
            findings.append(replace(found, severity=severity))
            continue
        findings += [replace(finding, line=line.name) for finding in noted]
        yield path


class _RejectedError(Exception):
    """A written file did not pass its checks."""


def write_asset(item: AssetItem) -> AssetOutcome:
    """Write one asset with its lines; it takes its place only if it passes its checks."""
    context = _context(item.spool)
    target = context.targets[item.target]
    form = target.format
    lines = _animations(item, target, context)
    findings: list[Finding] = []

    def verify(path: Path) -> None:
        subject = AssetSubject(target.asset, form, path, lines)
        for check in registry.checks("asset"):
            findings.extend(check.run(subject))
        if any(finding.severity == Severity.ERROR for finding in findings):
            raise _RejectedError

    def write() -> tuple[Path, ...]:
        outputs = form.write(target.asset, lines, item.output, verify=verify)
        return (*outputs, *_exported(item, lines, target.rig, context, findings))

    return _written(
        write,
        findings,
        target.character,
        item.output,
    )


def join_languages(item: AssemblyItem) -> AssetOutcome:
    """Write the file that joins one asset's languages, if it does no harm."""
    target = _context(item.spool).targets[item.target]
    form = target.format
    findings: list[Finding] = []

    def verify(path: Path) -> None:
        findings.extend(
            Finding(Severity.ERROR, "asset-harmed", problem, action="Please report it.", ours=True)
            for problem in form.harm(target.asset, path)
        )
        if findings:
            raise _RejectedError

    files = dict(item.files)
    joined = _written(
        lambda: form.write_assembly(target.asset, files, item.output, verify=verify),
        findings,
        target.character,
        item.output,
    )
    package = item.package
    if package is None or not joined.outputs:
        return joined
    remarks: list[Finding] = []

    def pack() -> tuple[Path, ...]:
        remarks.extend(registry.stage("package-usdz")(target.asset, item.output, files, package))
        return (package,)

    packed = _written(pack, remarks, target.character, package)
    return AssetOutcome(joined.outputs + packed.outputs, joined.findings + packed.findings)


def _written(
    write: Callable[[], tuple[Path, ...]], findings: list[Finding], character: str, output: Path
) -> AssetOutcome:
    """Write, and say what came of it."""
    outputs: tuple[Path, ...] = ()
    try:
        outputs = write()
    except _RejectedError:
        # The checks saw the file under its temporary name, which is gone.
        findings = [replace(finding, place=str(output)) for finding in findings]
    except InputError as error:
        findings = [*findings, Finding.from_error(error)]
    return AssetOutcome(outputs, tuple(replace(f, character=character) for f in findings))
