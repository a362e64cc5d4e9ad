"""Characters from USD: which meshes speak, through which skeleton, and what moves them already.

Bindings are resolved by UsdSkel itself, never from prim names: a SkelAnimation may lie unbound, or
apply to a mesh three namespaces away.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager, nullcontext
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from pxr import Sdf, Tf, Usd, UsdGeom, UsdSkel

from animeme.errors import InputError
from animeme.rig import Character, MeshShapes

SCOPE = "Dialogue"  # holds the lines, below the character's prim
POINTER = "active"  # the animation that the skeleton is bound to; reserved, never a line
CUSTOM_DATA = "animeme"  # key of the customData dictionary on prims that we author


@dataclass(frozen=True)
class SpeakingMesh:
    """A mesh with blendshapes that a skeleton's animation drives.

    Attributes:
        path: the mesh's prim.
        shapes: its ``skel:blendShapes``, in the mesh's own order.
        skeleton: the skeleton's prim.
    """

    path: Sdf.Path
    shapes: tuple[str, ...]
    skeleton: Sdf.Path


@contextmanager
def usd_errors(path: Path) -> Iterator[None]:
    """Turn what pxr raises about the file at `path` into an `InputError`, and keep pxr quiet.

    Raises:
        InputError: ``asset-unreadable``.
    """
    # Python can hold back pxr's warnings only since usd-core 26; older ones print them.
    trap: Any = getattr(Tf, "DiagnosticTrap", nullcontext)
    try:
        with trap() as held:
            try:
                yield
            finally:
                if held is not None:
                    held.Clear()
    except Tf.ErrorException as error:
        raise InputError(
            "asset-unreadable",
            f"cannot be read as USD: {_reason(error)}",
            place=str(path),
            action="Export the asset anew, and check that it opens in usdview.",
        ) from error


def _reason(error: Any) -> str:
    """The first of the messages in a pxr exception, without source positions."""
    try:
        messages = [getattr(argument, "commentary", str(argument)) for argument in error.args]
        return " ".join((messages or [str(error)])[0].split()).rstrip(".")
    except UnicodeDecodeError:  # the message quotes what is damaged
        return "it has text that is not UTF-8"


def open_stage(path: Path) -> Usd.Stage:
    """The composed stage of the file at `path`, with every payload.

    Raises:
        InputError: ``asset-unreadable``: it does not exist, or is damaged or no USD.
    """
    if not path.is_file():
        raise InputError(
            "asset-unreadable",
            "does not exist" if not path.exists() else "is not a file",
            place=str(path),
            action="Check the path.",
        )
    with usd_errors(path):
        return Usd.Stage.Open(str(path))


def speaking_meshes(stage: Usd.Stage) -> tuple[SpeakingMesh, ...]:
    """Every mesh whose blendshapes a skeleton's animation drives, in stage order.

    Meshes inside instances are included: only the skeleton must be editable to drive them.
    """
    everywhere = Usd.TraverseInstanceProxies(Usd.PrimDefaultPredicate)
    cache = UsdSkel.Cache()
    found: dict[Sdf.Path, SpeakingMesh] = {}
    for prim in Usd.PrimRange.Stage(stage, everywhere):
        if not prim.IsA(UsdSkel.Root):
            continue
        root = UsdSkel.Root(prim)
        cache.Populate(root, everywhere)
        for binding in cache.ComputeSkelBindings(root, everywhere):
            skeleton = binding.GetSkeleton().GetPrim().GetPath()
            for query in binding.GetSkinningTargets():
                if query.HasBlendShapes() and query.GetPrim().IsA(UsdGeom.Mesh):
                    path = query.GetPrim().GetPath()
                    shapes = tuple(str(name) for name in query.GetBlendShapeOrder())
                    found[path] = SpeakingMesh(path, shapes, skeleton)
    return tuple(
        found[prim.GetPath()]
        for prim in Usd.PrimRange.Stage(stage, everywhere)
        if prim.GetPath() in found and found[prim.GetPath()].shapes
    )


def is_ours(prim: Usd.Prim) -> bool:
    """Whether `prim` is a dialogue scope, line or pointer of ours."""
    return bool(prim) and CUSTOM_DATA in prim.GetCustomData()


def is_pointer(prim: Usd.Prim) -> bool:
    """Whether `prim` is the animation that a variant points at one of our lines."""
    return prim.GetName() == POINTER and is_ours(prim.GetParent())


def animations(stage: Usd.Stage) -> Iterator[UsdSkel.Animation]:
    """Every SkelAnimation on `stage` but our pointers, in stage order."""
    for prim in stage.Traverse():
        if prim.IsA(UsdSkel.Animation) and not is_pointer(prim):
            yield UsdSkel.Animation(prim)


def bound_animation(stage: Usd.Stage, skeleton: Sdf.Path) -> UsdSkel.Animation | None:
    """The animation that moves `skeleton` when nothing of ours does, None if there is none.

    Where an earlier run of ours is bound, it is what that run built upon.
    """
    prim = UsdSkel.BindingAPI(stage.GetPrimAtPath(skeleton)).GetInheritedAnimationSource()
    if not _usable(prim):
        return None
    if not is_ours(prim):
        return UsdSkel.Animation(prim)
    arcs = Usd.PrimCompositionQuery(prim).GetCompositionArcs()
    below = [stage.GetPrimAtPath(arc.GetTargetPrimPath()) for arc in arcs]
    earlier = [prim for prim in below if _usable(prim) and not is_ours(prim)]
    return UsdSkel.Animation(earlier[0]) if earlier else None  # strongest first


def _usable(prim: Usd.Prim) -> bool:
    return bool(prim) and prim.IsActive() and prim.IsA(UsdSkel.Animation)


def shape_names(animation: UsdSkel.Animation) -> tuple[str, ...]:
    """The animation's ``blendShapes``; empty if it has none."""
    return tuple(str(name) for name in animation.GetBlendShapesAttr().Get() or ())


def weight_samples(
    animation: UsdSkel.Animation,
) -> tuple[NDArray[np.float64], list[NDArray[np.float32]]]:
    """The animation's weights as they are stored.

    Returns:
        Time codes, shape (T,), and T rows, each as long as the file has it. A value without time
        is one row at time code 0; without any value T = 0.
    """
    attribute = animation.GetBlendShapeWeightsAttr()
    codes = attribute.GetTimeSamples()
    values = [attribute.Get(code) for code in codes] or [attribute.Get()]
    rows = [np.asarray(value, dtype=np.float32) for value in values if value is not None]
    return np.array((codes or [0.0])[: len(rows)], dtype=np.float64), rows


def load_usd(path: Path) -> Character:
    """The character in the USD file at `path`.

    Raises:
        InputError: ``asset-unreadable``; ``asset-no-blendshapes``; ``asset-no-skeleton``: no
            animation could reach its blendshapes; ``asset-instanced``: its skeleton is inside an
            instance, where nothing can be edited.
    """
    stage = open_stage(path)
    with usd_errors(path):
        meshes = speaking_meshes(stage)
        _refuse_instanced(stage, meshes, path)
        if not meshes:
            raise _nothing_to_drive(stage, path)
        return Character(
            source=path,
            format="usd",
            meshes=tuple(
                MeshShapes(
                    path=str(mesh.path),
                    name=mesh.path.name,
                    shapes=mesh.shapes,
                    # USD knows no rest weights: what no animation lists is 0. A face animation
                    # that the asset came with is no rest pose either; dialogue replaces it.
                    rest=(0.0,) * len(mesh.shapes),
                )
                for mesh in meshes
            ),
            animations=tuple(animation.GetPrim().GetName() for animation in animations(stage)),
        )


def _refuse_instanced(stage: Usd.Stage, meshes: tuple[SpeakingMesh, ...], path: Path) -> None:
    for mesh in meshes:
        prim = stage.GetPrimAtPath(mesh.skeleton)
        if not prim.IsInstanceProxy():
            continue
        while not prim.IsInstance():
            prim = prim.GetParent()
        raise InputError(
            "asset-instanced",
            f"the skeleton {mesh.skeleton} of {mesh.path} is inside the instance "
            f"{prim.GetPath()}, where USD allows no edits",
            place=str(path),
            action=f"Set 'instanceable = false' on {prim.GetPath()}, or export the character "
            "without instancing.",
        )


def _nothing_to_drive(stage: Usd.Stage, path: Path) -> InputError:
    """Why no mesh of `stage` can be driven."""
    for prim in stage.Traverse(Usd.TraverseInstanceProxies(Usd.PrimDefaultPredicate)):
        binding = UsdSkel.BindingAPI(prim)
        if (
            prim.IsA(UsdGeom.Mesh)
            and binding.GetBlendShapesAttr().Get()
            and binding.GetBlendShapeTargetsRel().GetTargets()
        ):
            return InputError(
                "asset-no-skeleton",
                f"the blendshapes of {prim.GetPath()} are not bound to a skeleton, so that no "
                "animation can reach them",
                place=str(path),
                action="Put mesh and skeleton below one SkelRoot, apply SkelBindingAPI to the "
                "mesh and set its 'skel:skeleton'; exporters do so for a mesh with an armature.",
            )
    problem = "no mesh has blendshapes"
    if errors := stage.GetCompositionErrors():
        problem += f"; but parts of the asset are missing: {' '.join(str(errors[0]).split())}"
    return InputError(
        "asset-no-blendshapes",
        problem,
        place=str(path),
        action="Export the character with its blendshapes (shape keys, morph targets).",
    )
