"""Where dialogue goes in a USD character, and what of the old animation goes with it."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from pxr import Sdf, Usd

from animeme.curves import CurveSet, interpolate
from animeme.errors import InputError
from animeme.rig import Character
from animeme_stages.ingest.usd import (
    POINTER,
    SCOPE,
    SOUND,
    bound_animation,
    is_ours,
    shape_names,
    weight_samples,
)
from animeme_stages.ingest.usd_meshes import SpeakingMesh, bound_prim, host_prim
from animeme_stages.ingest.usd_variants import OUR_SETS, driven_meshes


@dataclass(frozen=True)
class OldWeights:
    """Weights of the animation that a skeleton came with.

    Attributes:
        names: its N shapes, by stored name.
        codes: time codes of its keys, shape (K,), strictly increasing.
        weights: shape (K, N).
    """

    names: tuple[str, ...]
    codes: NDArray[np.float64]
    weights: NDArray[np.float64]

    @property
    def constant(self) -> bool:
        """Whether no weight ever changes."""
        return bool((self.weights == self.weights[:1]).all())


@dataclass(frozen=True)
class Rig:
    """One skeleton to drive, or the skeletons of one instance.

    Attributes:
        bound: the prim that its animation is bound at: the skeleton, or the instance.
        folder: the scope that holds its lines and their pointer.
        owned: stored shape names of all of its meshes.
        animation: the animation that it came with, if any.
        old: the weights of that.
    """

    bound: Sdf.Path
    folder: Sdf.Path
    owned: tuple[str, ...]
    animation: Sdf.Path | None
    old: OldWeights

    @property
    def pointer(self) -> Sdf.Path:
        """The animation that a variant points at one of the lines."""
        return self.folder.AppendChild(POINTER)


@dataclass(frozen=True)
class Host:
    """A character prim: it carries the variant sets and the dialogue of the skeletons below it.

    Attributes:
        path: the prim.
        scope: the dialogue scope, a child of it.
        instanceable: it would turn into an instance, closed to us, once it has a variant set.
        rigs: the skeletons.
    """

    path: Sdf.Path
    scope: Sdf.Path
    instanceable: bool
    rigs: tuple[Rig, ...]


def plan(character: Character, stage: Usd.Stage) -> tuple[Host, ...]:
    """The prims that `character`'s dialogue goes to; the same for every line and language."""
    by_host: dict[Sdf.Path, dict[Sdf.Path, list[SpeakingMesh]]] = {}
    for mesh in driven_meshes(stage):
        bound = bound_prim(stage, mesh.skeleton)
        host = bound and host_prim(stage, bound)
        if bound and host:  # `load` refuses the others
            rigs = by_host.setdefault(host.GetPath(), {})
            rigs.setdefault(bound.GetPath(), []).append(mesh)
    return tuple(_host(stage, path, rigs) for path, rigs in by_host.items())


def _host(stage: Usd.Stage, path: Sdf.Path, by_bound: dict[Sdf.Path, list[SpeakingMesh]]) -> Host:
    scope = path.AppendChild(_free_scope(stage, path))
    _require_free_sets(stage, path, scope)
    names = distinct_identifiers([bound.name for bound in by_bound], taken=[SOUND])
    rigs = []
    for (bound, meshes), name in zip(by_bound.items(), names, strict=True):
        animation = bound_animation(stage, bound)
        rigs.append(
            Rig(
                bound=bound,
                folder=scope if len(by_bound) == 1 else scope.AppendChild(name),
                owned=tuple(dict.fromkeys(shape for mesh in meshes for shape in mesh.shapes)),
                animation=animation.GetPath() if animation else None,
                old=_old_weights(animation),
            )
        )
    return Host(path, scope, stage.GetPrimAtPath(path).IsInstanceable(), tuple(rigs))


def _free_scope(stage: Usd.Stage, host: Sdf.Path) -> str:
    """``Dialogue``, numbered where the character has given that name to something else."""
    name, number = SCOPE, 0
    while (prim := stage.GetPrimAtPath(host.AppendChild(name))) and not is_ours(prim):
        number += 1
        name = f"{SCOPE}_{number}"
    return name


def _require_free_sets(stage: Usd.Stage, host: Sdf.Path, scope: Sdf.Path) -> None:
    """Refuse variant sets of somebody else under our names: to choose a line would change them."""
    taken = OUR_SETS & set(stage.GetPrimAtPath(host).GetVariantSets().GetNames())
    if taken and not stage.GetPrimAtPath(scope):
        raise InputError(
            "asset-name-taken",
            f"{host} has a variant set '{min(taken)}' of its own",
            place=stage.GetRootLayer().identifier,
            action="Rename that variant set in the source.",
        )


def _old_weights(animation: object) -> OldWeights:
    names = shape_names(animation) if animation else ()
    codes, rows = weight_samples(animation) if names else (np.empty(0), [])
    # UsdSkel ignores weights whose number is not that of the names; so do we.
    whole = [i for i, row in enumerate(rows) if len(row) == len(names) and np.isfinite(row).all()]
    if not whole:
        return OldWeights((), np.zeros(1), np.empty((1, 0)))
    return OldWeights(names, codes[whole], np.array([rows[i] for i in whole], dtype=np.float64))


def shape_weights(
    rig: Rig, character: Character, curves: CurveSet, codes_per_s: float
) -> tuple[tuple[str, ...], NDArray[np.float64], NDArray[np.float32]]:
    """What the animation of one line holds for one skeleton.

    Shapes with a curve take it, under every stored name they go by. The old animation's other
    shapes go on as before: linear on the union of both time axes, which reproduces both exactly.

    Returns:
        N stored names, T time codes and weights of shape (T, N).
    """
    column = {name: i for i, name in enumerate(curves.names)}
    driven = [name for name in rig.owned if character.canonical[name] in column]
    carried = [i for i, name in enumerate(rig.old.names) if name not in set(driven)]

    codes = curves.times_s * codes_per_s
    ours = curves.weights[:, [column[character.canonical[name]] for name in driven]]
    old = OldWeights(
        tuple(rig.old.names[i] for i in carried), rig.old.codes, rig.old.weights[:, carried]
    )
    axis = codes if old.constant else np.union1d(codes, old.codes)
    if len(axis) != len(codes):
        ours = interpolate(codes, ours, axis)
    weights = np.hstack([ours, interpolate(old.codes, old.weights, axis)])
    return (*driven, *old.names), axis, weights.astype(np.float32)


def distinct_identifiers(names: Iterable[str], *, taken: Iterable[str] = ()) -> list[str]:
    """One valid prim name per name, each different and none of `taken`.

    Letters of every script stay, as USD has allowed since 24.03; the rest turns into ``_``.
    """
    used = set(taken)
    result = []
    for name in names:
        stem = identifier(name)
        candidate, number = stem, 0
        while candidate in used:
            number += 1
            candidate = f"{stem}_{number}"
        used.add(candidate)
        result.append(candidate)
    return result


def identifier(name: str) -> str:
    """`name` as a prim name: as it is, but for ``_`` where USD does not allow a letter."""
    valid = Sdf.Path.IsValidIdentifier
    text = "".join(letter if valid(f"_{letter}") else "_" for letter in name)
    return text if valid(text) else f"_{text}"
