"""``animeme edits``."""

from __future__ import annotations

import json
from pathlib import Path

import click

from animeme import registry
from animeme.dialogue import TEXT_SUFFIXES
from animeme.errors import InputError
from animeme.files import write_text

_EXAMPLE = """\
# Changes by hand to this line's motion, applied in this order on every run; docs/curves.md has all.
#
# [[edit]]
# do = "offset"                        # or "mute", or "replace" with keys = [[0.0, 0.2], …]
# control = "jawOpen"                  # or shape = "…"
# by = 0.2
# from = { word = 1, text = "…" }      # or seconds of the recording
# to = { word = 1, text = "…", edge = "end" }
"""


@click.command("edits", epilog="Example: animeme edits dialogue/en/greeting.wav")
@click.argument("recordings", nargs=-1, required=True, type=click.Path(path_type=Path))
@click.option("--character", help="For this character of the job alone.")
@click.option("--json", "as_json", is_flag=True, help="Print the new files as JSON on stdout.")
def command(recordings: tuple[Path, ...], character: str | None, as_json: bool) -> None:
    """Start a file of edits by hand beside each of RECORDINGS; none that is there is touched."""
    middle = f".{character}" if character else ""
    files = {path: path.with_name(f"{path.stem}{middle}.edits.toml") for path in recordings}
    for recording, target in files.items():
        _require_new(recording, target)
    for recording, target in files.items():
        write_text(target, _text(recording))
        click.echo(f"Started {target}.", err=True)
    if as_json:
        click.echo(json.dumps([str(target) for target in files.values()], ensure_ascii=False))


def _require_new(recording: Path, target: Path) -> None:
    if not recording.is_file():
        raise InputError(
            "recording-missing", "there is no such recording", place=str(recording),
            action="Name the line's recording, or its transcript.",
        )  # fmt: skip
    if target.exists():
        raise InputError(
            "output-exists", "is there already", place=str(target),
            action="Add to it: nothing in it is lost.",
        )  # fmt: skip


def _text(recording: Path) -> str:
    head = 'schema = "animeme.edits/1"\n'
    for suffix in TEXT_SUFFIXES:
        transcript = recording.with_suffix(suffix)
        if transcript.is_file():
            words = " ".join(registry.stage("read-transcript")(transcript).split())
            # JSON's strings are TOML's.
            head += f"made_for_text = {json.dumps(words, ensure_ascii=False)}\n"
            break
    return f"{head}\n{_EXAMPLE}"
