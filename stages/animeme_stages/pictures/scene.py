"""What a character looks like: its meshes, their blendshapes and their plain materials."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from animeme import registry
from animeme.errors import InputError
from animeme.files import anywhere, stamp
from animeme.rig import Character
from animeme_stages.pictures.raster import Floats, Indices, Singles

Colour = tuple[float, float, float]

# What an asset without materials looks like: clay.
CLAY: Colour = (0.62, 0.52, 0.46)
_FARTHEST = 1e12
# Normals of a soft edge are within 60 degrees of one another.
_SAME_SIDE = 0.5
# Parts of the names of covers over the eyes, most of which are exported as opaque.
_COVERS = ("eyeblend", "eyeocclusion", "lacrimalfluid", "cornea", "tearline")


@dataclass(frozen=True, eq=False)
class Material:
    """How a surface looks.

    Attributes:
        colour: linear RGB; multiplies the texture's.
        roughness: as in glTF.
        double_sided: whether its back can be seen.
        texture: (H, W, 4) linear RGB and alpha, first row at v = 0; None without one.
        cutoff: alpha below which there is a hole, None if it has none.
    """

    colour: Colour = CLAY
    roughness: float = 0.7
    double_sided: bool = False
    texture: Singles | None = None
    cutoff: float | None = None


@dataclass(frozen=True, eq=False)
class Primitive:
    """Triangles (T, 3) of one material."""

    triangles: Indices
    material: Material


@dataclass(frozen=True, eq=False)
class Target:
    """A blendshape of a mesh.

    Attributes:
        weights: at which its poses are reached, rising, none of them 0; the last one is 1. More
            than one where it has inbetweens.
        offsets: (len(weights), V, 3) displacements in world space of each pose.
    """

    weights: tuple[float, ...]
    offsets: Floats

    def factors(self, weight: float) -> list[float]:
        """How much of each of `offsets` there is at a weight: linear between neighbours."""
        found = [0.0] * len(self.weights)
        knots = sorted([(0.0, -1), *((w, k) for k, w in enumerate(self.weights))])
        after = next((i for i, (w, _) in enumerate(knots) if w > weight), len(knots) - 1)
        after = max(after, 1)
        (w0, k0), (w1, k1) = knots[after - 1], knots[after]
        part = (weight - w0) / (w1 - w0)
        for index, share in ((k0, 1.0 - part), (k1, part)):
            if index >= 0:
                found[index] = share
        return found


@dataclass(frozen=True, eq=False)
class SceneMesh:
    """A mesh, placed where the file places it; +Y is up.

    Attributes:
        name: for people.
        points: (V, 3) world positions without any blendshape.
        primitives: triangles by material; all index `points`.
        targets: canonical shape name → blendshape.
        rest: canonical shape name → weight when nothing drives it.
        welded: (V,) vertices of the same number share a normal.
        uv: (V, 2) place in the texture, v down; None without one.
        tint: (V, 3) linear RGB that multiplies the material's; None without one.
        landmarks: name → vertex indices, where the file notes them.
    """

    name: str
    points: Floats
    primitives: Sequence[Primitive]
    targets: Mapping[str, Target]
    rest: Mapping[str, float]
    welded: Indices
    uv: Singles | None = None
    tint: Singles | None = None
    landmarks: Mapping[str, Indices] = field(default_factory=dict)

    def deformed(self, weights: Mapping[str, float]) -> Floats:
        """Points (V, 3); shapes that `weights` does not name rest, those it lacks are ignored."""
        points = self.points.copy()
        for name, target in self.targets.items():
            weight = weights.get(name, self.rest.get(name, 0.0))
            if weight:
                for factor, offset in zip(target.factors(weight), target.offsets, strict=True):
                    if factor:
                        points += factor * offset
        return points


@dataclass(frozen=True, eq=False)
class Scene:
    """All meshes that can be seen.

    Attributes:
        character: whose they are.
        meshes: in file order.
    """

    character: Character
    meshes: tuple[SceneMesh, ...]

    def mesh(self, name: str) -> SceneMesh:
        """The first mesh of that name."""
        return next(mesh for mesh in self.meshes if mesh.name == name)

    def deform(self, weights: Mapping[str, float]) -> dict[str, Floats]:
        """Mesh name → points (V, 3) under canonical shape weights."""
        return {mesh.name: mesh.deformed(weights) for mesh in self.meshes}

    def bounds(self) -> tuple[Floats, Floats]:
        """Least and greatest coordinates (3,) of what is drawn, at rest."""
        drawn = [
            mesh.points[np.unique(np.concatenate([p.triangles.ravel() for p in mesh.primitives]))]
            for mesh in self.meshes
            if mesh.primitives
        ]
        points = np.concatenate(drawn)
        return points.min(0), points.max(0)


def load_scene(path: str | Path) -> Scene:
    """Read a character's meshes from a file that animeme wrote, or anybody's.

    Skinned meshes stand as their skeleton stands at rest.

    Raises:
        InputError: the file is damaged or has no blendshapes, or its meshes cannot be read.
    """
    file = Path(path)
    form = registry.format_of(file)
    character = form.load(file, within=anywhere(file))
    if character.format == "gltf":
        from animeme_stages.pictures.gltf_scene import read_meshes
    elif character.format == "usd":
        from animeme_stages.pictures.usd_scene import read_meshes
    else:
        raise InputError(
            "picture-format-unknown",
            f"is of the format '{character.format}', whose meshes cannot be drawn",
            place=str(file),
            action="Draw the character's glTF or USD file.",
        )
    meshes = tuple(read_meshes(character))
    if not any(len(p.triangles) for mesh in meshes for p in mesh.primitives):
        raise InputError(
            "picture-empty",
            "has no triangle that could be drawn",
            place=str(file),
            action="Export the character with its meshes.",
        )
    return Scene(character, meshes)


_last: list[tuple[Path, dict[Path, str], Scene]] = []


def scene_of(path: Path) -> Scene:
    """As `load_scene`; the last one is kept, as lines of one character come one after another.

    Raises:
        InputError: as `load_scene`.
    """
    for known, stamps, scene in _last:
        if known == path.absolute() and all(stamp(file) == was for file, was in stamps.items()):
            return scene
    _last.clear()
    before = stamp(path)
    scene = load_scene(path)
    files = registry.format_named(scene.character.format).inputs(scene.character)
    _last.append((path.absolute(), {path: before, **{file: stamp(file) for file in files}}, scene))
    return scene


def is_cover(name: str) -> bool:
    """Whether a material's name says that it is a see-through cover over the eye."""
    plain = name.casefold().replace("_", "").replace(" ", "")
    return any(part in plain for part in _COVERS)


def welded(points: Floats, normals: Singles | None = None) -> Indices:
    """A number per vertex, the same for those in one place, unless they are of a hard edge.

    Args:
        points: (V, 3).
        normals: (V, 3) as the file has them; those of a hard edge point to different sides.
    """
    size = max(float(np.abs(points).max(initial=0.0)), 1e-20)
    # Rounding of single precision parts what an exporter wrote as equal.
    keys = np.round(points / (size * 1e-6)).astype(np.int64)
    _, place = numbered(keys)
    if normals is None:
        return place
    found = np.full(len(points), -1, dtype=np.int64)
    left, count = np.arange(len(points)), 0
    while len(left):
        # The first that is left in each place, and what points to the same side as it does.
        _, first, group = np.unique(place[left], return_index=True, return_inverse=True)
        near = np.einsum("vk,vk->v", normals[left], normals[left[first[group]]]) > _SAME_SIDE
        near[first] = True
        found[left[near]] = count + group[near]
        count += len(first)
        left = left[~near]
    return found


def require_finite(*tables: Floats) -> None:
    """Make sure that positions can be drawn.

    Raises:
        ValueError: one of them is no number, or beyond what anything is measured in.
    """
    if not all((np.abs(table) < _FARTHEST).all() for table in tables):
        raise ValueError("a position that is no number, or too far")


def numbered(keys: Indices) -> tuple[Indices, Indices]:
    """The first of each of the distinct rows (V, C), and which of these each row is."""
    order = np.lexsort(keys.T[::-1])
    ordered = keys[order]
    new = np.ones(len(keys), dtype=bool)
    new[1:] = (ordered[1:] != ordered[:-1]).any(1)
    number = np.empty(len(keys), dtype=np.int64)
    number[order] = np.cumsum(new) - 1
    # Sorting is stable: of equal rows the first comes first.
    return order[new], number


def skinned(
    points: Floats, offsets: Sequence[Floats], joints: Indices, shares: Floats, matrices: Floats
) -> tuple[Floats, list[Floats]]:
    """Points and displacements moved by the joints that hold them.

    Args:
        points: (V, 3) as bound.
        offsets: displacements (…, V, 3) of blendshapes.
        joints: (V, J) indices into `matrices`.
        shares: (V, J) of each joint; rows are normalised.
        matrices: (N, 4, 4) from bound to posed, for column vectors.
    """
    total = shares.sum(1, keepdims=True)
    held = total[:, 0] > 0
    shares = shares / np.where(total > 0, total, 1.0)
    blended = np.zeros((len(points), 4, 4))
    for k in range(joints.shape[1]):
        blended += shares[:, k, None, None] * matrices[joints[:, k]]
    blended[~held] = np.eye(4)
    turn = blended[:, :3, :3]
    posed = np.einsum("vij,vj->vi", turn, points) + blended[:, :3, 3]
    return posed, [np.einsum("vij,...vj->...vi", turn, offset) for offset in offsets]
