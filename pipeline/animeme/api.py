"""The public functions; import them from `animeme`."""

from __future__ import annotations

import gc
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Literal

from animeme import registry, rehearsal
from animeme.aligning import AlignReport, align_lines, lines_below
from animeme.contracts import Alignment, Model, Spoken
from animeme.dialogue import Line
from animeme.errors import InputError
from animeme.executors import Executor, choice
from animeme.executors.crew import code_of
from animeme.files import scratch_beside
from animeme.findings import RunReport, Severity
from animeme.job import Job, read_job
from animeme.preflight import dialogue_of
from animeme.rehearsal import Rehearsal
from animeme.reviewable import open_reviewable
from animeme.reviewing import WrittenReview
from animeme.reviewing import review as write_review
from animeme.rig import Character
from animeme.runner import Listener, Shard, run_job, run_shard
from animeme.selection import EVERYTHING, Selection
from animeme.steps import Means, align_speech
from animeme.store.memory import Memory, default_store, memory
from animeme.voices import VoicesReport
from animeme.voices import learn_voices as learn


def run(
    job: str | Path,
    *,
    output: str | Path | None = None,
    executor: choice.Kind = "inline",
    workers: int | None = None,
    scheduler: str | None = None,
    fail_on: str = "error",
    speak: bool = False,
    cache: str | Path | Literal[False] | None = None,
    rehash: bool = False,
    shard: str | None = None,
    listener: Listener = lambda _: None,
    selection: Selection = EVERYTHING,
) -> RunReport:
    """Run a job file: characters and dialogue in, animated assets out.

    Args:
        job: the TOML file.
        output: output folder in place of the job's.
        executor: "inline" in this process, "local" in supervised processes of its own, "dask" on a
            Dask cluster (the calling script then needs an ``if __name__ == "__main__":`` guard).
        workers: how many processes, all processors if None.
        scheduler: address of the cluster's scheduler; None starts a cluster of this machine's own.
        fail_on: severity at which `RunReport.exit_code` turns 1.
        speak: speak transcripts that have no recording, as the job's ``[dialogue] speak`` does.
        cache: folder of results that runs share, in place of the job's or the user's; False keeps
            none, and does everything anew.
        rehash: read every file, whether or not it looks as it did.
        shard: "I/N" does the I-th of N parts of the lines, for the store alone; a run without it,
            with the same store, then writes the files.
        listener: told of progress.
        selection: the lines that are wanted, see `animeme.Selection`. Files that hold one of them
            are written, with all their lines; lines that nobody asked for are as they were
            delivered last. All other files stay as they are.

    Returns:
        The report that is also written to the output folder.

    Raises:
        JobError: the job cannot be run; all reasons at once.
        PluginError: a plug-in that it needs cannot be loaded.
        InputError: the output folder cannot be written, or the selection fits no line.
        ValueError: an argument is none of those that are listed.

    Example:
        >>> import animeme, tempfile
        >>> report = animeme.run("sample_assets/job.toml", output=tempfile.mkdtemp())
        >>> report.exit_code, report.count("ok", character="ada", language="en")
        (0, 6)
    """
    choice.require(executor, workers, scheduler)
    folder = Path(output) if output is not None else None
    severity = Severity.parse(fail_on)
    part = Shard.parse(shard) if shard is not None else None
    if part is not None and cache is False:
        raise ValueError("a shard leaves what it does in a store, so it needs one")
    if part is not None and executor == "dask":
        raise ValueError("a shard is for farms without Dask, which shares out all lines itself")
    form = read_job(Path(job), output=folder, check=False)
    if speak:
        form = replace(form, speak=True)

    def work(chosen: Executor, remembered: Memory) -> RunReport:
        begin = run_job if part is None else partial(run_shard, shard=part)
        return begin(
            form, chosen, remembered, fail_on=severity, listener=listener, selection=selection
        )

    with (
        _uncollected(executor),
        memory(store_of(form, cache), rehash=rehash) as remembered,
        choice.opened(
            executor,
            workers,
            scheduler,
            sees=_inputs(form),
            marks=_marks(form, remembered) if executor == "dask" else (),
            code=lambda: code_of(remembered.code),
        ) as chosen,
    ):
        return work(chosen, remembered)


@contextmanager
def _uncollected(executor: choice.Kind) -> Iterator[None]:
    """No search for cycles meanwhile: the engine makes none, and it takes half of a re-run's time.

    What plug-ins make is in other processes; with the inline executor all stays as it is.
    """
    was = gc.isenabled() and executor != "inline"
    if was:
        gc.disable()
    try:
        yield
    finally:
        if was:
            gc.enable()


def _marks(job: Job, remembered: Memory) -> list[Path]:
    """Files to put where every machine must see them."""
    kept = remembered.store.scratch()
    kept.parent.mkdir(parents=True, exist_ok=True)
    return [scratch_beside(job.output / "mark"), kept]


def _inputs(job: Job) -> list[Path]:
    """Where a job's inputs are, as far as there is anything."""
    places = [job.source, *job.dialogue.files, *(a for c in job.characters for a in c.assets)]
    places += [path for path in (job.dialogue.root, job.lexicon, job.voices) if path is not None]
    return [path for path in places if path.exists()]


def rehearse(
    job: str | Path,
    *,
    output: str | Path | None = None,
    speak: bool = False,
    cache: str | Path | Literal[False] | None = None,
    rehash: bool = False,
    selection: Selection = EVERYTHING,
) -> Rehearsal:
    """Say what `run` would do with these arguments, and why; nothing is written.

    Raises:
        JobError, PluginError, InputError: as of `run`.
    """
    form = read_job(Path(job), output=Path(output) if output is not None else None, check=False)
    if speak:
        form = replace(form, speak=True)
    folder = store_of(form, cache)
    with memory(folder, rehash=rehash, dry=folder is not None) as remembered:
        return rehearsal.rehearse(form, remembered, selection)


def store_of(job: Job, cache: str | Path | Literal[False] | None = None) -> Path | None:
    """The folder of a job's store, as `run` takes it; None for none."""
    if cache is False:
        return None
    return Path(cache) if cache is not None else job.cache or default_store()


def align(
    audio: str | Path,
    text: str | None = None,
    *,
    timings: str | Path | None = None,
    language: str = "en",
    aligner: str = "pocketsphinx",
    lexicon: str | Path | None = None,
    voice: str | Path | None = None,
) -> Alignment:
    """Find when each phone of a transcript is spoken.

    Args:
        audio: a recording that libsndfile reads, or a film with the extra ``video``.
        text: what is said in it; may be left out if there are timings that tell.
        timings: what another tool found out, in any format of ``docs/timings.md``: its phones are
            taken as they are, the times of its words and subtitles are kept to.
        language: BCP-47 tag.
        aligner: a registered aligner.
        lexicon: pronunciations that go before the aligner's own.
        voice: how the speaker sounds; see `learn_voices`.

    Returns:
        The phone track, and findings about it and the recording.

    Raises:
        InputError: audio, text or timings cannot be used, or do not fit together.
        ValueError: there is neither text nor timings.

    Example:
        >>> import animeme
        >>> from pathlib import Path
        >>> folder = Path("sample_assets/dialogue/en")
        >>> text = (folder / "welcome.txt").read_text(encoding="utf-8")
        >>> track = animeme.align(folder / "welcome.wav", text).track
        >>> [word.text for word in track.words][:2], track.phones[0].start_s
        (['welcome', 'back'], 0.0)
    """
    if text is None and timings is None:
        raise ValueError("there is neither text nor timings")
    speech = registry.stage("read-speech")(Path(audio))
    means = Means(aligner, _path(lexicon), _path(voice))
    found = align_speech(
        speech,
        None if text is None else lambda: text,
        _path(timings),
        language=language,
        means=means,
    )
    return replace(found, findings=(*speech.findings, *found.findings))


def align_folder(
    folder: str | Path,
    *,
    output: str | Path | None = None,
    format: str = "textgrid",
    language: str | None = None,
    aligner: str = "pocketsphinx",
    lexicon: str | Path | None = None,
    voices: str | Path | None = None,
    plot: str | Path | None = None,
    executor: choice.Kind = "inline",
    workers: int | None = None,
    scheduler: str | None = None,
    fail_on: str = "error",
    listener: Listener = lambda _: None,
) -> AlignReport:
    """Align every recording below a folder with the transcript or the timings beside it.

    Args:
        folder: lines of one language, or a dialogue folder (``<language>/…``).
        output: folder for a file of timings per good line, laid out as `folder` is; None writes
            nothing.
        format: of these files: "textgrid", "ctm", "phone-ctm", "rhubarb-tsv" or "alignment".
        language: BCP-47 tag of the whole folder; None for that of each language's folder, or else
            English.
        aligner: a registered aligner.
        lexicon: pronunciations that go before the aligner's own.
        voices: folder of learned voices, or one voice for all lines; see `learn_voices`.
        plot: folder for a picture per line that has timings; None draws nothing.
        executor, workers, scheduler, listener: as for `run`.
        fail_on: severity at which `AlignReport.exit_code` turns 1.

    Returns:
        How each line ended.

    Raises:
        InputError: no line can be started: see `animeme.aligning.align_lines`.
        PluginError: a plug-in that is needed cannot be loaded.
        ValueError: an argument is none of those that are listed.

    Example:
        >>> import animeme
        >>> report = animeme.align_folder("sample_assets/dialogue")
        >>> report.count("ok"), report.lines[0].id
        (18, 'de/boat')
    """
    choice.require(executor, workers, scheduler)
    severity = Severity.parse(fail_on)

    def work(chosen: Executor) -> AlignReport:
        return align_lines(
            Path(folder),
            chosen,
            language=language,
            aligner=aligner,
            lexicon=_path(lexicon),
            voices=_path(voices),
            output=_path(output),
            format=format,
            plot=_path(plot),
            fail_on=severity,
            listener=listener,
        )

    places = [path for path in (Path(folder), _path(lexicon), _path(voices)) if path is not None]
    marks = [] if output is None else [scratch_beside(Path(output) / "mark")]
    with choice.opened(executor, workers, scheduler, sees=places, marks=marks) as chosen:
        return work(chosen)


def learn_voices(
    path: str | Path,
    *,
    output: str | Path | None = None,
    language: str | None = None,
    aligner: str | None = None,
    lexicon: str | Path | None = None,
    executor: choice.Kind = "inline",
    workers: int | None = None,
    scheduler: str | None = None,
    fail_on: str = "error",
    listener: Listener = lambda _: None,
) -> VoicesReport:
    """Learn how each speaker sounds, to align their lines with more certainty.

    A voice is learned per language and character from the lines that are beyond doubt. The same
    lines give the same voice.

    Args:
        path: a job file, or a folder of recordings with their transcripts, as for `align_folder`.
        output: folder of the voices; None for the job's ``[align] voices``.
        language: BCP-47 tag of a whole folder.
        aligner: a registered aligner; None for the job's, or else "pocketsphinx".
        lexicon: pronunciations that go before the aligner's own; None for the job's.
        executor, workers, scheduler, listener: as for `run`.
        fail_on: severity at which `VoicesReport.exit_code` turns 1.

    Returns:
        What became of each voice.

    Raises:
        InputError: there are no lines, no output, or the aligner learns no voices.
        JobError: the job cannot be read.
        ValueError: an argument is none of those that are listed.

    Example:
        >>> import animeme, tempfile
        >>> voices = tempfile.mkdtemp()
        >>> report = animeme.learn_voices("sample_assets/dialogue", output=voices)
        >>> [voice.language for voice in report.voices]
        ['de', 'en', 'es']
    """
    choice.require(executor, workers, scheduler)
    severity = Severity.parse(fail_on)
    target, learner, words = _path(output), aligner or "pocketsphinx", _path(lexicon)
    if Path(path).suffix.lower() == ".toml":
        job = read_job(Path(path))
        lines: Sequence[Line] = dialogue_of(job)[0]
        target, words, learner = target or job.voices, words or job.lexicon, aligner or job.aligner
    else:
        lines = tuple(lines_below(Path(path), language, learner).values())
    if target is None:
        raise InputError(
            "output-missing",
            "nothing says where the voices are to be",
            place=str(path),
            action='Give --output, or say in the job\'s [align] section: voices = "voices".',
        )
    places = [Path(path), *([] if words is None else [words])]
    marks = [scratch_beside(target / "mark")]
    with choice.opened(executor, workers, scheduler, sees=places, marks=marks) as chosen:
        return learn(
            lines,
            chosen,
            aligner=learner,
            lexicon=words,
            output=target,
            fail_on=severity,
            listener=listener,
        )


def _path(given: str | Path | None) -> Path | None:
    return None if given is None else Path(given)


def speak(
    text: str,
    *,
    language: str = "en",
    words_per_minute: int = 160,
    output: str | Path | None = None,
) -> Spoken:
    """Speak a transcript with espeak-ng, for prototypes without a recording.

    The same arguments give the same bytes.

    Args:
        text: the transcript.
        language: BCP-47 tag.
        words_per_minute: pace, 80 to 450.
        output: a WAV file to write it to.

    Returns:
        What is heard, and its words and phones with exact times.

    Raises:
        InputError: nothing in it can be spoken, an extra is not installed, or the file cannot be
            written.
        ValueError: nobody speaks at that pace.

    Example (with the extra ``espeak``):
        >>> import animeme
        >>> spoken = animeme.speak("Ich habe 3 Hunde.", language="de")  # doctest: +SKIP
        >>> [word.text for word in spoken.alignment.track.words]  # doctest: +SKIP
        ['ich', 'habe', 'drei', 'hunde']
    """
    target = Path(output) if output is not None else Path("speech.wav")
    spoken: Spoken = registry.stage("speak")(
        text, language=language, words_per_minute=words_per_minute, source=target
    )
    if output is not None:
        registry.stage("write-speech")(spoken, target)
    return spoken


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


def load_character(path: str | Path, *, within: str | Path | None = None) -> Character:
    """The character in an asset: its meshes and their blendshapes.

    Args:
        path: the asset.
        within: folder that the other files it is made of must be in; None for the asset's own. An
            output of animeme refers to its source: there, the folder that holds both.

    Raises:
        InputError: the file is damaged, of no known format, has no blendshapes, or refers to files
            elsewhere.

    Example:
        >>> import animeme
        >>> crab = animeme.load_character("sample_assets/crab.glb")
        >>> len(crab.shapes), "MawGape" in crab.shapes
        (8, True)
    """
    file = Path(path)
    return registry.format_of(file).load(file, within=_path(within))


def strip(path: str | Path, *, output: str | Path | None = None) -> tuple[str, ...]:
    """Take animeme's animations out of an asset: what is left is its source, byte for byte.

    Args:
        path: a file that animeme wrote; its source is not needed.
        output: where to write; None for `path` itself.

    Returns:
        Names of the animations that were taken out.

    Raises:
        InputError: nothing in it is ours, or it was edited since, so that its source cannot be
            promised; nothing is written then.

    Example:
        >>> import animeme
        >>> animeme.strip("out/sample/en/crab.glb", output="crab.glb")[:2]  # doctest: +SKIP
        ('boat', 'count')
    """
    file = Path(path)
    return registry.format_of(file).strip(file, Path(output) if output is not None else file)


def review(
    shown: str | Path,
    output: str | Path,
    *,
    lines: Sequence[str] = (),
    worst: int | None = None,
    against: str | Path | None = None,
    dialogue: str | Path | None = None,
    single_file: bool = False,
) -> WrittenReview:
    """Write pages on which a person sees and hears lines, from disk, in any browser.

    Args:
        shown: a run's output folder, an animated file, or a folder of such.
        output: folder to write to.
        lines: globs over ``<language>/<line>`` or ``<line>``: these get a page; all if none.
        worst: only so many of them, the worst.
        against: another run or file, to see and hear beside it.
        dialogue: folder of the recordings; a run knows its own.
        single_file: one page that holds everything.

    Raises:
        InputError: there is nothing to be shown, or `output` cannot be written.

    Example:
        >>> import animeme
        >>> animeme.review("out/sample", "review").index  # doctest: +SKIP
        PosixPath('review/index.html')
    """
    folder = _path(dialogue)
    other = None if against is None else open_reviewable(Path(against), dialogue=folder)
    return write_review(
        open_reviewable(Path(shown), dialogue=folder), Path(output), lines=lines, worst=worst,
        other=other, single_file=single_file,
    )  # fmt: skip
