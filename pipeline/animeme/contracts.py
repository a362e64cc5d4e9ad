"""What a plug-in has to offer: models, aligners, formats and checks.

The engine knows none of them by name. Ours are registered through the same entry points as a
studio's, and pass the same suites (`animeme.testing`).
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, ClassVar, Protocol, Self, runtime_checkable

import numpy as np
from numpy.typing import NDArray

from animeme.curves import CurveSet
from animeme.dataset import Dataset, Listener, no_listener
from animeme.findings import Finding
from animeme.phones import Event, PhoneTrack
from animeme.rig import BoundRig, Character


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


class Model(Protocol):
    """Turns phones into control curves; knows nothing of rigs, files or audio.

    A model whose data people edit may also have a class attribute ``reads``, the kind of document
    that holds them, and a class method ``from_file(path)`` that gives the model which plays one.
    """

    name: ClassVar[str]

    @property
    def controls(self) -> tuple[str, ...]:
        """Names of the curves that `synthesize` returns."""
        ...

    @classmethod
    def default(cls) -> Self:
        """The model as shipped, without training.

        Raises:
            InputError: this model works only when fitted.
        """
        ...

    @classmethod
    def configured(cls, options: Mapping[str, Any]) -> Self:
        """The model with these options, ready to be fitted.

        Args:
            options: name → value, or its text, as ``--set`` gives it.

        Raises:
            InputError: an option is unknown, or a value makes no sense.
        """
        ...

    def fit(self, dataset: Dataset, *, listener: Listener = no_listener) -> Self:
        """A new model with the same options, fitted to captured motion.

        The same dataset gives the same model, to the last bit. Where values are missing (NaN) the
        model learns from the rest.

        Raises:
            InputError: there is nothing to learn from.
        """
        ...

    @classmethod
    def from_document(cls, document: Mapping[str, Any]) -> Self:
        """Rebuild a model from an ``animeme.model`` document.

        Raises:
            ValueError: the document does not fit this model.
        """
        ...

    def to_document(self) -> dict[str, Any]:
        """JSON-safe ``animeme.model`` document that rebuilds this model bit-exactly."""
        ...

    def synthesize(self, track: PhoneTrack, *, rate_hz: float) -> CurveSet:
        """Curves over the whole track, sampled at `rate_hz` and wherever the model needs a key."""
        ...

    def remarks(self, track: PhoneTrack) -> Iterable[Finding]:
        """What a person should know about the motion of `track`: phones never seen, for one."""
        ...


@dataclass(frozen=True)
class LineAnimation:
    """One line's finished curves, on their way into an asset.

    Attributes:
        name: of the animation in the asset; unique within a file.
        language: BCP-47 tag.
        curves: over the character's canonical shape names (see `Character.canonical`).
        duration_s: length of the recording.
        events: the transcript's inline tags, which the asset carries beside the animation.
        audio_start_s: when the recording starts; before it the animation has its pre-roll.
        audio: the recording, or what was spoken for want of one; None if there is none to refer to.
    """

    name: str
    language: str
    curves: CurveSet
    duration_s: float
    events: tuple[Event, ...] = ()
    audio_start_s: float = 0.0
    audio: Path | None = None

    @property
    def end_s(self) -> float:
        """When recording and motion are both over."""
        return max(self.audio_start_s + self.duration_s, self.curves.duration_s)


Verify = Callable[[Path], None]


def unverified(_: Path) -> None:
    """Accept any file."""


class Format(Protocol):
    """Reads characters from, and writes animation into, one family of asset files."""

    name: ClassVar[str]
    suffixes: ClassVar[tuple[str, ...]]
    assembly_suffix: ClassVar[str]
    """Suffix of the files of `write_assembly`, "" where the format has no such thing."""

    def output_suffix(self, source: Path) -> str:
        """Suffix of the files that `write` makes from `source`."""
        ...

    def load(self, path: Path, *, within: Path | None = None) -> Character:
        """The character in the file at `path`.

        Args:
            path: the asset.
            within: folder that the files it is made of must be in; its own if None. Formats that
                deliver those files beside it may insist on its own.

        Raises:
            InputError: the file is damaged, has no blendshape that could be driven, or is made of
                files elsewhere.
        """
        ...

    def for_layout(self, layout: str, character: Character) -> Format:
        """The format that writes `character` in one of the job file's layouts.

        Raises:
            InputError: ``layout-unsupported``: this asset cannot have it; says why.
        """
        ...

    def companions(self, character: Character) -> Mapping[str, Path]:
        """Other files that `write` puts beside its target: path below its folder → their source.

        Raises:
            InputError: the asset refers to files outside its folder.
        """
        ...

    def inputs(self, character: Character) -> Iterable[Path]:
        """Files besides `character.source` that the character is made of, wherever they lie.

        When one of them changes, the asset is read and written anew.
        """
        ...

    def write(
        self,
        character: Character,
        lines: Sequence[LineAnimation],
        target: Path,
        *,
        verify: Verify = unverified,
    ) -> tuple[Path, ...]:
        """Write `character` with one animation per line to `target`, atomically.

        The source is only read. Shapes that no curve drives keep their rest weight.

        Args:
            character: whose asset it is.
            lines: what to write.
            target: the file to write.
            verify: called with the finished file before it takes `target`'s name; if it raises,
                what was at `target` stays.

        Returns:
            Every file written, `target` first.

        Raises:
            InputError: the asset cannot take the animation, or `target` cannot be written.
        """
        ...

    def write_assembly(
        self,
        character: Character,
        by_language: Mapping[str, Path],
        target: Path,
        *,
        verify: Verify = unverified,
    ) -> tuple[Path, ...]:
        """Join the files that `write` made for each language, where the format can.

        Args:
            character: whose they are.
            by_language: language tag → a file that `write` made.
            target: where to write.
            verify: as for `write`.

        Returns:
            The files written; none where the format has no such thing.
        """
        ...

    def read_animations(self, path: Path) -> dict[str, CurveSet]:
        """Weight curves of every animation in the file, by name, over canonical shape names."""
        ...

    def strip(self, path: Path, target: Path) -> tuple[str, ...]:
        """Write the source of a file that `write` made to `target`, byte for byte.

        Args:
            path: the file.
            target: where to write; may be `path`.

        Returns:
            Names of the animations that were taken out.

        Raises:
            InputError: nothing in it is ours, it was edited since, or the format has no need of
                this; nothing is written then.
        """
        ...

    def harm(self, character: Character, output: Path) -> list[str]:
        """What `output` lost or changed of the source: one sentence each, [] if nothing.

        Raises:
            InputError: `output` cannot be read.
        """
        ...


@dataclass(frozen=True)
class LineSubject:
    """What a check of one line sees.

    Attributes:
        track: the aligned phones.
        controls: the model's curves.
        rig: the bound rig.
        shapes: what will be written, after retargeting and key reduction.
    """

    track: PhoneTrack
    controls: CurveSet
    rig: BoundRig
    shapes: CurveSet


@dataclass(frozen=True)
class AssetSubject:
    """What a check of one written file sees.

    Attributes:
        character: the source.
        format: which wrote it.
        output: the file.
        lines: what should be in it.
    """

    character: Character
    format: Format
    output: Path
    lines: tuple[LineAnimation, ...]


class Check(Protocol):
    """Judges one line's curves or one written asset.

    Those of delivered files are asked more: `animeme.delivery.DeliveryCheck`.

    Attributes:
        id: permanent and unique.
        subject: what `run` is given.
        rationale: why it matters, for the person who reads the finding.
    """

    id: ClassVar[str]
    subject: ClassVar[str]
    rationale: ClassVar[str]

    def run(self, subject: Any) -> Iterable[Finding]:
        """Findings about `subject`; none if all is well."""
        ...
