"""The kinds of work in a run as functions that any executor can call: the work on lines.

Curves travel through the store. The work on files is in `animeme.writing`.
"""

from __future__ import annotations

from collections.abc import Mapping
from functools import lru_cache, partial
from pathlib import Path
from typing import Any

from animeme import packing, registry, steps
from animeme.contracts import Model
from animeme.curves import CurveSet
from animeme.dialogue import voice_of
from animeme.errors import InputError
from animeme.files import stamp
from animeme.findings import Finding, Severity
from animeme.job import ModelChoice
from animeme.phones import PhoneTrack
from animeme.shaping import LineMotion
from animeme.side_cars import drawn
from animeme.store.entries import Entry, Store
from animeme.tasks import (
    AlignItem,
    Delivered,
    LineItem,
    LineOutcome,
    RunContext,
    context_of,
    deliver,
    private_store,
    retarget_key,
    synthesize_key,
)


def make_line(item: LineItem) -> LineOutcome:
    """Ingest, align, synthesize and retarget one line; results go to the store."""
    context, line, keys = context_of(item.spool), item.line, item.keys
    if line.findings:
        return LineOutcome(0.0, packing.for_line(line.findings, line.key))
    stores = Store(context.store), private_store(item.spool)
    work = steps.Steps(*stores, lambda: _unchanged(item, context))
    try:
        key, entry = work.align(keys.align, line, context)
    except InputError as error:  # the store cannot be written
        return LineOutcome(0.0, (Finding.from_error(error, line=line.key),))
    value, track = entry.value, steps.track_of(entry)
    tokens = packing.places(line, context)
    findings = list(packing.unpacked(value["findings"], tokens, line=line.key))
    curves: tuple[tuple[int, str, str], ...] = ()
    delivered: tuple[Delivered, ...] = ()
    try:
        if track is not None:
            curves = _animate(item, context, work, value["digest"], track, findings)
        good = not any(finding.severity == Severity.ERROR for finding in findings)
        if good and context.output is not None:
            delivered = deliver(context.output, line, *packing.delivered_parts(entry))
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
    tokens = packing.places(line, context)
    findings += packing.for_line(motion.strangers([t.character for t in targets]), line.key)
    moved: dict[ModelChoice | None, Entry] = {}
    curves = []

    def said(rows: list[list[Any]], places: Mapping[str, str], character: str) -> None:
        findings.extend(packing.unpacked(rows, places, line=line.key, character=character))

    for index, target in zip(item.targets, targets, strict=True):
        own, controls = target.model, None
        if drawn(line, target.character) is None:
            if own not in moved:
                model = partial(_model, item.spool, own)
                made = synthesize_key(context, item.keys, index, digest)
                moved[own] = work.controls(made, motion, model, target, context.curves.rate_hz)
            controls = moved[own]
            if not controls.payload:
                said(controls.value["findings"], packing.model_places(target), target.character)
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
            said(moved[own].value["findings"], packing.model_places(target), character)
    return tuple(curves)


def _controls(entry: Entry | None) -> CurveSet | None:
    return None if entry is None else steps.curves_of(entry.payload)[0]


def _unchanged(item: LineItem, context: RunContext) -> bool:
    """Whether the line was made from the files that its keys are about."""
    return all(stamp(path) == known for path, known in (*item.stamps, *context.watched))


@lru_cache(maxsize=8)
def _model(spool: Path, own: ModelChoice | None) -> Model:
    # Once per run and process: the next run may find another model in the same file.
    if own is not None:
        return registry.load_model(own.name, file=own.file)
    context = context_of(spool)
    return registry.load_model(context.model, file=context.model_file)


def align_line(item: AlignItem) -> LineOutcome:
    """Ingest and align one line, and write its timings."""
    line = item.line
    if line.findings:
        return LineOutcome(0.0, packing.for_line(line.findings, line.key))
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
    return LineOutcome(timed.audio_s, packing.for_line(findings, line.key), timed.score)
