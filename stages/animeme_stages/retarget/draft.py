"""A first profile for a rig that no family claims, for a person to complete."""

from __future__ import annotations

import difflib
import json
import re
import tomllib
import unicodedata
from collections.abc import Mapping
from functools import lru_cache
from importlib.resources import files
from typing import Any

from animeme.rig import Character
from animeme_stages.retarget.profile_files import arkit_controls, shipped_profile
from animeme_stages.retarget.spelling import spelling

_WORDS = files("animeme_stages.retarget").joinpath("draft_words.toml")
_NOT_THE_MOUTH = "not the mouth"
# Words in scripts that set no spaces: Chinese characters, or more than one of kana and Hangul.
_UNSPACED = re.compile(r"[\u3400-\u9fff]|[\u3040-\u30ff\uac00-\ud7af]{2}")
# A word this long is known within a compound too (German "Kussmund").
_COMPOUND = 4
# As alike as one slip in eight letters.
_ALIKE = 0.87


def draft_profile(character: Character, name: str) -> str:
    """A rig document in TOML: guesses from the shapes' names, and the rest listed as comments.

    A name that is nearly one of ARKit's is taken for it; else its words decide, in ten languages.

    Args:
        character: the rig.
        name: of the profile.
    """
    guesses: dict[str, list[tuple[str, float, str]]] = {}
    unknown: list[str] = []
    for shape in character.shapes:
        drives, why = _guess(shape)
        if not drives:
            unknown.append(shape)
        for control, gain in drives.items():
            guesses.setdefault(control, []).append((shape, gain, why))
    lines = [
        "# Drafted from shape names: check every line, and place the shapes listed at the end.",
        "# Controls are ARKit's; weights that several controls give to one shape add up. A shape",
        "# that is a whole mouth (a viseme) belongs under [poses] instead, as",
        "# shape = { jawOpen = 0.5, mouthFunnel = 0.3 }  # what it shows at weight 1",
        'schema = "animeme.rig/2"',
        f"name = {_toml(name)}",
        "",
        "[controls]",
    ]
    for control, entries in guesses.items():
        lines.append(f"{control} = [")
        for shape, gain, why in entries:
            lines.append(f"  {{ shape = {_toml(shape)}, gain = {gain} }},  # {why}")
        lines.append("]")
    lines += ["", "[limits]", "# shape = [lowest, highest]", "", "[ceilings]"]
    opened = [shape for shape, _, _ in guesses.get("jawOpen", [])]
    closed = [shape for shape, _, _ in guesses.get("mouthClose", [])]
    if len(opened) == len(closed) == 1:
        lines.append("# Closing beyond the opening would push the lips through each other.")
        lines.append(f"{_toml(closed[0])} = {_toml(opened[0])}")
    if unknown:
        lines += ["", "# Not placed:"] + [f"#   {_toml(shape)}" for shape in unknown]
    return "\n".join(lines) + "\n"


def _guess(shape: str) -> tuple[Mapping[str, float], str]:
    """Controls that may drive a shape, with gains, and why."""
    spelt = spelling(shape)
    known = {spelling(control): control for control in arkit_controls()}
    known |= {spelling(s): d for s, (d, *_) in _joint_shapes().items()}
    near = difflib.get_close_matches(spelt, known, 1, _ALIKE) if len(spelt) > 4 else []
    if near:
        control = known[near[0]]
        return {control: 1.0}, f"much like ARKit's {control}"
    words = _split(shape)
    entries = _table()["shape"]
    elsewhere = next(entry for entry in entries if entry["means"] == _NOT_THE_MOUTH)
    if _says(words, shape, elsewhere["words"]):
        return {}, ""
    for entry in entries:
        if _says(words, shape, entry["words"]):
            return _on_its_side(entry["controls"], words, shape), entry["means"]
    return {}, ""


def _joint_shapes() -> Mapping[str, tuple[str, ...]]:
    """Shapes that stand in for exactly one of ARKit's, and for which."""
    sources: dict[str, list[str]] = {}
    for control, drives in shipped_profile("arkit").fallbacks.items():
        for drive in drives:
            if drive.gain == 1.0:
                sources.setdefault(drive.shape, []).append(control)
    return {shape: tuple(controls) for shape, controls in sources.items() if len(controls) == 1}


def _on_its_side(controls: Mapping[str, float], words: set[str], shape: str) -> dict[str, float]:
    """Gains of both sides, or of the one that a shape's name tells, with the whole weight there."""
    sides = [side for side, said in _table()["sides"].items() if _says(words, shape, said)]
    made: dict[str, float] = {}
    for control, gain in controls.items():
        if "*" not in control:
            made[control] = gain
        elif len(sides) == 1:
            made[control.replace("*", sides[0])] = 2 * gain
        else:
            made |= {control.replace("*", side): gain for side in ("Left", "Right")}
    return made


def _says(words: set[str], shape: str, hints: list[str]) -> bool:
    for hint in hints:
        if hint in words or (_UNSPACED.search(hint) and hint in shape):
            return True
        if len(hint) >= _COMPOUND and any(w.startswith(hint) or w.endswith(hint) for w in words):
            return True
    return False


def _split(name: str) -> set[str]:
    """The words of a name in lower case, without accents."""
    bare = "".join(c for c in unicodedata.normalize("NFKD", name) if not unicodedata.combining(c))
    spaced = "".join(
        f" {c}" if c.isupper() and before.islower() else c if c.isalpha() else " "
        for before, c in zip(" " + bare, bare, strict=False)
    )
    return set(spaced.replace("ß", "ss").lower().split())


@lru_cache(maxsize=1)
def _table() -> dict[str, Any]:
    return tomllib.loads(_WORDS.read_text(encoding="utf-8"))


def _toml(text: str) -> str:
    """A basic TOML string: JSON's escapes are a subset of TOML's, which forbids DEL unescaped."""
    sound = text.encode("utf-8", "replace").decode("utf-8")
    return json.dumps(sound, ensure_ascii=False).replace("\x7f", "\\u007f")
