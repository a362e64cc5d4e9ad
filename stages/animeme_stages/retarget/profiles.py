"""Which profile fits a character, and what it drives there."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path

from animeme import documents
from animeme.errors import InputError
from animeme.rig import BoundRig, Character, Drive, RigProfile, Total
from animeme_stages.retarget.controls import as_understood, is_speech
from animeme_stages.retarget.profile_files import (
    is_file,
    profile_names,
    read_profile,
    shipped_profile,
)
from animeme_stages.retarget.spelling import matches


def bind(profile: RigProfile, character: Character) -> BoundRig:
    """Match a profile's shapes to the character's own names (see `spelling.matches`).

    A shape that the character lacks is moved by the first of its fall-backs that the character has.
    """
    stand_ins = [d.shape for drives in profile.fallbacks.values() for d in drives]
    shapes = tuple(dict.fromkeys((*profile.shapes, *stand_ins)))
    binds: dict[str, tuple[Drive, ...]] = {}
    own = {
        shape: _bound_name(names, character, binds)
        for shape, names in matches(shapes, profile.aliases, character).items()
    }
    mapped = {shape: own[shape] for shape in profile.shapes if shape in own}
    missing = tuple(shape for shape in profile.shapes if shape not in own)
    fallbacks = {}
    for shape in missing:
        nearest = next((d for d in profile.fallbacks.get(shape, ()) if d.shape in own), None)
        if nearest is not None:
            fallbacks[shape] = Drive(own[nearest.shape], nearest.gain)
    bound = _renamed(profile, mapped, fallbacks)
    used = set(bound.shapes)
    kept = {name: drives for name, drives in binds.items() if name in used}
    return BoundRig(bound, mapped, missing, fallbacks, kept)


def _bound_name(
    names: Sequence[str], character: Character, binds: dict[str, tuple[Drive, ...]]
) -> str:
    """The shape that `names` come to; what is more than one shape is noted in `binds`."""
    expression = character.expressions.get(names[0])
    drives = expression or tuple(Drive(name) for name in names)
    if len(drives) == 1 and drives[0].gain == 1.0:
        return drives[0].shape
    name = names[0]
    if expression is not None and name in character.shapes:
        name = f"{name} (expression)"
    binds[name] = drives
    return name


def _renamed(
    profile: RigProfile, mapped: Mapping[str, str], fallbacks: Mapping[str, Drive]
) -> RigProfile:
    """The profile in the character's names, without what the character lacks."""

    def drives(entries: Sequence[Drive]) -> tuple[Drive, ...]:
        made = []
        for entry in entries:
            if entry.shape in mapped:
                made.append(Drive(mapped[entry.shape], entry.gain))
            elif stand_in := fallbacks.get(entry.shape):
                made.append(Drive(stand_in.shape, entry.gain * stand_in.gain))
        return tuple(made)

    def every(names: Sequence[str]) -> bool:
        return all(name in mapped for name in names)

    driven = {control: drives(entries) for control, entries in profile.drives.items()}
    totals = [(tuple(mapped[s] for s in t.shapes if s in mapped), t.most) for t in profile.totals]
    return RigProfile(
        name=profile.name,
        drives={control: entries for control, entries in driven.items() if entries},
        limits={mapped[s]: limits for s, limits in profile.limits.items() if s in mapped},
        ceilings={mapped[s]: mapped[c] for s, c in profile.ceilings.items() if every((s, c))},
        poses={mapped[s]: pose for s, pose in profile.poses.items() if s in mapped},
        rest=mapped.get(profile.rest, ""),
        correctives={
            mapped[s]: replace(entry, of=tuple(mapped[o] for o in entry.of))
            for s, entry in profile.correctives.items()
            if every((s, *entry.of))
        },
        totals=tuple(Total(shapes, most) for shapes, most in totals if len(shapes) > 1),
    )


def detect(character: Character) -> BoundRig:
    """The shipped profile that explains most of the character's shapes.

    A profile is taken only if the character has enough of the shapes that speech moves
    (`RigProfile.detect_at`), or names one of them as an expression of its own.

    Raises:
        InputError: none fits; says how to go on.
    """
    fitting = []
    for name in profile_names():
        profile = shipped_profile(name)
        bound = bind(profile, character)
        speech = [shape for shape in bound.mapped if is_speech(profile, shape)]
        declared = any(bound.mapped[shape] in _declared(character) for shape in speech)
        stand_ins = {d.shape for s, d in bound.fallbacks.items() if is_speech(profile, s)}
        stand_ins -= {*bound.mapped.values()}
        marks = matches(profile.marks, {}, character)
        explained = {*bound.mapped.values(), *stand_ins, *(m for (m, *_) in marks.values())}
        if len(speech) + len(stand_ins) >= profile.detect_at or declared:
            fitting.append((len(explained), bound.coverage, bound))
    if not fitting:
        some = ", ".join(character.shapes[:8]) + (", …" if len(character.shapes) > 8 else "")
        raise InputError(
            "rig-unknown",
            f"its {len(character.shapes)} shapes ({some}) belong to no known rig family",
            place=str(character.source),
            action="Run `animeme rig ASSET --draft my-rig.toml`, complete it, and name it as "
            'rig = "my-rig.toml" in the job.',
        )
    return max(fitting, key=lambda entry: entry[:2])[2]


def _declared(character: Character) -> set[str]:
    """What expressions of the character's are called once they are bound."""
    return {
        _bound_name((name,), character, {})
        for name, drives in character.expressions.items()
        if drives
    }


def read_rig(rig: str, folder: Path) -> RigProfile | None:
    """The profile that a job's ``rig`` names; None for "auto".

    Args:
        rig: "auto", a shipped profile's name, or a file.
        folder: that relative file names start from.

    Raises:
        InputError: there is no such profile, or the file is broken.
    """
    if rig == "auto":
        return None
    if rig in profile_names():
        return shipped_profile(rig)
    if not is_file(rig):
        raise InputError(
            "rig-not-found",
            f"there is no rig profile '{rig}'",
            place=rig,
            action=f"{documents.suggestion(rig, ('auto', *profile_names()))} "
            "A file of your own ends in .toml or .json.",
        )
    return read_profile(folder / rig)


def bind_rig(
    rig: str, character: Character, folder: Path, *, controls: Sequence[str] | None = None
) -> BoundRig:
    """What a job's ``rig`` means for a character; see `read_rig`.

    Args:
        rig: "auto", a shipped profile's name, or a file.
        character: the asset.
        folder: that relative file names start from.
        controls: those of the model that is to move it, None if that is not known yet.

    Raises:
        InputError: nothing fits, the profile shares no shape with the character, or none of
            `controls` moves any of its shapes.
    """
    profile = read_rig(rig, folder)
    bound = detect(character) if profile is None else bind(profile, character)
    if not bound.mapped and not bound.fallbacks:
        raise InputError(
            "rig-mismatch",
            f"has none of the shapes that the profile '{bound.profile.name}' drives",
            place=str(character.source),
            action="Choose another profile; `animeme rig ASSET` lists the character's shapes.",
        )
    if controls is not None and not as_understood(controls, bound.profile).moves_anything:
        some = ", ".join(controls[:6]) + (", …" if len(controls) > 6 else "")
        raise InputError(
            "rig-controls-unknown",
            f"none of the model's {len(controls)} controls ({some}) moves a shape that the profile "
            f"'{bound.profile.name}' finds here",
            place=str(character.source),
            action="Add these controls to a profile of your own: it may hold "
            f'`extends = "{bound.profile.name}"` and the new [controls] only.',
        )
    return bound
