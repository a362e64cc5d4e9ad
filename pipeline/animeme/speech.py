"""Recordings and what is said in them: aligned, learned from, spoken; import from `animeme`."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

from animeme import registry
from animeme.aligning import AlignReport, align_lines, lines_below
from animeme.contracts import Alignment, Spoken
from animeme.dialogue import Line
from animeme.errors import InputError
from animeme.executors import choice
from animeme.files import scratch_beside
from animeme.findings import Severity
from animeme.job import read_job
from animeme.preflight import dialogue_of
from animeme.steps import Means, align_speech
from animeme.voices import VoicesReport
from animeme.voices import learn_voices as learn
from animeme.work import Listener


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

    places = [path for path in (Path(folder), _path(lexicon), _path(voices)) if path is not None]
    marks = [] if output is None else [scratch_beside(Path(output) / "mark")]
    with choice.opened(executor, workers, scheduler, sees=places, marks=marks) as chosen:
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


def _path(given: str | Path | None) -> Path | None:
    return None if given is None else Path(given)
