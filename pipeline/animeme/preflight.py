"""What is looked at before a run touches its output folder."""

from __future__ import annotations

import filecmp
from collections.abc import Iterable, Iterator
from pathlib import Path

from animeme import registry
from animeme.dialogue import Line, find_lines
from animeme.errors import InputError, JobError, Problem
from animeme.findings import Finding, Severity
from animeme.job import Job
from animeme.plan import Plan
from animeme.tasks import Target


def load_plugins(job: Job) -> None:
    """Load every plug-in that the job uses.

    Raises:
        PluginError: one cannot be loaded; better now than once per line.
    """
    registry.aligner(job.aligner)
    registry.load_model(job.model, file=job.model_file)
    for subject in ("line", "asset"):
        registry.checks(subject)
    for group in (registry.STAGES, registry.REPORTS):
        for plugin in registry.plugins(group).values():
            plugin.load()


def dialogue_of(job: Job) -> tuple[Line, ...]:
    """The job's lines.

    Raises:
        JobError: there are none.
    """
    lines = find_lines(job.dialogue_root, [character.name for character in job.characters])
    if not lines:
        message = f"no recording below '{job.dialogue_root}'"
        action = "It holds <language>/<line>.wav with a .txt beside each."
        raise JobError(str(job.source), [Problem("dialogue.root", message, action)])
    return lines


def load_targets(job: Job) -> tuple[list[Target], list[Finding]]:
    """Assets that can be driven, and findings about those that cannot or lack something.

    Raises:
        JobError: none can.
    """
    targets: list[Target] = []
    findings: list[Finding] = []
    for character in job.characters:
        for path in character.assets:
            try:
                asset = registry.format_of(path).load(path)
                rig = registry.stage("bind-rig")(character.rig, asset, job.folder)
                target = Target(character.name, asset, rig, character.layout)
                _ = target.format  # refuses a layout that this asset cannot have
            except InputError as error:
                findings.append(Finding.from_error(error, character=character.name))
                continue
            targets.append(target)
            if rig.missing:
                findings.append(_missing_shapes(targets[-1]))
    # A character with one broken asset is broken: half a delivery would pass for a whole one.
    broken = [finding for finding in findings if finding.severity == Severity.ERROR]
    lost = {finding.character for finding in broken}
    targets = [target for target in targets if target.character not in lost]
    if not targets:
        problems = [
            Problem(f"characters.{f.character}", f"{f.place}: {f.message}", f.action)
            for f in broken
        ]
        raise JobError(str(job.source), problems)
    return targets, findings


def _missing_shapes(target: Target) -> Finding:
    names = ", ".join(target.rig.missing)
    return Finding(
        Severity.INFO,
        "rig-shapes-missing",
        f"the rig lacks {len(target.rig.missing)} shapes of '{target.rig.profile.name}': {names}",
        place=str(target.asset.source),
        character=target.character,
    )


def require_free_outputs(plan: Plan) -> None:
    """Make sure that no file which the run reads is one that it would write.

    Raises:
        JobError: names each input in the way.
    """
    output = plan.job.output.resolve()
    inputs = {path.resolve() for path in _inputs(plan)}
    near = {path for path in inputs if path.is_relative_to(output)}
    if not near:
        return
    clashes = sorted(near & {path.resolve() for path in plan.possible_outputs()})
    if clashes:
        action = "Choose another output folder."
        raise JobError(
            str(plan.job.source),
            [
                Problem("job.output", f"'{path}' is read, and would be written", action)
                for path in clashes
            ],
        )


def _inputs(plan: Plan) -> Iterator[Path]:
    job = plan.job
    yield job.source
    yield from (target.asset.source for target in plan.targets)
    yield from (job.folder / character.rig for character in job.characters)
    yield from (path for path in (job.model_file, job.lexicon) if path is not None)
    for line in plan.lines:
        yield from (line.audio, line.transcript)
        yield from () if line.timings is None else (line.timings,)


def stale_outputs(plan: Plan, written: Iterable[Path]) -> Iterator[Finding]:
    """A warning for each file of an earlier run that this one would have written, but did not."""
    fresh = set(written)
    for path in plan.possible_files():
        if path not in fresh and path.is_file():
            yield Finding(
                Severity.WARNING,
                "output-stale",
                "is from an earlier run: this one had nothing good to put in its place",
                place=path.relative_to(plan.job.output).as_posix(),
                action="Do not deliver it; mend its lines and run again, or delete it.",
            )


def require_distinct_companions(plan: Plan) -> None:
    """Make sure that no two assets bring different files to one place.

    Raises:
        JobError: names each file that two assets disagree on.
    """
    brought: dict[str, tuple[str, Path]] = {}
    problems = []
    for target in plan.targets:
        for name, file in target.format.companions(target.asset).items():
            if not file.is_file():
                continue
            character, other = brought.setdefault(name, (target.character, file))
            if not filecmp.cmp(other, file, shallow=False):
                message = (
                    f"'{name}' of its asset is not the one of '{character}', but goes there too"
                )
                action = "Deliver one of the two as .glb, or rename its file."
                problems.append(Problem(f"characters.{target.character}.asset", message, action))
    if problems:
        raise JobError(str(plan.job.source), problems)
