"""What is looked at before a run touches its output folder."""

from __future__ import annotations

import filecmp
from collections import Counter
from collections.abc import Iterable, Iterator
from pathlib import Path

from animeme import registry
from animeme.dialogue import Line
from animeme.errors import InputError, JobError, Problem
from animeme.findings import Finding, Severity
from animeme.gathering import gather
from animeme.job import Job
from animeme.plan import Plan
from animeme.side_cars import with_side_cars
from animeme.tasks import Target


def load_plugins(job: Job) -> None:
    """Load every plug-in that the job uses.

    Raises:
        PluginError: one cannot be loaded; better now than once per line.
    """
    registry.aligner(job.aligner)
    registry.load_model(job.model, file=job.model_file)
    for character in job.characters:
        if character.model is not None:
            registry.load_model(character.model.name, file=character.model.file)
    for subject in ("line", "asset"):
        registry.checks(subject)
    for group in (registry.STAGES, registry.REPORTS):
        for plugin in registry.plugins(group).values():
            plugin.load()


def dialogue_of(job: Job) -> tuple[tuple[Line, ...], tuple[Finding, ...]]:
    """The job's lines, and findings about what is listed or lies beside them and belongs to none.

    Raises:
        JobError: there are none, or a list of them cannot be used.
    """
    characters = [character.name for character in job.characters]
    source = job.dialogue
    try:
        found = gather(source, characters, without=job.output)
    except InputError as error:
        problem = Problem("dialogue.manifest", f"{error.place}: {error.problem}", error.action)
        raise JobError(str(job.source), [problem]) from error
    if not found.lines:
        raise JobError(str(job.source), _nothing(job, found.findings))
    if found.folder is None:
        return found.lines, found.findings
    lines, strays = with_side_cars(found.folder, found.lines, characters)
    return lines, (*found.findings, *strays)


def _nothing(job: Job, findings: Iterable[Finding]) -> list[Problem]:
    """Why there is no line."""
    if job.dialogue.manifests:
        names = ", ".join(f"'{path}'" for path in job.dialogue.manifests)
        problem = Problem("dialogue.manifest", f"no line in {names} can be used")
        return [problem, *(Problem("", f"{f.place}: {f.message}", f.action) for f in findings)]
    message = f"no recording below '{job.dialogue.root}'"
    action = "It holds <language>/<line>.wav with a .txt beside each."
    return [Problem("dialogue.root", message, action)]


def load_targets(job: Job) -> tuple[list[Target], list[Finding]]:
    """Assets that can be driven, and findings about those that cannot or lack something.

    Raises:
        JobError: none can.
    """
    targets: list[Target] = []
    findings: list[Finding] = []
    controls = registry.load_model(job.model, file=job.model_file).controls
    for character in job.characters:
        for path in character.assets:
            try:
                asset = registry.format_of(path).load(path, within=character.asset_root)
                rig = registry.stage("bind-rig")(
                    character.rig, asset, job.folder, controls=controls
                )
                target = Target(character.name, asset, rig, character.model, character.layout)
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
    names = ", ".join(
        f"{shape} (moved instead: {target.rig.fallbacks[shape].shape})"
        if shape in target.rig.fallbacks
        else shape
        for shape in target.rig.missing
    )
    return Finding(
        Severity.INFO,
        "rig-shapes-missing",
        f"the rig lacks {len(target.rig.missing)} shapes of '{target.rig.profile.name}': {names}",
        place=str(target.asset.source),
        character=target.character,
    )


def missing_voices(job: Job) -> list[Finding]:
    """A warning where the job's voices are not there."""
    if job.voices is None or job.voices.exists():
        return []
    return [
        Finding(
            Severity.WARNING,
            "voices-missing",
            "there are no such voices: lines are aligned as if nobody knew their speakers",
            place=str(job.voices),
            action=f"Learn them: animeme voice {job.source}.",
        )
    ]


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


def require_distinct_curve_files(plan: Plan) -> None:
    """Make sure that no two lines' curves go to one file.

    Raises:
        JobError: names each file that would be written twice.
    """
    counts = Counter(plan.curve_files())
    twice = sorted(path for path, count in counts.items() if count > 1)
    if twice:
        action = "Rename one of the lines, or export fewer kinds."
        problems = [
            Problem("curves.export", f"two lines would write '{path}'", action) for path in twice
        ]
        raise JobError(str(plan.job.source), problems)


def _inputs(plan: Plan) -> Iterator[Path]:
    job = plan.job
    yield job.source
    yield from job.dialogue.files
    yield from (target.asset.source for target in plan.targets)
    yield from (job.folder / character.rig for character in job.characters)
    own = (character.model.file for character in job.characters if character.model is not None)
    yield from (path for path in (job.model_file, job.lexicon, job.voices, *own) if path)
    for line in plan.lines:
        yield from (line.audio, line.transcript)
        yield from () if line.timings is None else (line.timings,)
        yield from (car.path for car in line.side_cars)


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
