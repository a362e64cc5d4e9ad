"""The kinds of work in a run, as functions that any executor can call: the work on files."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import replace
from pathlib import Path

from animeme import registry, steps
from animeme.contracts import AssetSubject, LineAnimation
from animeme.curves import drop_still
from animeme.errors import InputError
from animeme.files import let_go, stamp
from animeme.findings import Finding, Severity
from animeme.rig import BoundRig
from animeme.store.entries import Entry, Store
from animeme.tasks import (
    AssemblyItem,
    AssetItem,
    AssetOutcome,
    RunContext,
    Target,
    context_of,
    delivered,
    private_store,
)


class _RejectedError(Exception):
    """A written file did not pass its checks."""


def write_asset(item: AssetItem) -> AssetOutcome:
    """Write one asset with its lines; it takes its place only if it passes its checks."""
    context, output = context_of(item.spool), Path(item.output)
    target = context.targets[item.target]
    stores = (Store(context.store), private_store(item.spool))
    entries: list[Entry] = []
    lost: list[int] = []
    for number, _, _, key, _ in item.lines:
        entry = next((found for store in stores if (found := store.get(key))), None)
        if entry is None:
            lost.append(number)
        else:
            entries.append(entry)
    if lost:
        return AssetOutcome((), (), tuple(lost))
    form = target.format
    lines = _animations(item, target, entries, context)
    findings: list[Finding] = []

    def verify(path: Path) -> None:
        subject = AssetSubject(target.asset, form, path, lines)
        for check in registry.checks(registry.ASSET_CHECKS):
            findings.extend(check.run(subject))
        if any(finding.severity == Severity.ERROR for finding in findings):
            raise _RejectedError

    def write() -> tuple[Path, ...]:
        outputs = form.write(target.asset, lines, output, verify=verify)
        by_number = {entry[0]: line for entry, line in zip(item.lines, lines, strict=True)}
        return (*outputs, *_exported(item, by_number, target.rig, context, findings))

    return _written(write, findings, target, output)


def _animations(
    item: AssetItem, target: Target, entries: Sequence[Entry], context: RunContext
) -> tuple[LineAnimation, ...]:
    """What goes into one file."""
    loaded = [steps.curves_of(entry.payload) for entry in entries]
    curves = [shapes for shapes, _ in loaded]
    if not target.asset.animations:  # else theirs would show where ours has no curve
        meshes = [[target.asset.canonical[s] for s in mesh.shapes] for mesh in target.asset.meshes]
        curves = drop_still(curves, target.asset.rest_weights(), meshes)
    lead_s = context.curves.preroll_s
    return tuple(
        LineAnimation(name, item.language, shapes, length_s, events, lead_s, Path(audio))
        for (_, name, length_s, _, audio), shapes, (_, events) in zip(
            item.lines, curves, loaded, strict=True
        )
    )


def _exported(
    item: AssetItem,
    lines: Mapping[int, LineAnimation],
    rig: BoundRig,
    context: RunContext,
    findings: list[Finding],
) -> Iterator[Path]:
    """Write the curve files; one that cannot be written is a finding of its line."""
    for number, kind, path in item.exports:
        line = lines[number]
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


def join_languages(item: AssemblyItem) -> AssetOutcome:
    """Write the file that joins one asset's languages, if it does no harm."""
    target = context_of(item.spool).targets[item.target]
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
        target,
        item.output,
    )
    package = item.package
    if package is None or not joined.outputs:
        return joined
    remarks: list[Finding] = []

    def pack() -> tuple[Path, ...]:
        remarks.extend(registry.stage("package-usdz")(target.asset, item.output, files, package))
        return (package,)

    packed = _written(pack, remarks, target, package, *item.sounds)
    return AssetOutcome(
        joined.outputs + packed.outputs,
        joined.findings + packed.findings,
        delivered=joined.delivered + packed.delivered,
        final=joined.final and packed.final,
    )


def _written(
    write: Callable[[], tuple[Path, ...]],
    findings: list[Finding],
    target: Target,
    output: Path,
    *more: Path,
) -> AssetOutcome:
    """Write, and say what came of it.

    Args:
        write: gives the files that it wrote.
        findings: what it notes.
        target: whose file it is.
        output: the file.
        more: files that it reads besides those of the asset.
    """
    outputs: tuple[Path, ...] = ()
    sources = [target.asset.source, *target.inputs, *more]
    before = [stamp(path) for path in sources]
    try:
        outputs = write()
    except _RejectedError:
        # The checks saw the file under its temporary name, which is gone.
        findings = [replace(finding, place=str(output)) for finding in findings]
    except InputError as error:
        findings = [*findings, Finding.from_error(error)]
    files = tuple(map(str, outputs))
    noted = delivered(files)
    for path in outputs:
        let_go(path)
    return AssetOutcome(
        files,
        tuple(replace(finding, character=target.character) for finding in findings),
        delivered=noted,
        final=bool(outputs) and before == [stamp(path) for path in sources],
    )
