"""``animeme bigrams``."""

from __future__ import annotations

import json
from collections.abc import Iterable
from pathlib import Path
from typing import Any

import click
from rich.console import Console
from rich.markup import escape
from rich.table import Table

from animeme import bigrams
from animeme.cli import options as shared
from animeme.cli.lines import lines_of
from animeme.cli.progress import parts
from animeme.dialogue import AUDIO_SUFFIXES, find_lines_of
from animeme.documents import read
from animeme.errors import InputError
from animeme.findings import Finding, Severity, exit_code_of
from animeme.phones import PhoneTrack
from animeme.speech import align

# More pairs than this are not shown on a terminal; --json has all.
SHOWN_PAIRS = 30

_set = click.option(
    "--set",
    "bigram_set",
    default=bigrams.DEFAULT_SET,
    show_default=True,
    metavar="NAME|FILE",
    help="The set of bigrams.",
)
_output = click.option(
    "--output", required=True, type=click.Path(path_type=Path), help="The set to write, JSON."
)
_json = click.option("--json", "as_json", is_flag=True, help="Print the result as JSON on stdout.")


@click.group(
    "bigrams",
    epilog="Example: animeme bigrams coverage sample_assets/dialogue --json. "
    "Every command has --json.",
)
def command() -> None:
    """Make, import and check curves for pairs of phones that animators edit.

    A set goes into a job as [model] file.
    """


@command.command(
    "import",
    epilog="Example: animeme bigrams import diphones.json --output crew.json --map oo=w "
    "--licence LGPL-3.0",
)
@click.argument("file", type=click.Path(path_type=Path))
@_output
@click.option(
    "--map", "mapped", multiple=True, metavar="NAME=CLASS",
    help="A phone of FILE that is of this common class.",
)  # fmt: skip
@click.option(
    "--poses", metavar="NAME|FILE", help="The set that gives the poses of FILE their controls."
)
@click.option("--source", default="", help="Where the curves come from; FILE's name by default.")
@click.option("--licence", default="", help="On what terms they may be used.")
@shared.fail_on
@_json
def import_(
    file: Path,
    output: Path,
    mapped: tuple[str, ...],
    poses: str | None,
    source: str,
    licence: str,
    fail_on: str,
    as_json: bool,
) -> int:
    """Make a set of the published FILE: {"diphones": {"l|ow": {"open": [[t, weight], …]}}}.

    Phones become the 21 of the common set; what has no class is left out, and listed.
    """
    _require_new(output)
    document, findings = bigrams.import_bigrams(
        file, phones=_pairs_of(mapped), poses=poses, source=source, licence=licence
    )
    bigrams.save_bigrams(document, output)
    _tell(findings)
    keys = [keys for entry in document["pairs"].values() for keys in entry["curves"].values()]
    click.echo(f"Wrote {output}: {len(document['pairs'])} pairs, {len(keys)} curves.", err=True)
    if as_json:
        _print({
            "output": str(output), "pairs": len(document["pairs"]), "curves": len(keys),
            "extends": document.get("extends"),
            "findings": [finding.to_json() for finding in findings],
        })  # fmt: skip
    return exit_code_of(findings, Severity.parse(fail_on))


@command.command("coverage", epilog="Example: animeme bigrams coverage dialogue --set crew.json")
@click.argument("paths", nargs=-1, required=True, type=click.Path(path_type=Path))
@_set
@click.option("--language", help="Only lines of this language; that of a folder without any.")
@shared.lexicon
@_json
def coverage(
    paths: tuple[Path, ...],
    bigram_set: str,
    language: str | None,
    lexicon: Path | None,
    as_json: bool,
) -> int:
    """List the pairs of phones of a dialogue that a set lacks, the most frequent first.

    Each PATH is a dialogue folder (<language>/[character/]<line>.txt) or a job file. Recordings are
    not touched. Exit code 1 if a transcript cannot be read or a word cannot be pronounced.
    """
    lines = [line for path in paths for line in lines_of(path, language)]
    found = bigrams.cover_bigrams(lines, bigram_set, lexicon=lexicon)
    _tell(found.findings)
    if as_json:
        _print({"set": bigram_set, **found.to_document()})
    else:
        _show(found, bigram_set)
    return exit_code_of(found.findings, Severity.ERROR)


@command.command(
    "seed", epilog="Example: animeme bigrams seed --model cohen-massaro --output ours.json"
)
@click.option("--model", required=True, metavar="NAME|FILE", help="What the set shall move like.")
@_output
@click.option(
    "--poses", default="facefx-poses", show_default=True, metavar="NAME|FILE|controls",
    help="The set that gives poses, phone classes and conflicts; 'controls' for the model's own.",
)  # fmt: skip
@_json
def seed(model: str, output: Path, poses: str, as_json: bool) -> int:
    """Make a whole set, of every pair of phones, that moves like a trained model."""
    _require_new(output)
    with parts() as listener:
        found = bigrams.seed_bigrams(model, poses=poses, output=output, listener=listener)
    _tell(found.findings)
    entries = found.document["pairs"].values()
    keys = sum(len(keys) for entry in entries for keys in entry["curves"].values())
    click.echo(f"Wrote {output}: {len(entries)} pairs, {keys} keys.", err=True)
    if as_json:
        _print({
            "output": str(output), "pairs": len(entries), "keys": keys,
            "rmse": found.rmse, "correlation": found.correlation,
            "findings": [finding.to_json() for finding in found.findings],
        })  # fmt: skip
    else:
        table = Table("control", "RMSE", "correlation")
        for name, error in found.rmse.items():
            r = found.correlation[name]
            table.add_row(escape(name), f"{error:.3f}", "–" if r is None else f"{r:.2f}")
        Console().print(table)
    return exit_code_of(found.findings, Severity.ERROR)


@command.command(
    "trace", epilog="Example: animeme bigrams trace out/alignments/en/boat.json --set crew.json"
)
@click.argument("line", type=click.Path(path_type=Path))
@_set
@click.option("--language", default="en", show_default=True, help="Of a recording, BCP-47 tag.")
@shared.aligner
@shared.lexicon
@_json
def trace(
    line: Path,
    bigram_set: str,
    language: str,
    aligner: str,
    lexicon: Path | None,
    as_json: bool,
) -> int:
    """Say from which pair each key of LINE comes, and in which set it is.

    LINE is an alignment that `animeme run` wrote, or a recording with its transcript beside it.
    """
    track = _track(line, language, aligner, lexicon)
    found = bigrams.trace_bigrams(track, bigram_set)
    if as_json:
        _print({"line": str(line), "set": bigram_set, **found})
        return 0
    table = Table("pose", "time", "weight", "pair", "at", "phones", "from", "changed by")
    for pose, keys in found["poses"].items():
        for key in keys:
            phones = " ".join(f"{p['symbol']} {p['start_s']:.2f}" for p in key["phones"])
            own = "" if key["from"] == key["pair"] else f"{key['from']} "
            table.add_row(
                escape(pose), f"{key['time_s']:.3f}", f"{key['weight']:.2f}", escape(key["pair"]),
                f"{key['at']:.2f}", escape(phones), escape(own + key["set"]),
                ", ".join(key["changed"]),
            )  # fmt: skip
    Console().print(table)
    for pair, how in found["missing"].items():
        click.echo(f"The set lacks {pair}: {how}.")
    return 0


def _track(line: Path, language: str, aligner: str, lexicon: Path | None) -> PhoneTrack:
    if line.suffix.lower() == ".json":
        return PhoneTrack.from_document(read("alignment", line))
    if line.suffix.lower() in AUDIO_SUFFIXES and line.is_file():
        (own,) = (li for li in find_lines_of(line.parent, language) if li.audio == line)
        text = own.transcript.read_text(encoding="utf-8") if own.transcript.is_file() else None
        if text is not None or own.timings is not None:
            return align(
                line, text, timings=own.timings, language=language, aligner=aligner, lexicon=lexicon
            ).track
    raise InputError(
        "trace-line",
        "is neither an alignment nor a recording with a transcript beside it",
        place=str(line),
        action="Name a file below alignments/ in a run's output folder, or a recording.",
    )


def _pairs_of(entries: Iterable[str]) -> dict[str, str]:
    found = {}
    for entry in entries:
        name, equals, target = entry.partition("=")
        if not equals or not name.strip() or not target.strip():
            raise InputError(
                "bigrams-map", f"'{entry}' is not NAME=CLASS", place="--map",
                action="Write, for example, oo=w.",
            )  # fmt: skip
        found[name.strip()] = target.strip()
    return found


def _require_new(output: Path) -> None:
    if output.suffix.lower() != ".json":
        raise InputError(
            "output-suffix", "would be no set that a job can name", place=str(output),
            action="End its name in .json.",
        )  # fmt: skip
    if output.exists():
        raise InputError(
            "output-exists",
            "is there already",
            place=str(output),
            action="Choose another name: an edited set would be lost.",
        )


def _tell(findings: Iterable[Finding]) -> None:
    for finding in findings:
        click.echo(f"{finding.line}: {finding}" if finding.line else str(finding), err=True)


def _print(document: dict[str, Any]) -> None:
    click.echo(json.dumps(document, ensure_ascii=False, indent=1))


def _show(found: bigrams.Coverage, bigram_set: str) -> None:
    console = Console()
    console.print(
        f"{found.lines} lines, {found.pairs} pairs, {found.different} different; {bigram_set} has "
        f"{found.share:.1%} of what is said and lacks {len(found.missing)} pairs",
        highlight=False, markup=False,
    )  # fmt: skip
    if not found.missing:
        return
    table = Table("pair", "count", "share", "moves like", "said in", "lines")
    for entry in found.missing[:SHOWN_PAIRS]:
        table.add_row(
            escape(entry.pair),
            str(entry.count),
            f"{entry.count / found.pairs:.2%}",
            escape(entry.like) or "[red]nothing[/red]",
            escape(entry.example),
            escape(", ".join(entry.lines[:2])) + (" …" if len(entry.lines) > 2 else ""),
        )
    console.print(table)
    rest = len(found.missing) - SHOWN_PAIRS
    if rest > 0:
        console.print(f"and {rest} more: --json has them all", highlight=False)
