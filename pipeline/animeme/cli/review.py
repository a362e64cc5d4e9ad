"""``animeme review``."""

from __future__ import annotations

import json
from pathlib import Path

import click

from animeme.cli import options as shared
from animeme.review import Reviewable, WrittenReview, review
from animeme.review_sources import open_reviewable


@click.command(
    "review",
    epilog="Example: animeme review out/sample --output review; then open review/index.html",
)
@click.argument("shown", metavar="RUN|ASSET", type=click.Path(path_type=Path))
@click.option("--output", type=click.Path(path_type=Path), required=True, help="Folder to write.")
@click.option("--single-file", is_flag=True, help="One file that holds everything, to be sent.")
@click.option("--lines", multiple=True, metavar="GLOB", help="Only these lines get a page.")
@click.option("--worst", type=click.IntRange(1), metavar="N", help="Only the N worst of them do.")
@click.option(
    "--against",
    type=click.Path(path_type=Path),
    help="Another run, or asset, to see and hear beside it.",
)
@click.option(
    "--dialogue",
    type=click.Path(path_type=Path),
    help="Recordings with their transcripts: <language>/[character/]<line>.wav and .txt; a run "
    "knows its own.",
)
@click.option("--language", help="BCP-47 tag of a dialogue whose folders are no languages.")
@click.option("--rig", default="auto", show_default=True, help="A shipped rig profile, or a file.")
@shared.aligner
@shared.lexicon
@click.option("--json", "as_json", is_flag=True, help="Print what was written as JSON on stdout.")
def command(
    shown: Path,
    output: Path,
    single_file: bool,
    lines: tuple[str, ...],
    worst: int | None,
    against: Path | None,
    dialogue: Path | None,
    language: str | None,
    rig: str,
    aligner: str,
    lexicon: Path | None,
    as_json: bool,
) -> int:
    """Write pages on which a person sees and hears the lines of RUN|ASSET.

    RUN is the output folder of a run, ASSET an animated file or a folder of such. The pages work
    from disk, without a server or a network. Recordings and words of an ASSET come from --dialogue.
    """

    def opened(path: Path) -> Reviewable:
        return open_reviewable(
            path, dialogue=dialogue, language=language, rig=rig, aligner=aligner, lexicon=lexicon
        )

    written = review(
        opened(shown),
        output,
        lines=lines,
        worst=worst,
        other=None if against is None else opened(against),
        single_file=single_file,
    )
    _tell(written)
    if as_json:
        click.echo(json.dumps(_document(written), ensure_ascii=False, indent=1))
    return 0


def _tell(written: WrittenReview) -> None:
    for remark in written.remarks:
        click.echo(remark, err=True)
    size = f"{written.size_bytes / 1e6:.1f} MB"
    click.echo(
        f"{written.pages} of {written.lines} lines can be looked at ({size}). "
        f"Open {written.index} in a browser.",
        err=True,
    )


def _document(written: WrittenReview) -> dict[str, object]:
    return {
        "index": str(written.index),
        "lines": written.lines,
        "pages": written.pages,
        "size_bytes": written.size_bytes,
        "head": written.head,
        "remarks": list(written.remarks),
    }
