"""Files that a run would write: that they are in nobody's way, and which are left from before."""

from __future__ import annotations

import filecmp
import os
from collections import Counter
from collections.abc import Collection, Iterable, Iterator
from pathlib import Path

from animeme.errors import JobError, Problem
from animeme.files import walk
from animeme.findings import Finding, Severity
from animeme.job import Job, model_files
from animeme.plan import REPORT_NAMES, Plan
from animeme.spool import sweep_hidden
from animeme.tasks import Target


def require_free_outputs(plan: Plan) -> None:
    """Make sure that no file which the run reads is one that it would write.

    Raises:
        JobError: names each input in the way.
    """
    output = str(plan.job.output.resolve())
    near = _below(output, _inputs(plan))
    if not near:
        return
    clashes = sorted(near & {str(path.resolve()) for path in plan.possible_outputs()})
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


def _inputs(plan: Plan) -> Iterator[str | Path]:
    job = plan.job
    yield job.source
    yield from job.dialogue.files
    yield from (target.asset.source for target in plan.targets)
    yield from (job.folder / character.rig for character in job.characters)
    yield from (path for path in (job.lexicon, job.voices, *model_files(job)) if path)
    for line in plan.lines:
        yield from (line.audio_file, line.transcript_file)
        yield from () if line.timings_file is None else (line.timings_file,)
        yield from (car.path for car in line.side_cars)


def _below(output: str, paths: Iterable[str | Path]) -> set[str]:
    """The files below a folder that paths mean; thousands of them in a few folders, each of which
    is looked at once.
    """
    folders: dict[str, tuple[str, frozenset[str]]] = {}
    found = set()
    for path in map(str, paths):
        head, slash, name = path.rpartition("/")
        folder = head + slash or "."
        if folder not in folders:
            folders[folder] = os.path.realpath(folder), _links(folder)
        place, links = folders[folder]
        if name in links:
            real = os.path.realpath(path)
            found |= {real} if real.startswith(output + os.sep) else set()
        elif f"{place}/".startswith(output + os.sep):
            found.add(os.path.join(place, name))
    return found


def _links(folder: str) -> frozenset[str]:
    """Names in a folder that are links."""
    try:
        with os.scandir(folder) as entries:
            return frozenset(entry.name for entry in entries if entry.is_symlink())
    except OSError:
        return frozenset()


def stale_outputs(plan: Plan, fresh: Collection[str]) -> Iterator[Finding]:
    """A warning for each file of an earlier run that this one would have written, but did not.

    Args:
        plan: of the run.
        fresh: what is there as this run would write it, from the output folder.
    """
    output = str(plan.job.output)
    start = len(output) + 1
    hidden: list[str] = []
    left: set[str] = set()
    for folder, names in walk(output, hidden=hidden):
        above = f"{folder}/"[start:]
        left.update(path for name in names if (path := above + name) not in fresh)
    sweep_hidden(plan.job.output, hidden)
    left -= {*REPORT_NAMES}
    for path in plan.possible_files() if left else ():
        if path[start:] in left:
            yield Finding(
                Severity.WARNING,
                "output-stale",
                "is from an earlier run: this one had nothing good to put in its place",
                place=path[start:],
                action="Do not deliver it; mend its lines and run again, or delete it.",
            )


def require_distinct_companions(job: Job, targets: Iterable[Target]) -> None:
    """Make sure that no two assets bring different files to one place.

    Raises:
        JobError: names each file that two assets disagree on.
    """
    brought: dict[str, tuple[str, Path]] = {}
    problems = []
    for target in targets:
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
        raise JobError(str(job.source), problems)
