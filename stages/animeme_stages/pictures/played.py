"""What a file's animation of one line does to the character's shapes."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from animeme import registry
from animeme.curves import CurveSet
from animeme.deliveries import seen, tracks_of
from animeme.delivery import StoredTrack
from animeme.documents import suggestion
from animeme.errors import InputError
from animeme.rig import Character


@dataclass(frozen=True, eq=False)
class Played:
    """An animation, read back from its file.

    Attributes:
        name: of the animation.
        curves: weights of all canonical shapes.
        audio_start_s: when the recording starts, on the curves' time axis.
    """

    name: str
    curves: CurveSet
    audio_start_s: float

    def weights(self, time_s: float) -> dict[str, float]:
        """Canonical shape → weight at a time of the recording."""
        row = self.curves.sample(time_s + self.audio_start_s)[0]
        return dict(zip(self.curves.names, row.tolist(), strict=True))

    @property
    def duration_s(self) -> float:
        """How long it moves once the recording has started; at least a moment."""
        return max(self.curves.duration_s - self.audio_start_s, 0.0)


def read_played(character: Character, animation: str) -> Played:
    """The animation called `animation` in the character's file.

    Raises:
        InputError: ``picture-animation-unknown``; ``picture-animation-broken``.
    """
    form = registry.format_named(character.format)
    tracks = tracks_of(form, character)
    own = [track for track in tracks if track.animation == animation]
    place = str(character.source)
    if not own:
        names = list(dict.fromkeys(track.animation for track in tracks))
        still = animation in character.animations
        problem = (
            f"its animation '{animation}' moves no blendshape"
            if still
            else f"has no animation '{animation}'"
        )
        action = suggestion(animation, names) if names else "Run the job first: animeme run."
        raise InputError("picture-animation-unknown", problem, place=place, action=action)
    sound = [track for track in own if track.sound]
    # Rows of somebody else's that do not fit are left out when a line is read, as players do.
    if not sound and (curves := form.read_animations(character.source).get(animation)) is not None:
        sound = [StoredTrack(animation, own[0].place, curves.names, curves.times_s, curves.weights)]
    if not sound:
        fault = next((said for _, said in (t.fault for t in own) if said), "its keys are not sound")
        raise InputError(
            "picture-animation-broken",
            f"its animation '{animation}' cannot be played: {fault}",
            place=f"{place}: {own[0].place}",
            action="Run the job again, or export the animation anew.",
        )
    note = next((track.note for track in own if track.note), {})
    return Played(animation, seen(sound, character.rest_weights()), _seconds(note))


def _seconds(note: Any) -> float:
    value = note.get("audio_start_s", 0.0)
    return float(value) if isinstance(value, int | float) else 0.0
