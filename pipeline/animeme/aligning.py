"""A folder of lines, aligned: the work of a run up to the phones, and no further."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace
from importlib.metadata import version
from pathlib import Path
from typing import Any

from animeme import registry
from animeme.animating import align_line
from animeme.dialogue import Line, find_lines, find_lines_of, folders_with_lines
from animeme.errors import InputError
from animeme.executors import Executor, Result
from animeme.files import unwritable
from animeme.findings import Finding, LineStatus, Severity, exit_code_of, status_of
from animeme.languages import find_tag
from animeme.ledger import fault_of
from animeme.tasks import AlignItem, LineOutcome
from animeme.work import LINE_TIMEOUT_S, RETRIES, Listener, Progress, cpu_s, name_of

DEFAULT_LANGUAGE = "en"


@dataclass(frozen=True)
class AlignedLine:
    """How the alignment of one line ended.

    Attributes:
        id: path below the folder, without suffix.
        language: BCP-47 tag.
        status: worst of its findings.
        score: the aligner's confidence, 0 to 1; None where it has none, or the line failed.
        audio_s: length of the recording in seconds, 0 where it could not be read.
        output: file of its timings, None if none was written.
        findings: the worst first.
    """

    id: str
    language: str
    status: LineStatus
    score: float | None
    audio_s: float
    output: Path | None
    findings: tuple[Finding, ...]

    @property
    def codes(self) -> tuple[str, ...]:
        """Codes of the findings, each once."""
        return tuple(dict.fromkeys(finding.code for finding in self.findings))


@dataclass(frozen=True)
class AlignReport:
    """How the alignment of a folder ended.

    Attributes:
        lines: sorted by id.
        output: the output folder, None if nothing was to be written.
        fail_on: the severity at which the exit code turns 1.
        cpu_s: CPU time of this process and its workers, for this work.
    """

    lines: tuple[AlignedLine, ...]
    output: Path | None = None
    fail_on: Severity = Severity.ERROR
    cpu_s: float = field(default=0.0, compare=False)

    @property
    def audio_s(self) -> float:
        """Length of all recordings in seconds."""
        return round(math.fsum(line.audio_s for line in self.lines), 6)

    @property
    def exit_code(self) -> int:
        """0 all well; 1 something is at or above `fail_on`; 3 a fault of ours among it."""
        return exit_code_of((f for line in self.lines for f in line.findings), self.fail_on)

    def count(self, status: LineStatus) -> int:
        """How many lines ended as `status`."""
        return sum(line.status == status for line in self.lines)

    def to_document(self) -> dict[str, Any]:
        """An ``animeme.align-report/1`` document."""
        return {
            "schema": "animeme.align-report/1",
            "animeme": version("animeme"),
            "exit_code": self.exit_code,
            "totals": {
                "lines": len(self.lines),
                "ok": self.count("ok"),
                "review": self.count("review"),
                "failed": self.count("failed"),
                "audio_s": self.audio_s,
                "cpu_s": round(self.cpu_s, 3),
            },
            "lines": [self._entry(line) for line in self.lines],
        }

    def _entry(self, line: AlignedLine) -> dict[str, Any]:
        output = None
        if line.output is not None and self.output is not None:
            output = line.output.relative_to(self.output).as_posix()
        return {
            "id": line.id,
            "status": line.status,
            "codes": list(line.codes),
            "score": line.score,
            "language": line.language,
            "audio_s": line.audio_s,
            "output": output,
            "findings": [finding.to_json() for finding in line.findings],
        }


def align_lines(
    folder: Path,
    executor: Executor,
    *,
    language: str | None,
    aligner: str,
    lexicon: Path | None,
    voices: Path | None,
    output: Path | None,
    format: str,
    plot: Path | None = None,
    fail_on: Severity = Severity.ERROR,
    listener: Listener = lambda _: None,
) -> AlignReport:
    """Align every line below a folder.

    Args:
        folder: recordings with their transcripts or timings; a dialogue folder
            (``<language>/…``) if its folders are languages and `language` is None.
        executor: who does it.
        language: of the whole folder; None for that of each language's folder, or else English.
        aligner: a registered aligner.
        lexicon: pronunciations that go before the aligner's own.
        voices: folder of learned voices, or one voice for all lines, or None.
        output: where the timings go, as the lines are laid out in `folder`; None writes nothing.
        format: of the timings, as the stage ``write-timings`` calls it.
        plot: where a picture of each line that has timings goes, laid out likewise; None for none.
        fail_on: severity at which the report's exit code turns 1.
        listener: told of progress.

    Raises:
        InputError: there are no lines, their language is not clear or not known, the lexicon is
            broken, or an output would overwrite something in `folder`.
        PluginError: a plug-in that is needed cannot be loaded.
    """
    cpu_before_s = cpu_s(executor)
    suffix = registry.stage("timings-suffix")(format) if output is not None else ""
    if lexicon is not None:
        registry.stage("check-lexicon")(lexicon)
    _require_there(voices)
    lines = lines_below(folder, language, aligner, _inside(folder, output))
    targets = [None if output is None else output / f"{id}{suffix}" for id in lines]
    if output is not None:
        _require_writable(output)
        _require_free(folder, output, [*lines.values()], [t for t in targets if t], lexicon)
    plots = [None if plot is None else plot / f"{id}.png" for id in lines]
    if plot is not None:
        _require_writable(plot)
        _require_free(folder, plot, [*lines.values()], [p for p in plots if p], lexicon)
    items = [
        AlignItem(line, aligner, lexicon, voices, target, format, picture)
        for line, target, picture in zip(lines.values(), targets, plots, strict=True)
    ]
    results = executor.run(name_of(align_line), items, timeout_s=LINE_TIMEOUT_S, retries=RETRIES)
    ids = list(lines)
    ended: dict[int, AlignedLine] = {}
    failed = 0
    for done, result in enumerate(results, 1):
        line = ended[result.index] = _aligned_line(ids[result.index], items[result.index], result)
        failed += line.status == "failed"
        listener(Progress("lines", done, len(items), failed))
    in_order = tuple(ended[index] for index in sorted(ended))
    return AlignReport(in_order, output, fail_on, cpu_s(executor) - cpu_before_s)


def _require_there(voices: Path | None) -> None:
    if voices is not None and not voices.exists():
        raise InputError(
            "voice-unusable",
            "there are no such voices",
            place=str(voices),
            action="Check the name, or learn them: animeme voice.",
        )


def lines_below(
    folder: Path, language: str | None, aligner: str, without: Path | None = None
) -> dict[str, Line]:
    """The lines below a folder by id, sorted.

    Args:
        folder: recordings with their transcripts or timings; a dialogue folder
            (``<language>/…``) if its folders are languages and `language` is None.
        language: of the whole folder; None for that of each language's folder, or else English.
        aligner: says which languages there are.
        without: a folder that is left out.

    Raises:
        InputError: there are no lines, or their language is not clear or not known.
    """
    known = registry.aligner(aligner).languages()
    if language is not None:
        _require_known(language, aligner, known)
    elif _is_dialogue(folder, aligner, known, without):
        found = find_lines(folder, (), without=without)
        return dict(sorted((line.key, line) for line in found))
    lines = find_lines_of(folder, language or DEFAULT_LANGUAGE, without=without)
    if not lines:
        raise InputError(
            "dialogue-empty",
            "there is no recording below this folder",
            place=str(folder),
            action="It holds recordings, each with its transcript (.txt) or timings beside it.",
        )
    return dict(sorted((line.id, line) for line in lines))


def _is_dialogue(folder: Path, aligner: str, known: frozenset[str], without: Path | None) -> bool:
    """Whether the folder's lines are laid out by language.

    Raises:
        InputError: some are and some are not, or the folders of languages are further down.
    """

    def is_language(name: str) -> bool:
        tag = find_tag(name)
        return tag is not None and tag.split("-")[0] in known

    places = folders_with_lines(folder, without=without)
    within = [parts for parts in places if parts and is_language(parts[0])]
    others = [parts for parts in places if parts not in within]
    deeper = [parts for parts in others if any(map(is_language, parts))]
    if others and (within or deeper):
        language = "/".join((within or deeper)[0])
        rest = "/".join(others[0]) if within else ""
        problem = f"but not '{rest}'" if rest else "but there are lines beside it"
        if not within:
            problem = "but not directly below this folder"
        raise InputError(
            "align-language-unclear",
            f"its folder '{language}' is named by language, {problem}",
            place=str(folder),
            action="Give the language of all with --language, or align one folder at a time.",
        )
    return bool(within)


def _require_known(language: str, aligner: str, known: frozenset[str]) -> None:
    if (find_tag(language) or language).split("-")[0] not in known:
        raise InputError(
            "language-unknown",
            f"'{language}' is not a language that '{aligner}' can align",
            place="--language",
            action=f"Known languages: {', '.join(sorted(known))}.",
        )


def _inside(folder: Path, output: Path | None) -> Path | None:
    """The output folder as a path below `folder`, None unless it lies there."""
    if output is None:
        return None
    root, target = folder.resolve(), output.resolve()
    below = target.is_relative_to(root) and target != root
    return folder / target.relative_to(root) if below else None


def _require_writable(output: Path) -> None:
    """Better now than once per line."""
    nearest = next(path for path in (output, *output.parents) if path.exists())
    if not nearest.is_dir():
        raise unwritable(output, NotADirectoryError(f"'{nearest}' is a file"))


def _require_free(
    folder: Path,
    output: Path,
    lines: Sequence[Line],
    targets: Sequence[Path],
    lexicon: Path | None,
) -> None:
    """Make sure that nothing of the user's would be overwritten.

    That is what is read, and anything in the folder of the lines, unless the output is a folder of
    its own in there.
    """
    present = {target.resolve() for target in targets if target.exists()}
    if not present:
        return
    inputs = {path.resolve() for line in lines for path in _inputs(line)}
    inputs |= set() if lexicon is None else {lexicon.resolve()}
    root = folder.resolve()
    own = _inside(folder, output) is not None
    clashes = sorted(
        path for path in present if path in inputs or (path.is_relative_to(root) and not own)
    )
    if clashes:
        more = f", and {len(clashes) - 1} more files" if len(clashes) > 1 else ""
        raise InputError(
            "output-is-input",
            f"would be overwritten{more}",
            place=str(clashes[0]),
            action="Choose another output folder; timings beside a recording are used, not made.",
        )


def _inputs(line: Line) -> Iterator[Path]:
    yield from (line.audio, line.transcript)
    yield from () if line.timings is None else (line.timings,)


def _aligned_line(id: str, item: AlignItem, result: Result) -> AlignedLine:
    outcome: LineOutcome | None = result.value
    if outcome is None:
        action = "`animeme align` on this file alone may show more; please report it."
        outcome = LineOutcome(0.0, (fault_of(result, str(item.line.audio), action),))
    findings = list(outcome.findings)
    status = status_of(findings)
    if status == "failed" and item.output is not None and item.output.exists():
        findings.append(
            Finding(
                Severity.WARNING,
                "output-stale",
                "is from an earlier run: this one had nothing good to put in its place",
                place=str(item.output),
                action="Do not use it; mend the line and run again, or delete it.",
            )
        )
    distinct = dict.fromkeys(replace(finding, line=id) for finding in findings)
    return AlignedLine(
        id,
        item.line.language,
        status,
        None if status == "failed" or outcome.score is None else round(outcome.score, 4),
        round(outcome.audio_s, 6),
        None if status == "failed" else item.output,
        tuple(sorted(distinct, key=lambda f: (-f.severity, f.code, f.place, f.message))),
    )
