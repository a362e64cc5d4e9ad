"""``animeme speak``."""

from __future__ import annotations

import json
from pathlib import Path

import click

from animeme import registry
from animeme.cli import options as shared
from animeme.speech import speak


@click.command("speak", epilog='Example: animeme speak "Hallo Welt" --language de --output hi.wav')
@click.argument("text")
@click.option("--language", default="en", show_default=True, help="BCP-47 tag.")
@click.option("--output", required=True, type=click.Path(path_type=Path), help="WAV file to write.")
@click.option(
    "--timings",
    type=click.Path(path_type=Path),
    help="Write its words and phones to this file as well, in the --format.",
)
@shared.timing_format
@click.option(
    "--words-per-minute",
    type=click.IntRange(80, 450),
    default=160,
    show_default=True,
    help="Pace.",
)
@click.option("--json", "as_json", is_flag=True, help="Print the alignment document on stdout.")
def command(
    text: str,
    language: str,
    output: Path,
    timings: Path | None,
    form: str,
    words_per_minute: int,
    as_json: bool,
) -> int:
    """Speak TEXT with espeak-ng, for prototypes until an actor has recorded it.

    TEXT is the transcript's file, or the words themselves. Needs the extra `espeak`.
    """
    if timings is not None:
        registry.stage("timings-suffix")(form)  # before anything is written
    transcript = Path(text)
    if transcript.suffix.lower() in (".txt", ".lab"):
        text = registry.stage("read-transcript")(transcript)
    spoken = speak(text, language=language, words_per_minute=words_per_minute, output=output)
    track = spoken.alignment.track
    if timings is not None:
        registry.stage("write-timings")(track, timings, form)
    if as_json:
        click.echo(json.dumps(track.to_document(), ensure_ascii=False, indent=1))
    else:
        click.echo(f"{output}: {track.duration_s:.1f} s, {len(track.words)} words")
    return 0
