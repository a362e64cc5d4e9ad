"""Rig profiles: shipped or a studio's own, and which of them fits a character."""

from __future__ import annotations

import re
from collections.abc import Mapping
from functools import lru_cache
from importlib.resources import as_file, files
from pathlib import Path
from typing import Any

from animeme import documents
from animeme.errors import InputError
from animeme.rig import BoundRig, Character, Drive, RigProfile

_FOLDER = files("animeme_stages.retarget").joinpath("profiles")

# A rig is taken for a family's when it has at least this share of the family's shapes. Real heads
# ship a third of ARKit's 52 (speech only); rigs of other families share none of the names.
DETECTION_COVERAGE = 0.2


def profile_names() -> tuple[str, ...]:
    """Names of the shipped profiles, sorted."""
    names = (file.name for file in _FOLDER.iterdir())
    return tuple(sorted(n.removesuffix(".toml") for n in names if n.endswith(".toml")))


@lru_cache(maxsize=16)
def shipped_profile(name: str) -> RigProfile:
    """The shipped profile called `name`."""
    with as_file(_FOLDER.joinpath(f"{name}.toml")) as path:
        return read_profile(path)


def read_profile(path: Path) -> RigProfile:
    """A profile from a rig document.

    Raises:
        InputError: the file is no sound rig document.
    """
    data = documents.read("rig", path)
    profile = _from_document(data)
    _require_sound(profile, path)
    return profile


def _from_document(data: Mapping[str, Any]) -> RigProfile:
    drives = {
        control: tuple(Drive(entry["shape"], entry["gain"]) for entry in entries)
        for control, entries in data["controls"].items()
    }
    limits = {shape: (low, high) for shape, (low, high) in data["limits"].items()}
    return RigProfile(data["name"], drives, limits, dict(data["ceilings"]))


def _require_sound(profile: RigProfile, path: Path) -> None:
    shapes = set(profile.shapes)
    stray = (set(profile.limits) | set(profile.ceilings) | set(profile.ceilings.values())) - shapes
    inverted = [shape for shape, (low, high) in profile.limits.items() if low > high]
    problems = []
    if not shapes:
        problems.append("no control drives any shape")
    if stray:
        problems.append(
            f"limits or ceilings for shapes that nothing drives: {', '.join(sorted(stray))}"
        )
    if inverted:
        problems.append(f"limits with low above high: {', '.join(inverted)}")
    if problems:
        raise InputError(
            "document-invalid",
            "; ".join(problems),
            place=str(path),
            action="Complete the profile; `animeme rig ASSET` lists the character's shapes.",
        )


def spelling(name: str) -> str:
    """A shape name as rigs of one family agree on it, whatever exporters did to it.

    Case, separators, a leading mesh name and the way sides are marked are set aside.

    Example:
        >>> spelling("mouthSmile_L") == spelling("Head.MouthSmileLeft")
        True
    """
    bare = re.sub(r"\.\d{3}$", "", name)  # Blender's mark of a copy
    bare = re.sub(r"(?:[._ -][Ll]|(?<=[a-z])L)$", "Left", bare)
    bare = re.sub(r"(?:[._ -][Rr]|(?<=[a-z])R)$", "Right", bare)
    tail = re.split(r"[.:|]", bare)[-1]
    return re.sub(r"[\W_]", "", tail).lower()


def bind(profile: RigProfile, character: Character) -> BoundRig:
    """Match a profile's shapes to the character's own names, exactly or by `spelling`."""
    own = {spelling(shape): shape for shape in reversed(character.shapes) if spelling(shape)}
    mapped: dict[str, str] = {}
    missing: list[str] = []
    for shape in profile.shapes:
        found = shape if shape in character.shapes else own.get(spelling(shape))
        if found is None:
            missing.append(shape)
        else:
            mapped[shape] = found
    drives = {
        control: tuple(Drive(mapped[d.shape], d.gain) for d in entries if d.shape in mapped)
        for control, entries in profile.drives.items()
    }
    bound = RigProfile(
        profile.name,
        {control: entries for control, entries in drives.items() if entries},
        {mapped[shape]: limits for shape, limits in profile.limits.items() if shape in mapped},
        {mapped[s]: mapped[c] for s, c in profile.ceilings.items() if s in mapped and c in mapped},
    )
    return BoundRig(bound, mapped, tuple(missing))


def detect(character: Character) -> BoundRig:
    """The shipped profile that covers most of the character.

    Raises:
        InputError: none fits; says how to go on.
    """
    candidates = [bind(shipped_profile(name), character) for name in profile_names()]
    best = max(candidates, key=lambda bound: bound.coverage)
    if best.coverage < DETECTION_COVERAGE:
        raise InputError(
            "rig-unknown",
            f"its {len(character.shapes)} shapes belong to no known rig family",
            place=str(character.source),
            action="Run `animeme rig ASSET --draft my-rig.toml`, complete it, and name it as "
            'rig = "my-rig.toml" in the job.',
        )
    return best


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
    if Path(rig).suffix.lower() not in (".toml", ".json"):
        raise InputError(
            "rig-not-found",
            f"there is no rig profile '{rig}'",
            place=rig,
            action=f"{documents.suggestion(rig, ('auto', *profile_names()))} "
            "A file of your own ends in .toml or .json.",
        )
    return read_profile(folder / rig)


def bind_rig(rig: str, character: Character, folder: Path) -> BoundRig:
    """What a job's ``rig`` means for a character; see `read_rig`.

    Raises:
        InputError: nothing fits, or the profile shares no shape with the character.
    """
    profile = read_rig(rig, folder)
    if profile is None:
        return detect(character)
    bound = bind(profile, character)
    if not bound.mapped:
        raise InputError(
            "rig-mismatch",
            f"has none of the shapes that the profile '{profile.name}' drives",
            place=str(character.source),
            action="Choose another profile; `animeme rig ASSET` lists the character's shapes.",
        )
    return bound
