"""What goes in and out of the kinds of work in a run: small things, paths, keys and findings.

The work itself is in `animeme.animating` (lines) and `animeme.writing` (files), which a run that
finds everything done never imports.
"""

from __future__ import annotations

import hashlib
import pickle
from collections.abc import Iterable
from dataclasses import dataclass, field
from functools import lru_cache
from pathlib import Path
from typing import TYPE_CHECKING

from animeme import registry
from animeme.curve_options import CurveOptions
from animeme.dialogue import Line
from animeme.files import sha256, stamp, unwritable, write_bytes
from animeme.findings import Finding
from animeme.job import ModelChoice
from animeme.rig import BoundRig, Character
from animeme.store.entries import Entry, Store
from animeme.store.keys import key_of

if TYPE_CHECKING:
    from animeme.contracts import Format

# The work, by name: a process imports it only if it does it itself.
MAKE_LINE = "animeme.animating:make_line"
WRITE_ASSET = "animeme.writing:write_asset"
JOIN_LANGUAGES = "animeme.writing:join_languages"


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

    @property
    def one_line_each(self) -> bool:
        """Whether each of its files holds one line, and not all of a language."""
        return self.layout != "per-character"


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

    path: str
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


AssetLine = tuple[int, str, float, str, str]
"""Number of a line, name of its animation, length in seconds, key of its curves, recording."""


@dataclass(frozen=True, slots=True)
class AssetItem:
    """Work on one file: curves of its lines into an asset.

    Attributes:
        target: index into the context's targets.
        language: folder name and tag.
        lines: what goes into it.
        output: file to write; a string: there may be many thousands.
        spool: the run's spool folder.
        exports: (number of the line, kind, file) of each curve file to write as well.
    """

    target: int
    language: str
    lines: tuple[AssetLine, ...]
    output: str
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

    outputs: tuple[str, ...]
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


def deliver(output: Path, line: Line, document: bytes, speech: bytes) -> tuple[Delivered, ...]:
    """Put a line's alignment, and what was spoken for it, into the output folder."""
    files = [alignment_file(output, line)] + ([speech_file(output, line)] if speech else [])
    noted = []
    for file, data in zip(files, (document, speech), strict=False):
        # Made again if a crash of the machine damages it.
        write_bytes(Path(file), data, durable=False)
        noted.append(Delivered(file, hashlib.sha256(data).hexdigest(), stamp(file)))
    return tuple(noted)


def delivered(paths: Iterable[str]) -> tuple[Delivered, ...]:
    """The files as they are now, just written."""
    return tuple(Delivered(path, sha256(path), stamp(path)) for path in paths)


def alignment_file(output: Path, line: Line) -> str:
    """Where a run puts a line's alignment, as a string: there may be many thousands."""
    return f"{output}/alignments/{line.key}.json"


def speech_file(output: Path, line: Line) -> str:
    """Where a run puts what it spoke for a line without a recording, as a string too."""
    return f"{output}/speech/{line.key}.wav"
