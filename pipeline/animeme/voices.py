"""Voices: what an aligner learns of each speaker, one file per language and character."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterator, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from animeme import registry
from animeme.contracts import LearnedVoice, Speech, VoiceLearner
from animeme.dialogue import Line, transcript_of, voice_path
from animeme.errors import InputError
from animeme.executors import Executor, Result
from animeme.findings import Finding, Severity, exit_code_of
from animeme.ledger import fault_of
from animeme.work import RETRIES, Listener, Progress, name_of

# More lines than this teach no more: every so-many-th is taken.
MOST_LINES = 500
# Every line is looked at three times.
TIMEOUT_S = 3600.0


@dataclass(frozen=True)
class VoiceItem:
    """Work on one voice.

    Attributes:
        lines: of one speaker in one language, sorted.
        aligner: name of the aligner.
        lexicon: pronunciations of the user's, or None.
        output: file to write.
    """

    lines: tuple[Line, ...]
    aligner: str
    lexicon: Path | None
    output: Path


@dataclass(frozen=True)
class Voice:
    """What became of a voice.

    Attributes:
        language: BCP-47 tag.
        character: whose it is, "" for lines that are no character's own.
        learned: from what; None where the work failed.
        output: its file, None if none was written.
        findings: why not.
    """

    language: str
    character: str
    learned: LearnedVoice | None
    output: Path | None
    findings: tuple[Finding, ...] = ()


@dataclass(frozen=True)
class VoicesReport:
    """What became of all voices, sorted by language and character."""

    voices: tuple[Voice, ...]
    fail_on: Severity

    @property
    def exit_code(self) -> int:
        """0 all well; 1 something is at or above `fail_on`; 3 a fault of ours among it."""
        return exit_code_of((f for voice in self.voices for f in voice.findings), self.fail_on)

    def to_json(self) -> dict[str, Any]:
        """For programs."""
        return {
            "exit_code": self.exit_code,
            "voices": [
                {
                    "language": voice.language,
                    "character": voice.character,
                    "output": None if voice.output is None else str(voice.output),
                    **(asdict(voice.learned) if voice.learned else {}),
                    "findings": [finding.to_json() for finding in voice.findings],
                }
                for voice in self.voices
            ],
        }


def learn_voices(
    lines: Sequence[Line],
    executor: Executor,
    *,
    aligner: str,
    lexicon: Path | None,
    output: Path,
    fail_on: Severity = Severity.ERROR,
    listener: Listener = lambda _: None,
) -> VoicesReport:
    """Learn the voice of each character in each language.

    Args:
        lines: recordings with transcripts.
        executor: who does it.
        aligner: a registered aligner.
        lexicon: pronunciations that go before the aligner's own.
        output: folder of the voices; see `animeme.dialogue.voice_path`.
        fail_on: severity at which the report's exit code turns 1.
        listener: told of progress.

    Raises:
        InputError: the aligner learns no voices, or the lexicon is broken.
        PluginError: a plug-in that is needed cannot be loaded.
    """
    if not isinstance(registry.aligner(aligner), VoiceLearner):
        raise InputError(
            "voice-unsupported",
            f"'{aligner}' learns no voices",
            place="--aligner",
            action="Choose another aligner, or align without voices.",
        )
    if lexicon is not None:
        registry.stage("check-lexicon")(lexicon)
    speakers: dict[tuple[str, str], list[Line]] = defaultdict(list)
    for line in sorted(lines, key=lambda line: line.key):
        speakers[line.language, line.character].append(line)
    items = [
        VoiceItem(_thinned(own), aligner, lexicon, voice_path(output, *speaker))
        for speaker, own in sorted(speakers.items())
    ]
    results = executor.run(name_of(learn_one), items, timeout_s=TIMEOUT_S, retries=RETRIES)
    ended: dict[int, Voice] = {}
    for done, result in enumerate(results, 1):
        ended[result.index] = _ended(items[result.index], result)
        listener(Progress("voices", done, len(items), 0))
    return VoicesReport(tuple(ended[index] for index in sorted(ended)), fail_on)


def learn_one(item: VoiceItem) -> LearnedVoice:
    """Learn one voice and write its file."""
    learner = registry.aligner(item.aligner)
    assert isinstance(learner, VoiceLearner)
    first = item.lines[0]
    return learner.learn_voice(
        _readable(item.lines), item.output, language=first.language, lexicon=item.lexicon
    )


def _thinned(lines: Sequence[Line]) -> tuple[Line, ...]:
    """At most `MOST_LINES` of them, from all over."""
    step = -(-len(lines) // MOST_LINES)
    return tuple(lines[::step])


def _readable(lines: Sequence[Line]) -> Iterator[tuple[Speech, str]]:
    for line in lines:
        try:
            if not line.findings:
                yield (
                    registry.stage("read-speech")(line.audio),
                    transcript_of(line),
                )
        except InputError:
            continue  # aligning says what is wrong with it


def _ended(item: VoiceItem, result: Result) -> Voice:
    first = item.lines[0]
    learned: LearnedVoice | None = result.value
    if learned is None:
        fault = fault_of(result, str(item.output), "`--executor inline` may show more.")
        return Voice(first.language, first.character, None, None, (fault,))
    if learned.written:
        return Voice(first.language, first.character, learned, item.output)
    finding = Finding(
        Severity.WARNING,
        "voice-too-little",
        f"{learned.lines} lines that are beyond doubt, {learned.audio_s:.1f} s: "
        "too little to learn a voice from",
        place=str(item.output),
        action="Align without a voice, or learn it when there are more recordings.",
    )
    return Voice(first.language, first.character, learned, None, (finding,))
