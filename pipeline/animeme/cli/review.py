"""``animeme review``."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path

import click

from animeme.cli import options as shared
from animeme.cli.progress import progress
from animeme.reviewable import open_reviewable, review
from animeme.reviewing import Pictures, WrittenReview, picture
from animeme.work import Listener, Progress


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
@click.option("--strip", is_flag=True, help="Instead of pages, a PNG of key moments per line.")
@click.option("--video", is_flag=True, help="Instead of pages, an MP4 with sound per line.")
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
    strip: bool,
    video: bool,
    as_json: bool,
) -> int:
    """Write pages on which a person sees and hears the lines of RUN|ASSET.

    RUN is the output folder of a run, ASSET an animated file or a folder of such. The pages work
    from disk, without a server or a network. Recordings and words of an ASSET come from --dialogue.
    """
    if (strip or video) and (single_file or against is not None):
        raise click.UsageError("--strip and --video go with neither --single-file nor --against.")

    if strip or video:
        subject = open_reviewable(
            shown, dialogue=dialogue, language=language, rig=rig, aligner=aligner, lexicon=lexicon
        )
        with progress() as listener:
            drawn = picture(
                subject, output, lines=lines, worst=worst, strips=strip, films=video,
                listener=_heard(listener, "pictures"),
            )  # fmt: skip
        return _tell_pictures(drawn, output, as_json)
    with progress() as listener:
        written = review(
            shown, output, lines=lines, worst=worst, against=against, dialogue=dialogue,
            language=language, rig=rig, aligner=aligner, lexicon=lexicon, single_file=single_file,
            listener=_heard(listener, "pages"),
        )  # fmt: skip
    _tell(written)
    if as_json:
        click.echo(json.dumps(_document(written), ensure_ascii=False, indent=1))
    return 0


def _heard(listener: Listener, stage: str) -> Callable[[int, int], None]:
    return lambda done, total: listener(Progress(stage, done, total, 0))


def _tell_pictures(drawn: Pictures, output: Path, as_json: bool) -> int:
    """Say what was drawn; 1 if there was something that could not be."""
    for remark in drawn.remarks:
        click.echo(remark, err=True)
    click.echo(f"{len(drawn.files)} files were drawn into {output}.", err=True)
    if as_json:
        files = [str(file) for file in drawn.files]
        click.echo(json.dumps({"files": files, "remarks": drawn.remarks}, ensure_ascii=False))
    return 1 if drawn.remarks else 0


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
