"""A first profile for a rig that no family claims, for a person to complete."""

from __future__ import annotations

import json
import re

from animeme.rig import Character

# Words that riggers use, per control, most telling first. Matching is by whole words of the shape's
# name; the first control that matches takes the shape.
_HINTS: tuple[tuple[tuple[str, ...], tuple[tuple[str, float], ...]], ...] = (
    (("tongue",), (("tongueOut", 1.0),)),
    (("tuck", "bite", "fv", "ff", "labiodental"), (("mouthRollLower", 1.0),)),
    (
        ("pucker", "kiss", "round", "ring", "oo", "ou", "uw", "w"),
        (("mouthPucker", 1.0), ("mouthFunnel", 0.6)),
    ),
    (("funnel", "sh", "ch", "out", "forward", "protrude"), (("mouthFunnel", 1.0),)),
    (
        ("wide", "stretch", "spread", "grin", "ee", "ih"),
        (("mouthStretchLeft", 0.5), ("mouthStretchRight", 0.5)),
    ),
    (("smile", "happy"), (("mouthSmileLeft", 0.5), ("mouthSmileRight", 0.5))),
    (("shut", "close", "closed", "press", "mbp", "pbm", "pp"), (("mouthClose", 1.0),)),
    (("open", "gape", "jaw", "drop", "aa", "ah", "maw"), (("jawOpen", 1.0),)),
)
_WORD = re.compile(r"[A-Z]+(?![a-z])|[A-Z]?[a-z]+|\d+")


def draft_profile(character: Character, name: str) -> str:
    """A rig document in TOML: guesses from the shapes' names, and the rest listed as comments.

    Args:
        character: the rig.
        name: of the profile.
    """
    guesses: dict[str, list[tuple[str, float]]] = {}
    unknown: list[str] = []
    for shape in character.shapes:
        drives = _guess(shape)
        if not drives:
            unknown.append(shape)
        for control, gain in drives:
            guesses.setdefault(control, []).append((shape, gain))
    lines = [
        "# Drafted from shape names: check every line, and place the shapes listed at the end.",
        "# Controls are ARKit's; weights that several controls give to one shape add up.",
        'schema = "animeme.rig/2"',
        f"name = {_toml(name)}",
        "",
        "[controls]",
    ]
    for control, entries in guesses.items():
        drives_text = ", ".join(f"{{ shape = {_toml(s)}, gain = {g} }}" for s, g in entries)
        lines.append(f"{control} = [{drives_text}]")
    lines += ["", "[limits]", "# shape = [lowest, highest]", "", "[ceilings]"]
    opened = [shape for shape, _ in guesses.get("jawOpen", [])]
    closed = [shape for shape, _ in guesses.get("mouthClose", [])]
    if len(opened) == len(closed) == 1:
        lines.append("# Closing beyond the opening would push the lips through each other.")
        lines.append(f"{_toml(closed[0])} = {_toml(opened[0])}")
    if unknown:
        lines += ["", "# Not placed:"] + [f"#   {_toml(shape)}" for shape in unknown]
    return "\n".join(lines) + "\n"


def _guess(shape: str) -> tuple[tuple[str, float], ...]:
    words = {word.lower() for word in _WORD.findall(shape)}
    for hints, drives in _HINTS:
        if words & set(hints):
            return drives
    return ()


def _toml(text: str) -> str:
    """A basic TOML string: JSON's escapes are a subset of TOML's, which forbids DEL unescaped."""
    sound = text.encode("utf-8", "replace").decode("utf-8")
    return json.dumps(sound, ensure_ascii=False).replace("\x7f", "\\u007f")
