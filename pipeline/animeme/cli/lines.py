"""``animeme lines``, and the lines that an argument of other commands names."""

from __future__ import annotations

import json
from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path
from typing import Any

import click
from rich.console import Console
from rich.markup import escape
from rich.table import Table

from animeme.cli import options
from animeme.dialogue import Line, find_lines_of, has_transcript
from animeme.errors import InputError
from animeme.files import write_text
from animeme.findings import Finding, Severity, exit_code_of, status_of
from animeme.gathering import Dialogue, DialogueSource, gather
from animeme.job import read_job
from animeme.languages import find_tag, language_tag
from animeme.manifest import PRESETS, manifest_document
from animeme.preflight import dialogue_of

# More lines than this are not shown on a terminal, those that lack something first.
SHOWN_LINES = 40
LIST_SUFFIXES = (
    ".csv", ".tsv", ".tab", ".txt", ".xlsx", ".xlsm", ".xlsb", ".xls", ".ods", ".json", ".wsources",
    ".xml",
)  # fmt: skip


@click.command("lines", epilog="Example: animeme lines sample_assets/job.toml")
@click.argument("path", type=click.Path(path_type=Path))
@click.option(
    "--root",
    type=click.Path(path_type=Path, exists=True, file_okay=False),
    help="Folder where a list's recordings are searched, beside its own.",
)
@click.option(
    "--preset",
    type=click.Choice([*PRESETS, "prefix", "suffix"]),
    help="Who wrote the list, or how files bear their language.",
)
@click.option("--text", "texts", multiple=True, type=click.Path(path_type=Path),
              help="Translations to join by id (.po, .xlf); may be repeated.")  # fmt: skip
@click.option("--language", help="Of what does not say its own.")
@click.option(
    "--output", type=click.Path(path_type=Path), help="Write the lines to this manifest (.json)."
)
@options.fail_on
@click.option("--json", "as_json", is_flag=True, help="Print the result as JSON on stdout.")
def command(
    path: Path,
    root: Path | None,
    preset: str | None,
    texts: tuple[Path, ...],
    language: str | None,
    output: Path | None,
    fail_on: str,
    as_json: bool,
) -> int:
    """List the lines of a dialogue as a run would find them, and what they lack.

    PATH is a job file, a dialogue folder (<language>/[character/]<line>.wav) or a list of lines:
    CSV, TSV, XLSX, ODS, an animeme manifest, FMOD's keys.txt, Wwise's .wsources. No recording is
    opened. Exit code 1 if a line has no recording or no text.
    """
    if output is not None and output.exists():
        raise InputError(
            "output-exists", "is there already", place=str(output), action="Choose another name."
        )
    source = _source(path, root, preset, texts, language)
    found = _of_job(path) if source is None else gather(source)
    lines = [(line, [*line.findings, *lacking(line)]) for line in found.lines]
    if output is not None:
        document = manifest_document(found.lines, output.parent)
        write_text(output, json.dumps(document, ensure_ascii=False, indent=1) + "\n")
    for finding in found.findings:
        click.echo(str(finding), err=True)
    if as_json:
        click.echo(json.dumps(_document(lines, found.findings), ensure_ascii=False, indent=1))
    else:
        _show(lines)
    everything = [*found.findings, *(finding for _, findings in lines for finding in findings)]
    return exit_code_of(everything, Severity.parse(fail_on))


def _of_job(path: Path) -> Dialogue:
    lines, findings = dialogue_of(read_job(path))
    return Dialogue(lines, findings, None)


def _source(
    path: Path, root: Path | None, preset: str | None, texts: Sequence[Path], language: str | None
) -> DialogueSource | None:
    """What `path` is, None for a job file."""
    tag = language_tag(language, place="--language") if language else ""
    if path.suffix.lower() == ".toml" and path.is_file():
        if root or preset or texts or language:
            raise InputError(
                "lines-job",
                "says itself how its lines are to be read",
                place=str(path),
                action="Write root, preset, texts and language into its [dialogue].",
            )
        return None
    if path.is_dir():
        return DialogueSource(path, preset=preset or "", texts=tuple(texts), language=tag)
    if path.suffix.lower() in LIST_SUFFIXES and path.is_file():
        return DialogueSource(root, (path,), preset=preset or "", texts=tuple(texts), language=tag)
    raise InputError(
        "dialogue-missing",
        "is neither a dialogue folder, nor a list of lines, nor a job file",
        place=str(path),
        action="Name a folder that holds <language>/<line>.txt, a sheet, or a job's .toml.",
    )


def lacking(line: Line) -> Iterator[Finding]:
    """What a run would miss of a line, as far as names tell."""
    if not line.audio.is_file():
        yield Finding(
            Severity.ERROR,
            "audio-missing",
            "there is no recording",
            place=str(line.audio),
            action="Deliver it, or let the job speak what nobody has recorded: `speak = true`.",
        )
    if line.timings is None and not has_transcript(line):
        yield Finding(
            Severity.ERROR,
            "transcript-missing",
            "the recording has no transcript",
            place=str(line.transcript),
            action="Write what is said into that file.",
        )
    elif line.text is not None and not line.text.strip():
        yield Finding(
            Severity.ERROR,
            "transcript-empty",
            "the line has no text",
            place=line.origin,
            action="Write what is said there, or into a .txt beside the recording.",
        )


def _document(
    lines: Sequence[tuple[Line, list[Finding]]], findings: Sequence[Finding]
) -> dict[str, Any]:
    return {
        "lines": [
            {
                "line": line.key,
                "id": line.id,
                "language": line.language,
                "character": line.character,
                "audio": str(line.audio),
                "audio_found": line.audio.is_file(),
                "transcript": str(line.transcript) if line.transcript.is_file() else None,
                "text": line.text,
                "timings": str(line.timings) if line.timings else None,
                "origin": line.origin,
                "status": status_of(found),
                "findings": [finding.to_json() for finding in found],
            }
            for line, found in lines
        ],
        "findings": [finding.to_json() for finding in findings],
    }


def _show(lines: Sequence[tuple[Line, list[Finding]]]) -> None:
    console = Console()
    whole = sum(not found for _, found in lines)
    languages: dict[str, int] = {}
    for line, _ in lines:
        languages[line.language] = languages.get(line.language, 0) + 1
    counts = ", ".join(f"{tag} {count}" for tag, count in sorted(languages.items()))
    console.print(
        f"{len(lines)} lines ({counts or 'none'}), {len(lines) - whole} with remarks",
        highlight=False,
    )
    if not lines:
        return
    table = Table("line", "recording", "text", "remarks")
    worst_first = sorted(lines, key=lambda entry: -max((f.severity for f in entry[1]), default=-1))
    for line, found in worst_first[:SHOWN_LINES]:
        remarks = "; ".join(dict.fromkeys(f"{f.code}: {f.message}" for f in found))
        table.add_row(
            escape(line.key), escape(line.audio.name), escape(_text(line)), escape(remarks)
        )
    console.print(table)
    rest = len(lines) - SHOWN_LINES
    if rest > 0:
        console.print(f"and {rest} more: --json has them all", highlight=False)


def _text(line: Line) -> str:
    if line.text is not None:
        return line.text if len(line.text) <= 60 else f"{line.text[:59]}…"
    if line.transcript.is_file():
        return line.transcript.name
    return line.timings.name if line.timings else ""


def lines_of(path: Path, language: str | None = None) -> Iterable[Line]:
    """The lines of a dialogue folder, a list of lines or a job file.

    Args:
        path: the folder or file.
        language: only those of this language; of a folder without one for it, all that it holds.

    Raises:
        InputError: it is none of them, or there is no line.
    """
    tag = None if language is None else find_tag(language) or language
    source = _source(path, None, None, (), None)
    lines = dialogue_of(read_job(path))[0] if source is None else gather(source).lines
    kept: Sequence[Line] = [line for line in lines if tag in (None, line.language)]
    if path.is_dir() and not kept and tag is not None:
        kept = find_lines_of(path, tag)
    if kept or source is None:
        return kept
    raise InputError(
        "dialogue-empty",
        "there is no line in it",
        place=str(path),
        action="A folder holds <language>/<line>.txt, each beside its recording; a list, a row "
        "for each line.",
    )
