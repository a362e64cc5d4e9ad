"""The kinds of work in a run, as functions that any executor can call: the work on lines.

What goes in and out is small: paths, keys, findings. Curves travel through the store. The work on
files is in `animeme.writing`.
"""

from __future__ import annotations

import pickle
from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import lru_cache, partial
from pathlib import Path
from typing import Any

from animeme import registry, steps
from animeme.contracts import Format, Model
from animeme.curves import CurveSet
from animeme.dialogue import Line, voice_of
from animeme.errors import InputError
from animeme.files import sha256, stamp, unwritable, write_bytes
from animeme.findings import Finding, Severity
from animeme.job import ModelChoice
from animeme.phones import PhoneTrack
from animeme.rig import BoundRig, Character
from animeme.shaping import CurveOptions, LineMotion, drawn
from animeme.store.entries import Entry, Store
from animeme.store.keys import key_of


@dataclass(frozen=True)
class Target:
    """One asset of one character, ready to be driven.

    Attributes:
        character: the character's name in the job.
        asset: what its format read.
        rig: its bound profile.
        suffix: of the files that are written from it.
        assembly_suffix: of the file that joins its languages, "" where there is none.
        inputs: files besides `asset.source` that it is made of.
        model: the character's own, None for the job's.
        model_files: files that its model is made of, none for one as shipped.
        layout: how its lines are laid out in files.
    """

    character: str
    asset: Character
    rig: BoundRig
    suffix: str
    assembly_suffix: str
    inputs: tuple[Path, ...] = ()
    model: ModelChoice | None = None
    model_files: tuple[Path, ...] = ()
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
        output: the run's output folder, None if lines deliver nothing.
        speak: speak transcripts that have no recording.
        store: folder of the store.
        prefixes: what all lines' curves on each target depend on: of its model, of its rig.
        watched: (file that all lines depend on, its stamp when the run began).
    """

    targets: tuple[Target, ...]
    aligner: str
    lexicon: Path | None
    voices: Path | None
    model: str | None
    model_file: Path | None
    curves: CurveOptions
    output: Path | None
    speak: bool
    store: Path
    prefixes: tuple[tuple[str, str], ...]
    watched: tuple[tuple[str, str], ...]


@dataclass(frozen=True, slots=True)
class LineKeys:
    """What the results of a line are found under.

    Attributes:
        align: the key of its alignment, "" if one of its files cannot be read.
        by_hand: (character, what its curves depend on besides that) where files by hand tell.
        end: the key of how the line ends, "" as `align`.
    """

    align: str
    by_hand: tuple[tuple[str, str], ...] = ()
    end: str = ""


@dataclass(frozen=True, slots=True)
class LineItem:
    """Work on one line: recording to shape curves.

    Attributes:
        line: the line.
        targets: indices of the context's targets that speak it.
        spool: the run's spool folder; it holds the context.
        number: of the line.
        keys: of its results.
        stamps: (file of the line, its stamp when its digest was taken).
    """

    line: Line
    targets: tuple[int, ...]
    spool: Path
    number: int
    keys: LineKeys = LineKeys("")
    stamps: tuple[tuple[str, str], ...] = ()


@dataclass(frozen=True, slots=True)
class Delivered:
    """A file that a run wrote: its digest, and its stamp as it was then."""

    path: Path
    digest: str
    stamp: str


@dataclass(frozen=True, slots=True)
class LineOutcome:
    """What became of a line.

    Attributes:
        audio_s: length of the recording, 0 if it could not be read.
        findings: those of the line itself have no character; the others name theirs.
        score: the aligner's confidence, 0 to 1, or None.
        spoken: there is no recording, the line was spoken.
        alignment: key of its alignment in the store, "" if there is none.
        curves: target → key and digest of its curves.
        final: it holds until something that the line was made from changes.
        effort: (step, CPU seconds, whether its result was in the store).
        delivered: files that were written.
        damaged: keys of results in the store that were not what had been put there.
    """

    audio_s: float
    findings: tuple[Finding, ...]
    score: float | None = None
    spoken: bool = False
    alignment: str = ""
    curves: tuple[tuple[int, str, str], ...] = ()
    final: bool = False
    effort: tuple[tuple[str, float, bool], ...] = field(default=(), compare=False)
    delivered: tuple[Delivered, ...] = field(default=(), compare=False)
    damaged: tuple[str, ...] = field(default=(), compare=False)


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
        plot: picture to draw of any line that has timings, or None.
    """

    line: Line
    aligner: str
    lexicon: Path | None
    voices: Path | None
    output: Path | None
    format: str
    plot: Path | None = None


AssetLine = tuple[int, str, float, str, Path]
"""Number of a line, name of its animation, length in seconds, key of its curves, recording."""


@dataclass(frozen=True, slots=True)
class AssetItem:
    """Work on one file: curves of its lines into an asset.

    Attributes:
        target: index into the context's targets.
        language: folder name and tag.
        lines: what goes into it.
        output: file to write.
        spool: the run's spool folder.
        exports: (number of the line, kind, file) of each curve file to write as well.
    """

    target: int
    language: str
    lines: tuple[AssetLine, ...]
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
        sounds: recordings that a package may hold.
    """

    target: int
    files: tuple[tuple[str, Path], ...]
    output: Path
    spool: Path
    package: Path | None
    sounds: tuple[Path, ...] = ()


@dataclass(frozen=True, slots=True)
class AssetOutcome:
    """What became of a file.

    Attributes:
        outputs: the files written, none where it was refused.
        findings: what its checks found.
        lost: numbers of lines whose curves are no longer in the store; nothing was written.
        delivered: `outputs` with their digests.
        final: as of `LineOutcome`.
    """

    outputs: tuple[Path, ...]
    findings: tuple[Finding, ...]
    lost: tuple[int, ...] = ()
    delivered: tuple[Delivered, ...] = field(default=(), compare=False)
    final: bool = False


def save_context(context: RunContext, spool: Path) -> None:
    """Put the context where every worker finds it."""
    path = spool / "context.pickle"
    try:
        path.write_bytes(pickle.dumps(context))
    except OSError as error:
        raise unwritable(path, error) from error


@lru_cache(maxsize=1)
def context_of(spool: Path) -> RunContext:
    """What `save_context` put into a spool folder."""
    # Our own file, in a folder that only this user can write to.
    context: RunContext = pickle.loads((spool / "context.pickle").read_bytes())
    return context


def make_line(item: LineItem) -> LineOutcome:
    """Ingest, align, synthesize and retarget one line; results go to the store."""
    context, line, keys = context_of(item.spool), item.line, item.keys
    if line.findings:
        return LineOutcome(0.0, steps.for_line(line.findings, line.key))
    stores = Store(context.store), private_store(item.spool)
    work = steps.Steps(*stores, lambda: _unchanged(item, context))
    try:
        key, entry = work.align(keys.align, line, context)
    except InputError as error:  # the store cannot be written
        return LineOutcome(0.0, (Finding.from_error(error, line=line.key),))
    value, track = entry.value, steps.track_of(entry)
    tokens = steps.places(line, context)
    findings = list(steps.unpacked(value["findings"], tokens, line=line.key))
    curves: tuple[tuple[int, str, str], ...] = ()
    delivered: tuple[Delivered, ...] = ()
    try:
        if track is not None:
            curves = _animate(item, context, work, value["digest"], track, findings)
        good = not any(finding.severity == Severity.ERROR for finding in findings)
        if good and context.output is not None:
            delivered = deliver(context.output, line, *steps.delivered_parts(entry))
    except InputError as error:
        work.final &= not steps.is_passing(error)
        findings.append(Finding.from_error(error, line=line.key))
    return LineOutcome(
        value["audio_s"],
        tuple(findings),
        value["score"],
        value["spoken"],
        key if track is not None else "",
        curves,
        work.final and bool(keys.align),
        tuple(work.effort),
        delivered,
        tuple(work.store.damaged),
    )


def _animate(
    item: LineItem,
    context: RunContext,
    work: steps.Steps,
    digest: str,
    track: PhoneTrack,
    findings: list[Finding],
) -> tuple[tuple[int, str, str], ...]:
    """(target, key, digest) of the curves of a line whose alignment has a digest."""
    line = item.line
    motion = LineMotion(line, track, context.curves)
    targets = [context.targets[index] for index in item.targets]
    tokens = steps.places(line, context)
    findings += steps.for_line(motion.strangers([t.character for t in targets]), line.key)
    moved: dict[ModelChoice | None, Entry] = {}
    curves = []

    def said(rows: list[list[Any]], places: Mapping[str, str], character: str) -> None:
        findings.extend(steps.unpacked(rows, places, line=line.key, character=character))

    for index, target in zip(item.targets, targets, strict=True):
        own, controls = target.model, None
        if drawn(line, target.character) is None:
            if own not in moved:
                model = partial(_model, item.spool, own)
                made = synthesize_key(context, item.keys, index, digest)
                moved[own] = work.controls(made, motion, model, target, context.curves.rate_hz)
            controls = moved[own]
            if not controls.payload:
                said(controls.value["findings"], steps.model_places(target), target.character)
                continue
        made = retarget_key(context, item.keys, index, controls, digest)
        given = partial(_controls, controls)
        made, shaped = work.shapes(made, motion, given, target, tokens)
        said(shaped.value["findings"], tokens, target.character)
        curves += [(index, made, shaped.digest)] if shaped.payload else []
    # What a character's own model says is a finding of that character.
    whose = {(t.model, t.character if t.model else ""): t for t in reversed(targets)}
    for (own, character), target in whose.items():
        if own in moved and moved[own].payload:
            said(moved[own].value["findings"], steps.model_places(target), character)
    return tuple(curves)


def _controls(entry: Entry | None) -> CurveSet | None:
    return None if entry is None else steps.curves_of(entry.payload)[0]


def synthesize_key(context: RunContext, keys: LineKeys, target: int, alignment: str) -> str:
    """The key of the curves of a target's model, given the alignment's digest; "" if none."""
    parts = (context.prefixes[target][0], alignment)
    return key_of("synthesize", parts) if keys.align else ""


def retarget_key(
    context: RunContext, keys: LineKeys, target: int, controls: Entry | None, alignment: str
) -> str:
    """The key of a target's curves, given those of its model, if they come from one."""
    by_hand = dict(keys.by_hand).get(context.targets[target].character, "")
    given = "" if controls is None else controls.digest
    parts = (context.prefixes[target][1], given, alignment, by_hand)
    return key_of("retarget", parts) if keys.align else ""


def private_store(spool: Path) -> Store:
    """Where a run keeps what is good for itself alone."""
    return Store(spool / "store")


def _unchanged(item: LineItem, context: RunContext) -> bool:
    """Whether the line was made from the files that its keys are about."""
    return all(stamp(path) == known for path, known in (*item.stamps, *context.watched))


def deliver(output: Path, line: Line, document: bytes, speech: bytes) -> tuple[Delivered, ...]:
    """Put a line's alignment, and what was spoken for it, into the output folder."""
    files = [alignment_file(output, line)] + ([speech_file(output, line)] if speech else [])
    paths = [Path(file) for file in files]
    for path, data in zip(paths, (document, speech), strict=False):
        write_bytes(path, data, durable=False)  # made again if a crash of the machine damages it
    return delivered(paths)


def delivered(paths: list[Path]) -> tuple[Delivered, ...]:
    """The files as they are now, just written."""
    return tuple(Delivered(path, sha256(path), stamp(path)) for path in paths)


def align_line(item: AlignItem) -> LineOutcome:
    """Ingest and align one line, and write its timings."""
    line = item.line
    if line.findings:
        return LineOutcome(0.0, steps.for_line(line.findings, line.key))
    means = steps.Means(item.aligner, item.lexicon, voice_of(item.voices, line))
    timed = steps.time_line(line, means)
    findings = list(timed.findings)
    good = not any(finding.severity == Severity.ERROR for finding in findings)
    if good and timed.track is not None and item.output is not None:
        try:
            registry.stage("write-timings")(timed.track, item.output, item.format)
        except InputError as error:
            findings.append(Finding.from_error(error))
    if timed.track is not None and item.plot is not None:
        try:
            registry.stage("plot-alignment")(
                line.audio, timed.track, findings, item.plot, title=line.key
            )
        except InputError as error:
            findings.append(Finding.from_error(error))
    return LineOutcome(timed.audio_s, steps.for_line(findings, line.key), timed.score)


def alignment_file(output: Path, line: Line) -> str:
    """Where a run puts a line's alignment, as a string: there may be many thousands."""
    return f"{output}/alignments/{line.key}.json"


def speech_file(output: Path, line: Line) -> str:
    """Where a run puts what it spoke for a line without a recording, as a string too."""
    return f"{output}/speech/{line.key}.wav"


@lru_cache(maxsize=8)
def _model(spool: Path, own: ModelChoice | None) -> Model:
    # Once per run and process: the next run may find another model in the same file.
    if own is not None:
        return registry.load_model(own.name, file=own.file)
    context = context_of(spool)
    return registry.load_model(context.model, file=context.model_file)
