"""Which meshes of a USD stage speak, and through which skeleton.

Bindings are resolved by UsdSkel itself, never from prim names: a mesh may be bound three namespaces
away.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

from pxr import Sdf, Usd, UsdGeom, UsdSkel

# Instances' own prims too.
EVERYWHERE = Usd.TraverseInstanceProxies(Usd.PrimDefaultPredicate)


@dataclass(frozen=True)
class SpeakingMesh:
    """A mesh with blendshapes that a skeleton's animation drives.

    Attributes:
        path: the mesh's prim.
        shapes: its ``skel:blendShapes`` that have a BlendShape, in the mesh's own order; a name
            that it has twice is there once, for UsdSkel drives one of them.
        skeleton: the skeleton's prim.
    """

    path: Sdf.Path
    shapes: tuple[str, ...]
    skeleton: Sdf.Path


def speaking_meshes(stage: Usd.Stage) -> tuple[SpeakingMesh, ...]:
    """Every mesh whose blendshapes a skeleton's animation drives, in stage order.

    Meshes inside instances are included: only the skeleton must be editable to drive them.
    """
    found: dict[Sdf.Path, SpeakingMesh] = {}
    for skeleton, query in skinning_targets(stage):
        if query.HasBlendShapes() and query.GetPrim().IsA(UsdGeom.Mesh):
            path = query.GetPrim().GetPath()
            found[path] = SpeakingMesh(path, _shapes(stage, query), skeleton.GetPath())
    return tuple(
        found[prim.GetPath()]
        for prim in Usd.PrimRange.Stage(stage, EVERYWHERE)
        if prim.GetPath() in found and found[prim.GetPath()].shapes
    )


def skinning_targets(stage: Usd.Stage) -> Iterator[tuple[Usd.Prim, UsdSkel.SkinningQuery]]:
    """Everything that a skeleton moves: the skeleton's prim, and how it does."""
    cache = UsdSkel.Cache()
    for prim in Usd.PrimRange.Stage(stage, EVERYWHERE):
        if not prim.IsA(UsdSkel.Root):
            continue
        root = UsdSkel.Root(prim)
        cache.Populate(root, EVERYWHERE)
        for binding in cache.ComputeSkelBindings(root, EVERYWHERE):
            skeleton = binding.GetSkeleton().GetPrim()
            for query in binding.GetSkinningTargets():
                yield skeleton, query


def _shapes(stage: Usd.Stage, query: UsdSkel.SkinningQuery) -> tuple[str, ...]:
    targets = map(stage.GetPrimAtPath, query.GetBlendShapeTargetsRel().GetTargets())
    pairs = zip(query.GetBlendShapeOrder(), targets, strict=False)
    names = (str(name) for name, prim in pairs if prim and prim.IsA(UsdSkel.BlendShape))
    return tuple(dict.fromkeys(names))


def bound_prim(stage: Usd.Stage, skeleton: Sdf.Path) -> Usd.Prim | None:
    """The prim at which an animation for `skeleton` can be bound, None if there is none.

    That is the skeleton itself. Inside an instance nothing can be edited, but a skeleton without a
    binding of its own takes the one of the nearest prim above it: the instance's.
    """
    prim = stage.GetPrimAtPath(skeleton)
    while prim.IsInstanceProxy():
        if UsdSkel.BindingAPI(prim).GetAnimationSourceRel().HasAuthoredTargets():
            return None
        prim = prim.GetParent()
    return prim


def host_prim(stage: Usd.Stage, bound: Usd.Prim) -> Usd.Prim | None:
    """The prim that carries the dialogue of what is bound at `bound`, None if there is none.

    It is the character's prim; an instance's children are those of its prototype alone.
    """
    default, path = stage.GetDefaultPrim(), bound.GetPath()
    inside = default and path.HasPrefix(default.GetPath())
    host = default if inside else stage.GetPrimAtPath(path.GetPrefixes()[0])
    return None if host.IsInstance() else host
