"""What reads characters from files, and writes animation into them."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, ClassVar, Protocol

if TYPE_CHECKING:
    from animeme.curves import CurveSet
    from animeme.phones import Event
    from animeme.rig import Character


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
