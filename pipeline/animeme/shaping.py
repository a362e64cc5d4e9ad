"""From a timed line to the curves of one character: a model's or by hand, edits, retargeting, keys.

Everything here is on the animation's time axis: 0 is where the animation starts, `preroll_s` before
the recording.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from fractions import Fraction
from pathlib import Path

import numpy as np

from animeme import registry
from animeme.curve_options import CurveOptions
from animeme.curves import CurveSet, reduce_keys
from animeme.dialogue import Line, has_transcript, transcript_of
from animeme.documents import suggestion
from animeme.edits import (
    SAME_TIME_S,
    PlacedEdit,
    Stage,
    apply_edits,
    placed,
    read_edits,
    strangers,
    text_changed,
)
from animeme.errors import InputError
from animeme.findings import Finding, Severity
from animeme.phones import SILENCE, Phone, PhoneTrack
from animeme.rig import BoundRig, Character
from animeme.side_cars import drawn
from animeme.timing import FrameRate

# Hand-made curves may end on the last frame, which covers the end of the audio: at most one frame
# of film behind it.
OVERHANG_S = 0.05
# Hand-made curves that stop this long before the last phone ends have lost something.
SHORT_S = 0.25


@dataclass(frozen=True)
class Shaped:
    """The motion of a line on one character.

    Attributes:
        controls: what the shapes were made from; the shapes themselves if they were drawn by hand.
        shapes: what will be written.
        heard: the same, with the line's `offset_s` taken back: in time with its phones.
        findings: what a person should know.
    """

    controls: CurveSet
    shapes: CurveSet
    heard: CurveSet
    findings: tuple[Finding, ...]


class LineMotion:
    """The motion of one line, for any number of characters.

    Attributes:
        track: the line with the pre-roll before it: what models are given.
    """

    def __init__(self, line: Line, track: PhoneTrack, options: CurveOptions) -> None:
        self._line = line
        self._options = options
        self.track = led(track, options.preroll_s)

    def of(
        self, character: str, asset: Character, rig: BoundRig, synthesized: CurveSet | None
    ) -> Shaped:
        """The motion on one asset of a character.

        Args:
            character: its name in the job.
            asset: what is moved.
            rig: how.
            synthesized: what the character's model made of `track`; None where the line has curves
                by hand (see `drawn`).

        Raises:
            InputError: curves or edits by hand cannot be used.
        """
        edits, findings = self._edits(character)
        rest = asset.rest_weights()
        if synthesized is None:
            by_hand = drawn(self._line, character)
            assert by_hand is not None
            controls, shapes, noted = self._read(by_hand, asset, rig)
            findings += noted
        else:
            controls, shapes = synthesized, None
        lead_s = self._options.preroll_s
        if shapes is None:
            of_controls = Stage("control", {name: name for name in rig.profile.drives}, {})
            controls, stale = apply_edits(controls, edits, of_controls, self.track, lead_s)
            findings += stale
            shapes = registry.stage("retarget")(controls, rig, rest)
        else:
            findings += _beside_shapes(edits)
        assert shapes is not None
        names = {**rig.mapped, **{shape: shape for shape in asset.shapes}}
        of_shapes = Stage("shape", names, rest)
        edited, stale = apply_edits(shapes, edits, of_shapes, self.track, lead_s)
        findings += stale
        return self._finished(controls, edited, tuple(findings))

    def _finished(
        self, controls: CurveSet, shapes: CurveSet, findings: tuple[Finding, ...]
    ) -> Shaped:
        options = self._options
        end_s = self.track.duration_s + max(options.offset_s, 0.0)
        moved = shifted(shapes, options.offset_s, end_s)
        if options.uniform:
            rate = options.frame_rate or FrameRate(Fraction(options.rate_hz))
            times_s = rate.times_s(end_s)
            keyed = CurveSet(times_s, moved.names, moved.sample(times_s))
        else:
            keyed = reduce_keys(moved, options.max_error)
        heard = keyed
        if options.offset_s:
            heard = CurveSet(keyed.times_s - options.offset_s, keyed.names, keyed.weights)
        return Shaped(controls, keyed, heard, findings)

    def _edits(self, character: str) -> tuple[tuple[PlacedEdit, ...], list[Finding]]:
        edits: list[PlacedEdit] = []
        findings: list[Finding] = []
        for path in self._line.files_of("edits", character):
            document = read_edits(path)
            edits += placed(document, path)
            if document.made_for_text is not None and has_transcript(self._line):
                findings += text_changed(document, path, transcript_of(self._line))
        mine = (entry for entry in edits if entry.edit.character in (None, character))
        return tuple(mine), findings

    def strangers(self, speakers: Sequence[str]) -> Iterator[Finding]:
        """Edits for none of those who speak the line; broken files are told elsewhere."""
        characters = tuple(dict.fromkeys(speakers))
        for character in ("", *characters):
            for path in self._line.files_of("edits", character, alone=True):
                try:
                    edits = placed(read_edits(path), path)
                except InputError:
                    continue
                yield from strangers(edits, (character,) if character else characters)

    def _read(
        self, path: Path, asset: Character, rig: BoundRig
    ) -> tuple[CurveSet, CurveSet | None, list[Finding]]:
        """Hand-made curves on the animation's time axis; as shapes too, if that is what they are.

        Raises:
            InputError: they cannot be read, or not one of them belongs to model or character.
        """
        lead_s = self._options.preroll_s
        read = registry.stage("read-curves")
        raw, noted = read(path, frame_rate=self._options.frame_rate)
        findings = [*noted, *self._misfit(raw, path)]
        curves = shifted(raw, lead_s, self.track.duration_s)
        own = {**rig.mapped, **{shape: shape for shape in asset.shapes}}
        as_shapes = {name: own[name] for name in curves.names if name in own}
        as_controls = {name: name for name in curves.names if name in rig.profile.drives}
        # What is both is a shape: curves that came out of an asset go back in as they are.
        meant = as_shapes if len(as_shapes) >= len(as_controls) else as_controls
        moving = np.abs(curves.weights).max(axis=0, initial=0.0) > 0
        unknown = [
            name
            for name, moves in zip(curves.names, moving, strict=True)
            if moves and name not in meant
        ]
        if not meant:
            known = (*rig.profile.drives, *asset.shapes)
            raise InputError(
                "curves-unknown",
                f"not one of its columns is a control or a shape: {_listed(curves.names)}",
                place=str(path),
                action=suggestion(curves.names[0], known),
            )
        if unknown:
            findings.append(
                Finding(
                    Severity.WARNING,
                    "curves-column-unknown",
                    f"columns that nothing on this character answers to: {_listed(unknown)}",
                    place=str(path),
                    action="Rename them as `animeme rig ASSET` has them, or take them out.",
                )
            )
        kept = _named(curves, meant)
        return kept, kept if meant is as_shapes else None, findings

    def _misfit(self, curves: CurveSet, path: Path) -> Iterator[Finding]:
        """Curves that are longer or shorter than the line."""
        lead_s = self._options.preroll_s
        end_s = self.track.duration_s - lead_s
        if curves.duration_s > end_s + OVERHANG_S:
            yield Finding(
                Severity.WARNING,
                "curves-overhang",
                f"go on to {curves.duration_s:.2f} s, the recording ends at {end_s:.2f} s",
                place=str(path),
                action="They are cut there; check that both are of the same take.",
            )
        spoken = [phone.end_s for phone in self.track.phones if phone.symbol != SILENCE]
        last_s = max(spoken, default=0.0) - lead_s
        if curves.duration_s < last_s - SHORT_S:
            yield Finding(
                Severity.WARNING,
                "curves-short",
                f"end at {curves.duration_s:.2f} s, the speech at {last_s:.2f} s",
                place=str(path),
                action="Their last key is held; check that both are of the same take.",
            )


def _beside_shapes(edits: tuple[PlacedEdit, ...]) -> Iterator[Finding]:
    for entry in edits:
        if entry.edit.control is not None:
            yield Finding(
                Severity.WARNING,
                "edit-no-effect",
                f"changes the control '{entry.edit.control}', but the line has hand-made curves "
                "of shapes",
                place=entry.place,
                action="Change the curves, or edit the shape.",
            )


def _named(curves: CurveSet, names: dict[str, str]) -> CurveSet:
    """Those of `curves` that are in `names`, under their new names; the first where two meet."""
    columns: dict[str, int] = {}
    for i, name in enumerate(curves.names):
        if name in names:
            columns.setdefault(names[name], i)
    return CurveSet(curves.times_s, tuple(columns), curves.weights[:, list(columns.values())])


def _listed(names: Sequence[str]) -> str:
    more = len(names) - 8
    return ", ".join(names[:8]) + (f" and {more} more" if more > 0 else "")


def led(track: PhoneTrack, lead_s: float) -> PhoneTrack:
    """The track with `lead_s` more silence before it: so models prepare the first phone in it."""
    if not lead_s:
        return track
    later = tuple(
        replace(phone, start_s=phone.start_s + lead_s, end_s=phone.end_s + lead_s)
        for phone in track.phones
    )
    if later[0].symbol == SILENCE:
        later = (replace(later[0], start_s=0.0), *later[1:])
    else:
        later = (Phone(SILENCE, 0.0, later[0].start_s), *later)
    words = tuple(
        replace(word, start_s=word.start_s + lead_s, end_s=word.end_s + lead_s)
        for word in track.words
    )
    events = tuple(replace(event, time_s=event.time_s + lead_s) for event in track.events)
    return replace(track, phones=later, words=words, events=events)


def shifted(curves: CurveSet, by_s: float, end_s: float) -> CurveSet:
    """Curves moved by `by_s`, from 0 to `end_s`: cut there, and held where they do not reach."""
    times_s = curves.times_s + by_s if by_s else curves.times_s
    if times_s[0] == 0.0 and times_s[-1] == end_s:
        return curves
    inside = times_s[(times_s > SAME_TIME_S) & (times_s < end_s - SAME_TIME_S)]
    at_s = np.concatenate([[0.0], inside, [end_s]])
    return CurveSet(at_s, curves.names, curves.sample(at_s - by_s))
