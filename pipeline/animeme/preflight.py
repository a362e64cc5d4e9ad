"""What is looked at before a run touches its output folder."""

from __future__ import annotations

import os
from collections.abc import Iterable, Iterator, Mapping
from contextlib import suppress
from dataclasses import dataclass
from functools import cache
from itertools import chain
from pathlib import Path
from typing import Any

from pydantic import TypeAdapter, ValidationError

from animeme import documents, registry
from animeme.contracts import Model
from animeme.dialogue import Line
from animeme.errors import InputError, JobError, Problem
from animeme.executors import LATER, Executor, resolve
from animeme.findings import Finding, Severity
from animeme.gathering import gather
from animeme.job import Job, check_job, model_files
from animeme.outputs import require_distinct_companions
from animeme.side_cars import with_side_cars
from animeme.store.keys import key_of
from animeme.store.memory import Memory
from animeme.tasks import MAKE_LINE, WRITE_ASSET, Target

# Assets of hundreds of megabytes open in seconds.
OPENING_TIMEOUT_S = 300.0


@dataclass(frozen=True)
class Prepared:
    """A job that has been looked at: it can be run.

    Attributes:
        targets: assets that can be driven.
        findings: about those that cannot, or lack something.
        inputs: digest of every file that an asset is made of and of every document, by path.
        code: digest of what was looked with.
    """

    targets: tuple[Target, ...]
    findings: tuple[Finding, ...]
    inputs: dict[str, str]
    code: str


def prepare(job: Job, memory: Memory, executor: Executor | None = None) -> Prepared:
    """Check a job's values, plug-ins and assets, unless that has been done for what they are now.

    Args:
        job: the job.
        memory: of what is known of files.
        executor: opens each asset before this process does: native code that a damaged file takes
            down takes down a worker.

    Raises:
        JobError: everything that is wrong with the job, or no asset could be driven, or two assets
            bring different files to one place.
        PluginError: a plug-in that the job needs cannot be loaded.
    """
    key = _prepared_key(job, memory)
    noted = memory.index.note(key) if key else None
    known = _known(noted) if noted is not None else None
    if known is not None:
        same = (memory.digests.of(path) == digest for path, digest in known.inputs.items())
        if known.code == _code(job, memory) and all(same):
            return known
    code = ""

    def meanwhile() -> Iterator[Any]:
        nonlocal code
        check_job(job)
        # Now, for all keys: what somebody changes from now on is not taken for what is loaded.
        code = _code(job, memory)
        yield LATER  # who is done with an asset by now gets ready at once
        if executor is not None:
            executor.get_ready("animeme.preflight:get_ready", job)
        load_plugins(job)

    with documents.reading() as files:
        targets, findings = load_targets(job, _deadly(job, executor, meanwhile()))
    require_distinct_companions(job, targets)
    files += [path for target in targets for path in (target.asset.source, *target.inputs)]
    digests = {str(path): memory.digests.of(path) for path in files}
    inputs = {path: digest or "" for path, digest in digests.items()}
    prepared = Prepared(tuple(targets), tuple(findings), inputs, code)
    # What is wrong with an asset may be a file that it cannot name.
    broken = any(finding.severity == Severity.ERROR for finding in findings)
    if key and not broken and None not in digests.values():
        memory.index.set_note(key, _PREPARED().dump_json(prepared).decode())
    return prepared


@cache
def _PREPARED() -> TypeAdapter[Prepared]:  # noqa: N802  made when it is needed
    return TypeAdapter(Prepared)


def _known(noted: str) -> Prepared | None:
    """What a note says; None if another version wrote it."""
    try:
        return _PREPARED().validate_json(noted)
    except ValidationError:
        return None


def _prepared_key(job: Job, memory: Memory) -> str:
    """What the answer of `prepare` depends on, but for code; "" if a file cannot be read."""
    files = [job.source, *(job.folder / character.rig for character in job.characters)]
    files += [path for path in (job.lexicon, *model_files(job)) if path is not None]
    files += [path for character in job.characters for path in character.assets]
    files += job.dialogue.files
    digests = [memory.digests.of(path) if not path.is_dir() else "folder" for path in files]
    root = job.dialogue.root
    if None in digests or not (root is None or root.is_dir()):
        return ""
    names = [f"{path}\n{digest}" for path, digest in zip(files, digests, strict=True)]
    return key_of("prepared", [os.getcwd(), str(job.speak), *names])


def _code(job: Job, memory: Memory) -> str:
    """Digest of all code that a run of the job may run."""
    work = [function.partition(":")[0] for function in (MAKE_LINE, WRITE_ASSET)]
    return memory.code.of(_plugins_of(job), "animeme.preflight", *work)


def _plugins_of(job: Job) -> Iterator[registry.Plugin]:
    """The plug-ins that may have a say in a run of the job, as far as there are any."""
    named = {registry.ALIGNERS: {job.aligner}, registry.STAGES: {*_stages_of(job)}}
    if not any(model_files(job)):  # else any model may say that it reads one
        own = {c.model.name for c in job.characters if c.model is not None}
        named[registry.MODELS] = {job.model, *own}
    for group in registry.GROUPS:
        if group in (registry.DELIVERY_CHECKS, registry.PROFILES):
            continue  # judge deliveries
        for name, plugin in registry.plugins(group).items():
            if name in named.get(group, {name}):
                yield plugin


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
    for group in (registry.LINE_CHECKS, registry.ASSET_CHECKS):
        registry.checks(group)
    for name in _stages_of(job):
        registry.stage(name)
    for plugin in registry.plugins(registry.REPORTS).values():
        plugin.load()


def _stages_of(job: Job) -> Iterator[str]:
    """Names of the steps that a run of the job may take once its dialogue is listed."""
    yield from ("read-speech", "read-transcript", "read-timings", "timings-kind")
    yield from ("read-rig", "bind-rig", "retarget", "read-curves", "curve-files")
    if job.lexicon is not None:
        yield "check-lexicon"
    if job.speak:
        yield from ("speak", "write-speech")
    if job.curves.export:
        yield "write-curves"
    if any(character.usdz for character in job.characters):
        yield "package-usdz"


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


def _deadly(
    job: Job, executor: Executor | None, meanwhile: Iterable[Any]
) -> dict[Path, InputError]:
    """Assets whose reading ends or stops a process, as workers find; none if there are no workers.

    Args:
        job: whose assets.
        executor: has the workers.
        meanwhile: what this process does beside them; gives a `LATER` now and then.
    """
    if executor is None:
        for _ in meanwhile:
            pass
        return {}
    files = {path: c.asset_root for c in job.characters for path in c.assets}
    assets = files.items()
    # Who does one thing after another opens them when all else has been looked at.
    items = chain(assets, meanwhile) if executor.overlaps else chain(meanwhile, assets)
    results = executor.run(
        "animeme.preflight:try_asset", items, timeout_s=OPENING_TIMEOUT_S, retries=0
    )
    paths = list(files)
    return {
        paths[result.index]: InputError(
            "asset-unreadable",
            f"its reader {'hung' if result.outcome == 'timeout' else 'crashed'} over it",
            place=str(paths[result.index]),
            action="It is damaged: export or copy it again.",
        )
        for result in results
        if result.outcome in ("crash", "timeout")
    }


def try_asset(item: tuple[Path, Path | None]) -> None:
    """Open an asset as `load_targets` does, for whether that can be survived."""
    path, within = item
    with suppress(InputError):
        registry.format_of(path).load(path, within=within)


def get_ready(job: Job) -> None:
    """Load all that the work on a job's lines and assets may need."""
    load_plugins(job)
    for function in (MAKE_LINE, WRITE_ASSET):
        resolve(function)


def load_targets(job: Job, deadly: Mapping[Path, InputError]) -> tuple[list[Target], list[Finding]]:
    """Assets that can be driven, and findings about those that cannot or lack something.

    Args:
        job: the job.
        deadly: assets that must not be opened, and why.

    Raises:
        JobError: none can.
    """
    targets: list[Target] = []
    findings: list[Finding] = []
    model, model_files = _loaded(job.model, job.model_file)
    for character in job.characters:
        own = character.model
        files = model_files if own is None else _loaded(own.name, own.file)[1]
        for path in character.assets:
            try:
                if path in deadly:
                    raise deadly[path]
                form = registry.format_of(path)
                asset = form.load(path, within=character.asset_root)
                rig = registry.stage("bind-rig")(
                    character.rig, asset, job.folder, controls=model.controls
                )
                inputs = tuple(form.inputs(asset))
                # Refuses a layout that this asset cannot have.
                writer = form.for_layout(character.layout, asset)
            except InputError as error:
                findings.append(Finding.from_error(error, character=character.name))
                continue
            targets.append(
                Target(
                    character.name,
                    asset,
                    rig,
                    writer.output_suffix(path),
                    writer.assembly_suffix,
                    inputs,
                    own,
                    files,
                    character.layout,
                )
            )
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


def _loaded(name: str, file: Path | None) -> tuple[Model, tuple[Path, ...]]:
    """A model, and the files that it is made of."""
    with documents.reading() as files:
        model = registry.load_model(name, file=file)
    return model, tuple(dict.fromkeys(path for path in files if path.is_file()))


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
