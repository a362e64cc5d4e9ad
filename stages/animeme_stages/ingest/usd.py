"""Characters from USD: what they can say something with, and what moves them already."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager, nullcontext
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from pxr import Sdf, Tf, Usd, UsdGeom, UsdSkel, Vt

from animeme.errors import InputError
from animeme.rig import Character, MeshShapes
from animeme_stages.ingest.usd_crate import require_table
from animeme_stages.ingest.usd_meshes import SpeakingMesh, bound_prim, host_prim
from animeme_stages.ingest.usd_references import require_local
from animeme_stages.ingest.usd_variants import driven_meshes, speaking_variant

SCOPE = "Dialogue"  # holds the lines, below the character's prim
POINTER = "active"  # the animation that the skeleton is bound to; reserved, never a line
SOUND = "sound"  # the recording of the line that a variant chooses; reserved too
CUSTOM_DATA = "animeme"  # key of the customData dictionary on prims that we author


@contextmanager
def quiet() -> Iterator[None]:
    """Keep what pxr warns of from standard error; its exceptions pass."""
    # Python can hold back pxr's warnings only since usd-core 26; older ones print them.
    trap: Any = getattr(Tf, "DiagnosticTrap", nullcontext)
    with trap() as held:
        try:
            yield
        finally:
            if held is not None:
                held.Clear()


@contextmanager
def usd_errors(path: Path) -> Iterator[None]:
    """Turn what pxr raises about the file at `path` into an `InputError`, and keep pxr quiet.

    Raises:
        InputError: ``asset-unreadable``.
    """
    try:
        with quiet():
            yield
    except (Tf.ErrorException, UnicodeDecodeError) as error:  # names that are no UTF-8
        raise InputError(
            "asset-unreadable",
            f"cannot be read as USD: {_reason(error)}",
            place=str(path),
            action="Export the asset anew, and check that it opens in usdview.",
        ) from error


def _reason(error: Any) -> str:
    """The first of the messages in a pxr exception, without source positions."""
    if isinstance(error, UnicodeDecodeError):
        return "a name in it is not UTF-8"
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
    require_file(path)
    require_table(path)
    with usd_errors(path):
        return Usd.Stage.Open(str(path))


def require_file(path: Path) -> None:
    """Make sure that there is a file at `path`.

    Raises:
        InputError: ``asset-unreadable``.
    """
    if not path.is_file():
        raise InputError(
            "asset-unreadable",
            "does not exist" if not path.exists() else "is not a file",
            place=str(path),
            action="Check the path.",
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
    names = animation.GetBlendShapesAttr().Get()
    return tuple(map(str, names)) if isinstance(names, Vt.TokenArray) else ()


def weight_samples(
    animation: UsdSkel.Animation,
) -> tuple[NDArray[np.float64], list[NDArray[np.float32]]]:
    """The animation's weights as they are stored.

    Returns:
        Time codes, shape (T,), and T rows, each as long as the file has it; empty where it has
        something else than numbers. A value without time is one row at time code 0; without any
        value T = 0.
    """
    attribute = animation.GetBlendShapeWeightsAttr()
    codes = attribute.GetTimeSamples()
    values = [attribute.Get(code) for code in codes] or [attribute.Get()]
    rows = [
        np.asarray(value if isinstance(value, Vt.FloatArray) else (), dtype=np.float32)
        for value in values
        if value is not None
    ]
    return np.array((codes or [0.0])[: len(rows)], dtype=np.float64), rows


def load_usd(path: Path, folder: Path) -> Character:
    """The character in the USD file at `path`.

    Args:
        path: the file.
        folder: where all of its layers must be.

    Raises:
        InputError: ``asset-unreadable``; ``asset-uri-refused``: it refers to layers outside
            `folder`; ``asset-no-blendshapes``; ``asset-no-skeleton``: no animation could reach its
            blendshapes; ``asset-variant-unselected``: only with another variant could it speak;
            ``asset-instanced``: its skeleton is inside an instance that takes no other animation;
            ``asset-time-invalid``: its time codes have no length.
    """
    require_file(path)
    require_table(path)
    with usd_errors(path):
        require_local(path, folder)
    stage = open_stage(path)
    with usd_errors(path):
        _require_time(stage, path)
        meshes = driven_meshes(stage)
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


def _require_time(stage: Usd.Stage, path: Path) -> None:
    layer = stage.GetRootLayer()
    for name, rate_hz in (
        ("timeCodesPerSecond", stage.GetTimeCodesPerSecond()),
        ("framesPerSecond", layer.framesPerSecond),
        ("startTimeCode", 1.0 + abs(stage.GetStartTimeCode())),
        ("endTimeCode", 1.0 + abs(stage.GetEndTimeCode())),
    ):
        if not 0.0 < rate_hz < np.inf:
            raise InputError(
                "asset-time-invalid",
                f"its {name} is no number that time could be told by",
                place=str(path),
                action="Set it in the asset; 24, 30 and 60 per second are usual.",
            )


def _refuse_instanced(stage: Usd.Stage, meshes: tuple[SpeakingMesh, ...], path: Path) -> None:
    for mesh in meshes:
        bound = bound_prim(stage, mesh.skeleton)
        if bound is not None and host_prim(stage, bound) is not None:
            continue
        prim = stage.GetPrimAtPath(mesh.skeleton) if bound is None else bound
        while prim.IsInstanceProxy():
            prim = prim.GetParent()
        why = (
            "and bound to an animation there, where USD allows no edits"
            if bound is None
            else "which is the root of the asset, where nothing can be added"
        )
        raise InputError(
            "asset-instanced",
            f"the skeleton {mesh.skeleton} of {mesh.path} is inside the instance "
            f"{prim.GetPath()}, {why}",
            place=str(path),
            action=f"Set 'instanceable = false' on {prim.GetPath()}, or export the character "
            "without instancing.",
        )


def _nothing_to_drive(stage: Usd.Stage, path: Path) -> InputError:
    """Why no mesh of `stage` can be driven."""
    if found := speaking_variant(stage):
        prim_path, name, variant = found
        return InputError(
            "asset-variant-unselected",
            f"nothing in it can speak as it is; with the variant '{variant}' of '{name}' on "
            f"{prim_path} it could",
            place=str(path),
            action="Select that variant in the asset, or in a layer of your own that sublayers it.",
        )
    problem = "no mesh has blendshapes"
    for prim in stage.Traverse(Usd.TraverseInstanceProxies(Usd.PrimDefaultPredicate)):
        binding = UsdSkel.BindingAPI(prim)
        if not (prim.IsA(UsdGeom.Mesh) and binding.GetBlendShapesAttr().Get()):
            continue
        targets = map(stage.GetPrimAtPath, binding.GetBlendShapeTargetsRel().GetTargets())
        if not any(target and target.IsA(UsdSkel.BlendShape) for target in targets):
            problem = f"{prim.GetPath()} names blendshapes, but there are none behind the names"
        else:
            return InputError(
                "asset-no-skeleton",
                f"the blendshapes of {prim.GetPath()} are not bound to a skeleton, so that no "
                "animation can reach them",
                place=str(path),
                action="Put mesh and skeleton below one SkelRoot, apply SkelBindingAPI to the "
                "mesh and set its 'skel:skeleton'; exporters do so for a mesh with an armature.",
            )
    if errors := stage.GetCompositionErrors():
        problem += f"; but parts of the asset are missing: {' '.join(str(errors[0]).split())}"
    return InputError(
        "asset-no-blendshapes",
        problem,
        place=str(path),
        action="Export the character with its blendshapes (shape keys, morph targets).",
    )
