"""How the controls of any model are understood by any profile.

The common tongue is ARKit's 52 controls. A profile may name the model's controls itself; else
controls that are the poses of a shipped family (a bigram set with SmartBody's ``open``, ``W``, …)
are read as what these poses show, in ARKit's controls.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from animeme.rig import RigProfile
from animeme_stages.retarget.profile_files import arkit_controls, profile_names, shipped_profile
from animeme_stages.retarget.spelling import spelling

Floats = NDArray[np.float64]
_SPEECH = ("jaw", "mouth", "tongue")


@dataclass(frozen=True, eq=False)
class Understanding:
    """What a profile makes of a model's controls.

    Attributes:
        mix: shape (N controls, S shapes of the profile), the gains of what is driven outright.
        shapes: S names.
        arkit: shape (N controls, 52), what of ARKit's controls each control shows; poses are
            solved for it.
        solved: names of the poses to be solved for.
    """

    mix: Floats
    shapes: tuple[str, ...]
    arkit: Floats
    solved: tuple[str, ...]

    @property
    def moves_anything(self) -> bool:
        """Whether any control moves any shape."""
        return bool(self.mix.any() or (self.solved and self.arkit.any()))


def as_understood(controls: Sequence[str], profile: RigProfile) -> Understanding:
    """What `profile` makes of controls of these names; see `Understanding`."""
    common = arkit_controls()
    strangers = [c for c in controls if c not in common and c not in profile.drives]
    # The rig's own poses are driven as they are: a set made for this rig needs no translation.
    poses = {spelling(shape): shape for shape in profile.poses}
    direct = {c: poses[spelling(c)] for c in strangers if spelling(c) in poses}
    if len(direct) * 2 < len(strangers):
        direct = {}
    translated = _translated([c for c in strangers if c not in direct])
    arkit = np.zeros((len(controls), len(common)))
    for row, control in enumerate(controls):
        if control in common:
            arkit[row, common.index(control)] = 1.0
        for name, value in translated.get(control, {}).items():
            arkit[row, common.index(name)] = value
    named = {*controls} & {*profile.drives}
    through = [c for c in common if arkit[:, common.index(c)].any() and c in profile.drives]
    sources = dict.fromkeys([*(c for c in controls if c in named), *through])
    shapes = tuple(
        dict.fromkeys([*(d.shape for c in sources for d in profile.drives[c]), *direct.values()])
    )
    column = {shape: index for index, shape in enumerate(shapes)}
    mix = np.zeros((len(controls), len(shapes)))
    for row, control in enumerate(controls):
        shares = {control: 1.0} if control in named else translated.get(control, {})
        for name, share in shares.items():
            for drive in profile.drives.get(name, ()):
                mix[row, column[drive.shape]] += share * drive.gain
        if control in direct:
            mix[row, column[direct[control]]] += 1.0
    # What is driven outright is not solved for a second time.
    arkit[:, [index for index, name in enumerate(common) if name in profile.drives]] = 0.0
    solved = tuple(shape for shape, pose in profile.poses.items() if pose)
    return Understanding(mix, shapes, arkit, solved if arkit.any() and not direct else ())


def _translated(controls: Sequence[str]) -> dict[str, dict[str, float]]:
    """ARKit's controls that each of `controls` shows, as the poses of the family it belongs to."""
    best: dict[str, dict[str, float]] = {}
    for _, poses in _families():
        found = {c: dict(poses[spelling(c)]) for c in controls if spelling(c) in poses}
        best = found if len(found) > len(best) else best
    return best


@lru_cache(maxsize=1)
def _families() -> tuple[tuple[str, dict[str, dict[str, float]]], ...]:
    """Per shipped profile with poses: its poses, and those of its aliases, by spelling."""
    families = []
    for name in profile_names():
        profile = shipped_profile(name)
        poses = {
            spelling(alias): dict(pose)
            for shape, pose in profile.poses.items()
            for alias in (*profile.aliases.get(shape, ()), shape)
        }
        families.append((name, poses))
    return tuple(families)


def is_speech(profile: RigProfile, shape: str) -> bool:
    """Whether speech moves a shape of a profile: a pose, or driven by the jaw, mouth or tongue."""
    driven = any(
        control.startswith(_SPEECH) and shape in (drive.shape for drive in drives)
        for control, drives in profile.drives.items()
    )
    return shape in profile.poses or shape == profile.rest or driven
