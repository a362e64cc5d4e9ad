"""Which names of shapes mean the same, however riggers and exporters spelt them."""

from __future__ import annotations

import re
from collections import defaultdict
from collections.abc import Mapping, Sequence
from functools import lru_cache

from animeme.rig import Character

# A prefix in front of that many different shapes of one family is the rig's, not part of a name.
_PREFIXED_SHAPES = 3
_SPLIT = re.compile(r"(?<=[_.:| -])|(?<=[a-z\d])(?=[A-Z])")


@lru_cache(maxsize=10_000)
def spelling(name: str) -> str:
    """A shape name as rigs of one family agree on it, whatever exporters did to it.

    Case, separators, a leading mesh name, Character Creator's numbers (``A25_``) and the way sides
    are marked are set aside.

    Example:
        >>> spelling("mouthSmile_L") == spelling("Head.MouthSmileLeft")
        True
    """
    bare = re.sub(r"\.\d{3}$", "", name)  # Blender's mark of a copy
    bare = re.sub(r"(?:[._ -][Ll]|(?<=[a-z])L)$", "Left", bare)
    bare = re.sub(r"(?:[._ -][Rr]|(?<=[a-z])R)$", "Right", bare)
    tail = re.split(r"[.:|]", bare)[-1]
    return re.sub(r"[\W_]", "", re.sub(r"^[AT]\d\d_", "", tail)).lower()


def matches(
    shapes: Sequence[str], aliases: Mapping[str, Sequence[str]], character: Character
) -> dict[str, tuple[str, ...]]:
    """The character's own names for shapes of a profile.

    A shape is found by its exact name, then by `spelling`, then behind a prefix that several shapes
    of the profile share (``head_jawOpen``, ``BS_mouthClose``, …). Names of expressions go before
    those of shapes.

    Args:
        shapes: the profile's.
        aliases: shape → other names for it.
        character: the rig.

    Returns:
        Shape → its name on the character: the main one first, then those of the same shape on other
        meshes. Shapes that are not there are left out.
    """
    names = (*character.expressions, *character.shapes)
    exact = dict.fromkeys(names)
    spelt = {spelling(name): name for name in reversed(names) if spelling(name)}
    wanted = {shape: (shape, *aliases.get(shape, ())) for shape in shapes}
    found: dict[str, list[str]] = {}
    for shape, spellings in wanted.items():
        own = next((name for name in spellings if name in exact), None)
        own = own or next(filter(None, (spelt.get(spelling(name)) for name in spellings)), None)
        if own is not None:
            found[shape] = [own]
    owners = _owners(character)
    for shape, name in _prefixed(wanted, character.shapes):
        taken = found.setdefault(shape, [])
        meshes = {mesh for other in taken for mesh in owners.get(other, ())}
        # On a mesh that has the shape already, it is another shape.
        expressed = bool(taken) and taken[0] in character.expressions
        if name not in taken and not expressed and not meshes & owners[name]:
            taken.append(name)
    return {shape: tuple(found[shape]) for shape in shapes if shape in found}


def _prefixed(wanted: Mapping[str, Sequence[str]], names: Sequence[str]) -> list[tuple[str, str]]:
    """(shape, own name) of everything behind a prefix of the rig's, in the order of the names."""
    shape_of = {
        spelling(name): shape
        for shape, spellings in reversed(list(wanted.items()))
        for name in spellings
        if spelling(name)
    }
    behind: dict[str, list[tuple[str, str]]] = defaultdict(list)
    for name in names:
        for split in _SPLIT.finditer(name):
            tail = spelling(name[split.start() :])
            if tail in shape_of and split.start() < len(name):
                behind[name[: split.start()]].append((shape_of[tail], name))
    order = {name: index for index, name in enumerate(names)}
    shared = [
        pair
        for pairs in behind.values()
        if len({shape for shape, _ in pairs}) >= _PREFIXED_SHAPES
        for pair in pairs
    ]
    return sorted(dict.fromkeys(shared), key=lambda pair: order[pair[1]])


def _owners(character: Character) -> dict[str, set[int]]:
    owners: dict[str, set[int]] = defaultdict(set)
    for index, mesh in enumerate(character.meshes):
        for stored in mesh.shapes:
            owners[character.canonical[stored]].add(index)
    return owners
