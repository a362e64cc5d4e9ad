"""Characters as animeme sees them, and profiles that say which control drives which shape."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import lru_cache
from pathlib import Path
from typing import Literal


@dataclass(frozen=True)
class Drive:
    """One shape driven by a control: weight = gain × control (summed over controls)."""

    shape: str
    gain: float = 1.0


@dataclass(frozen=True)
class MeshShapes:
    """The blendshapes of one mesh (glTF: of one node that instances it).

    Attributes:
        path: where it is: a glTF node as ``/nodes/4`` or a USD prim path.
        name: for people.
        shapes: shape names as the asset stores them, in the mesh's own order.
        rest: weight of each shape when nothing drives it.
    """

    path: str
    name: str
    shapes: tuple[str, ...]
    rest: tuple[float, ...]

    def __post_init__(self) -> None:
        if len(self.shapes) != len(self.rest):
            raise ValueError(f"{self.path}: {len(self.shapes)} shapes but {len(self.rest)} weights")


@dataclass(frozen=True)
class Character:
    """A rigged asset: what it is called, where it lies, which shapes its meshes own.

    Attributes:
        source: the asset's file.
        format: name of the registered format that read it.
        meshes: every mesh that owns at least one shape, in file order.
        animations: names of the animations it came with.
        expressions: poses that the file itself names, as the shapes that make them (VRM's
            expressions with their binds).
    """

    source: Path
    format: str
    meshes: tuple[MeshShapes, ...]
    animations: tuple[str, ...] = ()
    expressions: Mapping[str, tuple[Drive, ...]] = field(default_factory=dict, hash=False)
    canonical: Mapping[str, str] = field(init=False, compare=False)

    def __post_init__(self) -> None:
        object.__setattr__(self, "canonical", canonical_names([m.shapes for m in self.meshes]))

    @property
    def shapes(self) -> tuple[str, ...]:
        """Distinct shape names, numbered copies folded into one, in order of appearance."""
        return tuple(dict.fromkeys(self.canonical.values()))

    def rest_weights(self) -> dict[str, float]:
        """Weight of each of `shapes` at rest; the first mesh that owns a shape decides."""
        rest: dict[str, float] = {}
        for mesh in self.meshes:
            for stored, weight in zip(mesh.shapes, mesh.rest, strict=True):
                rest.setdefault(self.canonical[stored], weight)
        return rest


_NUMBERED = re.compile(r"^(?P<stem>.*[^\d.])\.?\d+$")
_PREFIXED = re.compile(r"^.*[.:|](?P<stem>[^\W\d_]{2}.*)$")


def canonical_names(per_mesh: Sequence[Sequence[str]]) -> dict[str, str]:
    """Map each stored shape name to the one it is a copy of, or to itself.

    Exporters that need unique names number them per mesh (``jawOpen``, ``jawOpen2``, …) or put
    the mesh's name before them (``head.jawOpen``, ``teeth.jawOpen``). A number is dropped where
    the bare name exists on another mesh, a prefix where another mesh has the same name behind
    another one; never where that would join two shapes of one mesh.

    Args:
        per_mesh: the shape names of each mesh.
    """
    return dict(_canonical(tuple(map(tuple, per_mesh))))


@lru_cache(maxsize=32)  # each line's file is read anew, and has the names of the last one
def _canonical(per_mesh: tuple[tuple[str, ...], ...]) -> Mapping[str, str]:
    owners: dict[str, set[int]] = {}
    for index, names in enumerate(per_mesh):
        for name in names:
            owners.setdefault(name, set()).add(index)
    stems = _shared_tails(owners)
    for name in owners:
        match = _NUMBERED.match(name)
        if match and match["stem"] in owners and name not in stems:
            stems[name] = match["stem"]
    # Several shapes of one mesh that would become one are variants, not copies.
    folded: dict[tuple[int, str], set[str]] = {}
    for name, meshes in owners.items():
        for mesh in meshes:
            folded.setdefault((mesh, stems.get(name, name)), set()).add(name)
    variants = {name for names in folded.values() if len(names) > 1 for name in names}
    return {name: name if name in variants else stems.get(name, name) for name in owners}


def _shared_tails(owners: Mapping[str, set[int]]) -> dict[str, str]:
    """Prefixed name → what follows the prefix, where meshes differ only in the prefix."""
    tails: dict[str, list[str]] = {}
    for name in owners:
        if match := _PREFIXED.match(name):
            tails.setdefault(match["stem"], []).append(name)
    return {name: tail for tail, names in tails.items() if len(names) > 1 for name in names}


@dataclass(frozen=True)
class Corrective:
    """A shape that follows others: their product, or the least of them.

    Attributes:
        of: the shapes it follows.
        rule: "product" or "minimum".
    """

    of: tuple[str, ...]
    rule: Literal["product", "minimum"] = "product"


@dataclass(frozen=True)
class Total:
    """Shapes that exclude each other: together they weigh at most `most`."""

    shapes: tuple[str, ...]
    most: float = 1.0


@dataclass(frozen=True)
class RigProfile:
    """Which control drives which shapes of a rig, and within what limits.

    Attributes:
        name: the profile's name.
        drives: per control, the shapes it moves.
        limits: per shape (low, high); [0, 1] where nothing is said.
        ceilings: per shape, the shape whose weight it may not exceed (ARKit's ``mouthClose`` undoes
            ``jawOpen`` and pushes the lips through each other beyond it).
        poses: per shape, what the face shows at weight 1, in ARKit's controls. Their weights are
            the mixture that comes nearest to the controls (visemes).
        rest: the pose that takes what the others leave of 1, "" if there is none.
        correctives: per shape, the shapes that it follows.
        totals: groups of shapes that exclude each other.
        fallbacks: per shape, the shapes that stand in for it, the nearest first.
        aliases: per shape, other names that rigs give it.
        detect_at: how many of the shapes that speech moves make a rig one of this family.
        marks: shapes that nothing moves, but that tell rigs of this family from others.
    """

    name: str
    drives: Mapping[str, tuple[Drive, ...]]
    limits: Mapping[str, tuple[float, float]] = field(default_factory=dict)
    ceilings: Mapping[str, str] = field(default_factory=dict)
    poses: Mapping[str, Mapping[str, float]] = field(default_factory=dict)
    rest: str = ""
    correctives: Mapping[str, Corrective] = field(default_factory=dict)
    totals: tuple[Total, ...] = ()
    fallbacks: Mapping[str, tuple[Drive, ...]] = field(default_factory=dict)
    aliases: Mapping[str, tuple[str, ...]] = field(default_factory=dict)
    detect_at: int = 1
    marks: tuple[str, ...] = ()

    @property
    def shapes(self) -> tuple[str, ...]:
        """Distinct shapes that anything moves, in order of appearance."""
        driven = (d.shape for drives in self.drives.values() for d in drives)
        rest = [self.rest] if self.rest else []
        return tuple(dict.fromkeys([*driven, *self.poses, *rest, *self.correctives]))


@dataclass(frozen=True)
class BoundRig:
    """A profile matched to a character's actual shape names.

    Attributes:
        profile: the profile with its shapes renamed to the character's own.
        mapped: profile shape → the character's shape, or the name of what `binds` takes apart.
        missing: profile shapes that the character lacks.
        fallbacks: missing shape → the character's shape that stands in for it, and how much of it.
        binds: what is no shape of the character's, but several: its name in `profile` → those (an
            expression of VRM; one shape under another name on each mesh).
    """

    profile: RigProfile
    mapped: Mapping[str, str]
    missing: tuple[str, ...]
    fallbacks: Mapping[str, Drive] = field(default_factory=dict)
    binds: Mapping[str, tuple[Drive, ...]] = field(default_factory=dict)

    @property
    def coverage(self) -> float:
        """Share of the profile's shapes that the character has, 0 to 1."""
        total = len(self.mapped) + len(self.missing)
        return len(self.mapped) / total if total else 0.0
