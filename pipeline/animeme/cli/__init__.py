"""The command line: one command per file, each parses, calls the API and renders."""

from __future__ import annotations

import atexit
import gc
import io
import os
import signal
import sys
import threading
import traceback
from collections.abc import Callable, Sequence
from functools import partial
from importlib import import_module
from importlib.metadata import version
from types import FrameType

import click

# Name → one-line help. Commands are imported when used, so that --help is quick.
_COMMANDS = {
    "align": "Find when each phone of a recording, or of a folder of lines, is spoken.",
    "bigrams": "Make, import and check curves for pairs of phones that animators edit.",
    "cache": "Look after the store of results that runs take up again.",
    "crossmap": "Map tracked lips to a character's controls, as a dataset to train on.",
    "curves": "List the animations of an asset, or write one as a curve file.",
    "diff": "Compare the curves of two runs, or of two files, as a gate for changes.",
    "doctor": "Say what is installed, and what extras would add.",
    "edits": "Start a file of edits by hand beside a recording.",
    "evaluate": "Compare models with captured motion they were not fitted to.",
    "lexicon": "List the words of a dialogue that no dictionary has.",
    "lines": "List the lines of a dialogue, and what they lack.",
    "merge": "Write the files of a job whose lines were done in shards.",
    "review": "Write pages on which a person sees, hears and marks lines.",
    "rig": "Say which rig profile fits an asset, or draft one.",
    "run": "Run a job: characters and dialogue in, animated assets out.",
    "schema": "Print the JSON Schema of a document.",
    "speak": "Speak a transcript, with exact timings, until an actor has recorded it.",
    "strip": "Take animeme's animations out of an asset: its source, byte for byte.",
    "train": "Fit a model to speech with captured motion.",
    "validate": "Judge delivered animation files, ours or not, against their recordings.",
    "voice": "Learn how each speaker sounds, to align with more certainty.",
}

# After this, what was in the middle of being thrown away is gone.
_AGAIN_S = 0.05
EXIT_UNUSABLE = 2
EXIT_OURS = 3


class _Commands(click.Group):
    def list_commands(self, ctx: click.Context) -> list[str]:
        return sorted(_COMMANDS)

    def get_command(self, ctx: click.Context, cmd_name: str) -> click.Command | None:
        if cmd_name not in _COMMANDS:
            return None
        command: click.Command = import_module(f"animeme.cli.{cmd_name}").command
        return command

    def format_commands(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        with formatter.section("Commands"):
            formatter.write_dl(sorted(_COMMANDS.items()))


@click.command(
    cls=_Commands,
    context_settings={"help_option_names": ["-h", "--help"]},
    epilog="Exit codes: 0 all well; 1 done, but something is at or above --fail-on; "
    "2 the command or its input could not be used and nothing was written; 3 a fault of ours.",
)
@click.option("--debug", is_flag=True, help="Show Python's traceback of an error.")
@click.version_option(version("animeme"), prog_name="animeme")
def cli(debug: bool) -> None:
    """Make rigged characters speak: dialogue in, blendshape animation in glTF and USD out."""


def main(arguments: Sequence[str] | None = None) -> None:
    """Entry point: turns every error into a message and an exit code."""
    given = list(sys.argv[1:] if arguments is None else arguments)
    debug = "--debug" in given  # also behind the command: it is added when something went wrong
    given = [argument for argument in given if argument != "--debug"]
    _prepare_process()
    from animeme.errors import AnimemeError

    try:
        code = cli.main(given, prog_name="animeme", standalone_mode=False)
    except click.ClickException as error:
        error.show()
        sys.exit(EXIT_UNUSABLE)
    except click.Abort:
        click.echo("Stopped.", err=True)
        sys.exit(130)
    except AnimemeError as error:
        _complain(str(error), debug)
        sys.exit(EXIT_UNUSABLE)
    except Exception as error:  # noqa: BLE001  the last line of defence: no traceback for users
        _complain(
            f"a fault of ours: {type(error).__name__}: {error}\n"
            "Please report it, with what `animeme --debug …` prints.",
            debug,
        )
        sys.exit(EXIT_OURS)
    sys.exit(code if isinstance(code, int) else 0)


def _prepare_process() -> None:
    """Speak UTF-8 whatever the locale, tidy up when we are told to stop, and end at once."""
    atexit.register(gc.freeze)  # else the last look for garbage takes a tenth of a second
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, io.TextIOWrapper):
            stream.reconfigure(encoding="utf-8", errors="backslashreplace")
    if threading.current_thread() is threading.main_thread():
        signal.signal(signal.SIGTERM, _stop)
        if getattr(sys.unraisablehook, "func", None) is not _unraisable:
            sys.unraisablehook = partial(_unraisable, sys.unraisablehook)


def _stop(number: int, _: FrameType | None) -> None:
    sys.exit(128 + number)


def _unraisable(
    tell: Callable[[sys.UnraisableHookArgs], object], ignored: sys.UnraisableHookArgs
) -> None:
    """Have a Ctrl-C heard that came while something was thrown away, where Python ignores it."""
    if ignored.exc_type is not KeyboardInterrupt:
        tell(ignored)
        return
    again = threading.Timer(_AGAIN_S, os.kill, (os.getpid(), signal.SIGINT))
    again.daemon = True  # a command that is at its end need not hear of it
    again.start()


def _complain(message: str, debug: bool) -> None:
    if debug:
        traceback.print_exc()
    click.echo(f"animeme: {message}", err=True)
