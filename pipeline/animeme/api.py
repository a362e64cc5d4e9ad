"""The public functions; import them from `animeme`."""

from __future__ import annotations

from pathlib import Path
from typing import Literal

from animeme import registry
from animeme.contracts import Alignment, Model
from animeme.executors.inline import InlineExecutor
from animeme.executors.local import LocalExecutor, default_workers
from animeme.findings import RunReport, Severity
from animeme.job import read_job
from animeme.rig import Character
from animeme.runner import Listener, run_job


def run(
    job: str | Path,
    *,
    output: str | Path | None = None,
    executor: Literal["inline", "local"] = "inline",
    workers: int | None = None,
    fail_on: str = "error",
    listener: Listener = lambda _: None,
) -> RunReport:
    """Run a job file: characters and dialogue in, animated assets out.

    Args:
        job: the TOML file.
        output: output folder in place of the job's.
        executor: "inline" in this process, "local" in supervised processes of its own (the calling
            script then needs an ``if __name__ == "__main__":`` guard).
        workers: how many processes, all processors if None.
        fail_on: severity at which `RunReport.exit_code` turns 1.
        listener: told of progress.

    Returns:
        The report that is also written to the output folder.

    Raises:
        JobError: the job cannot be run; all reasons at once.
        PluginError: a plug-in that it needs cannot be loaded.
        InputError: the output folder cannot be written.
        ValueError: an argument is none of those that are listed.

    Example:
        >>> import animeme, tempfile
        >>> report = animeme.run("sample_assets/job.toml", output=tempfile.mkdtemp())
        >>> report.exit_code, report.count("ok", character="ada", language="en")
        (0, 6)
    """
    if executor not in ("inline", "local"):
        raise ValueError(f"executor must be 'inline' or 'local', not {executor!r}")
    if workers is not None and workers < 1:
        raise ValueError(f"workers must be at least 1, not {workers}")
    folder = Path(output) if output is not None else None
    severity = Severity.parse(fail_on)
    checked = read_job(Path(job), output=folder)
    if executor == "inline":
        return run_job(checked, InlineExecutor(), fail_on=severity, listener=listener)
    with LocalExecutor(workers or default_workers()) as pool:
        return run_job(checked, pool, fail_on=severity, listener=listener)


def align(
    audio: str | Path,
    text: str,
    *,
    language: str = "en",
    aligner: str = "pocketsphinx",
    lexicon: str | Path | None = None,
) -> Alignment:
    """Find when each phone of a transcript is spoken.

    Args:
        audio: a recording that libsndfile reads.
        text: what is said in it.
        language: BCP-47 tag.
        aligner: a registered aligner.
        lexicon: pronunciations that go before the aligner's own.

    Returns:
        The phone track, and findings about it.

    Raises:
        InputError: audio or text cannot be used, or do not fit together.

    Example:
        >>> import animeme
        >>> from pathlib import Path
        >>> folder = Path("sample_assets/dialogue/en")
        >>> text = (folder / "welcome.txt").read_text(encoding="utf-8")
        >>> track = animeme.align(folder / "welcome.wav", text).track
        >>> [word.text for word in track.words][:2], track.phones[0].start_s
        (['welcome', 'back'], 0.0)
    """
    speech = registry.stage("read-speech")(Path(audio))
    own = Path(lexicon) if lexicon is not None else None
    return registry.aligner(aligner).align(speech, text, language=language, lexicon=own)


def load_model(name_or_file: str | Path) -> Model:
    """A model by name, as shipped, or from a model document.

    Args:
        name_or_file: a registered name, or the path of a model document.

    Raises:
        PluginError: no such model is registered.
        InputError: the document is broken.

    Example:
        >>> import animeme
        >>> model = animeme.load_model("cohen-massaro")
        >>> "jawOpen" in model.controls
        True
    """
    path = Path(name_or_file)
    if path.suffix.lower() in (".json", ".toml", ".animeme") or path.is_file():
        return registry.load_model(file=path)
    return registry.load_model(str(name_or_file))


def load_character(path: str | Path) -> Character:
    """The character in an asset: its meshes and their blendshapes.

    Raises:
        InputError: the file is damaged, of no known format, or has no blendshapes.

    Example:
        >>> import animeme
        >>> crab = animeme.load_character("sample_assets/crab.glb")
        >>> len(crab.shapes), "MawGape" in crab.shapes
        (8, True)
    """
    file = Path(path)
    return registry.format_of(file).load(file)
