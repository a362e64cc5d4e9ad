"""What is spoken, when, and who finds out: aligners."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, ClassVar, Protocol, runtime_checkable

from animeme.findings import Finding
from animeme.phones import PhoneTrack

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray


@dataclass(frozen=True, eq=False)
class Speech:
    """A recording, ready for an aligner.

    Attributes:
        source: the file it was read from.
        samples: mono, int16, shape (S,).
        rate_hz: sampling rate of `samples`.
        duration_s: length of the recording as delivered, before any resampling.
        findings: what its reader noticed.
    """

    source: Path
    samples: NDArray[np.int16]
    rate_hz: int
    duration_s: float
    findings: tuple[Finding, ...] = ()


@dataclass(frozen=True)
class Anchor:
    """A stretch of a transcript whose time somebody knows: a timed word, or a subtitle.

    Attributes:
        start, end: character positions in the transcript.
        start_s, end_s: when it is spoken, seconds from the start of the recording.
        slack_s: by how much these may be wrong, either way.
    """

    start: int
    end: int
    start_s: float
    end_s: float
    slack_s: float


@dataclass(frozen=True)
class Alignment:
    """An aligner's answer: the phones, and what a person should know about them.

    Attributes:
        track: the phones.
        findings: what speaks against them.
        score: the aligner's confidence that recording and transcript belong together, 0 to 1;
            None where it has none, or the timings were given.
    """

    track: PhoneTrack
    findings: tuple[Finding, ...] = ()
    score: float | None = None


@dataclass(frozen=True, eq=False)
class Spoken:
    """A transcript that a program has spoken: what is heard, and when.

    Attributes:
        samples: mono, int16, shape (S,), as the voice made them.
        rate_hz: sampling rate of `samples`.
        speech: the same, ready for an aligner.
        alignment: its words and phones, from the voice itself.
    """

    samples: NDArray[np.int16]
    rate_hz: int
    speech: Speech
    alignment: Alignment


class Aligner(Protocol):
    """Finds when each phone of a transcript is spoken.

    Results depend on the arguments alone, never on what was aligned before. One that has a method
    ``lexicon_part(text, *, language, lexicon) -> str`` says with it what of a lexicon counts for a
    text, "" for nothing, so that a changed entry has only those lines aligned again that have its
    word; without it every line is.
    """

    name: ClassVar[str]

    def languages(self) -> frozenset[str]:
        """Primary language subtags that it can align ("en", "de", …)."""
        ...

    def align(
        self,
        speech: Speech,
        text: str,
        *,
        language: str,
        lexicon: Path | None = None,
        anchors: Sequence[Anchor] = (),
        voice: Path | None = None,
    ) -> Alignment:
        """Align `text` with `speech`.

        Args:
            speech: the recording.
            text: its transcript.
            language: BCP-47 tag.
            lexicon: pronunciations that go before the aligner's own.
            anchors: times that are known; a word whose place in `text` is within one is spoken
                within its time.
            voice: how the speaker sounds, as this aligner learned it (see `VoiceLearner`).

        Raises:
            InputError: text, audio or voice cannot be used, or text and audio do not belong
                together.
        """
        ...


@dataclass(frozen=True)
class LearnedVoice:
    """What a voice was learned from.

    Attributes:
        lines: how many were learned from.
        refused: how many were in doubt or could not be aligned.
        audio_s: length of those learned from, seconds.
        written: whether that was enough for a voice.
    """

    lines: int
    refused: int
    audio_s: float
    written: bool


@runtime_checkable
class VoiceLearner(Protocol):
    """What an aligner may offer: to learn how a speaker sounds, and to align better with it."""

    def learn_voice(
        self,
        lines: Iterable[tuple[Speech, str]],
        target: Path,
        *,
        language: str,
        lexicon: Path | None = None,
    ) -> LearnedVoice:
        """Learn from lines of one speaker, and write to `target` what `align` takes as `voice`.

        Args:
            lines: recordings with their transcripts, in an order that is always the same; lines in
                doubt are left out.
            target: file to write; left alone if the lines tell too little.
            language: BCP-47 tag of all lines.
            lexicon: pronunciations that go before the aligner's own.

        Raises:
            InputError: the lexicon or `target` cannot be used.
        """
        ...
