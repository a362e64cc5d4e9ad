"""What an override layer does to its source beyond adding dialogue.

Composition does most of the work: a value can differ from the source's only where the layer itself
has an opinion. So it is enough to look at every opinion of the layer, at what stages read from
their root layer alone, and at the animation that skeletons are now bound to.
"""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

from pxr import Sdf, Usd, UsdGeom, UsdSkel

from animeme.rig import Character
from animeme_stages.ingest.usd import POINTER, open_stage, shape_names, usd_errors
from animeme_stages.ingest.usd_variants import LANGUAGE_SET, OUR_SETS
from animeme_stages.write.usd_layer import (
    ANIMATION_SOURCE,
    BINDING_API,
    root_metadata,
)
from animeme_stages.write.usd_plan import Host, Rig, plan

OUR_TIMES = frozenset({"startTimeCode", "endTimeCode"})

# What a prim spec may say anywhere without changing the prim: that it is an "over", and who its
# children are.
STRUCTURE = frozenset({"specifier", "primChildren", "properties", "typeName"})
VARIANTS = frozenset({"variantSelection", "variantSetNames", "variantSetChildren"})

BODY = ("joints", "translations", "rotations", "scales")


def harm(character: Character, output: Path) -> list[str]:
    """What `output` lost or changed of the character's source, one sentence each.

    Raises:
        InputError: ``asset-unreadable``: either of them cannot be read.
    """
    before, after = open_stage(character.source), open_stage(output)
    with usd_errors(output):
        hosts = plan(character, before)
        if missing := _source_is_missing(after.GetRootLayer(), character.source):
            return [missing]
        return [
            *_stage_metadata(before, after, output),
            *_opinions(before, after.GetRootLayer(), hosts),
            *_structure(before, after, {rig.bound for host in hosts for rig in host.rigs}),
            *(text for host in hosts for rig in host.rigs for text in _body(before, after, rig)),
        ]


def _source_is_missing(layer: Sdf.Layer, source: Path) -> str:
    """Why `layer` does not say what `source` says; "" if it does."""
    paths = list(layer.subLayerPaths)
    found = [Path(layer.ComputeAbsolutePath(path)).resolve() for path in paths]
    if source.resolve() not in found:
        return f"The source {source.name} is not among the sublayers."
    at = found.index(source.resolve())
    if at > 0:
        return f"The sublayer {paths[0]} hides parts of the source."
    if layer.subLayerOffsets[at] != Sdf.LayerOffset():
        return "The source's animation is shifted or stretched in time."
    return ""


def _stage_metadata(before: Usd.Stage, after: Usd.Stage, output: Path) -> Iterator[str]:
    wanted = root_metadata(before.GetRootLayer(), output)
    found = root_metadata(after.GetRootLayer(), output)
    for key in sorted(wanted.keys() - OUR_TIMES):
        if wanted[key] != found.get(key):
            yield f"The stage's {key} was {wanted[key]!r} and is {found.get(key)!r}."
    for what, read in {
        "time codes per second": Usd.Stage.GetTimeCodesPerSecond,
        "frames per second": Usd.Stage.GetFramesPerSecond,
        "up axis": UsdGeom.GetStageUpAxis,
        "metres per unit": UsdGeom.GetStageMetersPerUnit,
    }.items():
        if read(before) != read(after):
            yield f"The stage had {what} {read(before)} and has {read(after)}."
    if (
        after.GetStartTimeCode() > before.GetStartTimeCode()
        or after.GetEndTimeCode() < before.GetEndTimeCode()
    ):
        yield "The stage's time range no longer holds the source's."


def _opinions(before: Usd.Stage, layer: Sdf.Layer, hosts: tuple[Host, ...]) -> Iterator[str]:
    """Everything that `layer` says about prims that are not ours."""
    paths: list[Sdf.Path] = []
    layer.Traverse(Sdf.Path.absoluteRootPath, paths.append)
    bound = {rig.bound for host in hosts for rig in host.rigs}
    characters = {host.path for host in hosts}
    scopes = [host.scope for host in hosts]
    for path in sorted(paths):
        plain = path.StripAllVariantSelections()
        if path.IsAbsoluteRootPath() or any(plain.HasPrefix(scope) for scope in scopes):
            continue
        if path.IsPropertyPath():
            if not (plain.name == ANIMATION_SOURCE and plain.GetPrimPath() in bound):
                yield f"{plain} is overridden."
        elif path.IsPrimVariantSelectionPath():
            selection = path.GetVariantSelection()
            if plain not in characters or selection[0] not in OUR_SETS:
                yield f"{plain} has the variant {selection} added or changed."
            elif selection[1]:
                yield from _variant(layer, path)
        elif path.IsPrimPath():
            said = set(layer.GetObjectAtPath(path).ListInfoKeys()) - STRUCTURE
            yield from _prim(before, layer, path, said, plain in characters, plain in bound)


def _variant(layer: Sdf.Layer, path: Sdf.Path) -> Iterator[str]:
    """A variant of ours may reference a language's layer, and nothing else."""
    said = set(layer.GetObjectAtPath(path).primSpec.ListInfoKeys()) - STRUCTURE
    if path.GetVariantSelection()[0] == LANGUAGE_SET:
        said.discard("references")
    for key in sorted(said):
        yield f"{path} overrides {key}."


def _prim(
    before: Usd.Stage,
    layer: Sdf.Layer,
    path: Sdf.Path,
    said: set[str],
    is_host: bool,
    is_bound: bool,
) -> Iterator[str]:
    spec = layer.GetObjectAtPath(path)
    plain = path.StripAllVariantSelections()
    if not before.GetPrimAtPath(plain):
        yield f"{plain} is not in the source."
        return
    if spec.specifier != Sdf.SpecifierOver or spec.typeName:
        yield f"{plain} is defined anew as '{spec.typeName}'."
    if is_host:
        said -= VARIANTS
        if not spec.instanceable:
            said.discard("instanceable")  # what is not an instance stays none
        if strange := set(spec.variantSelections.keys()) - OUR_SETS:
            yield f"{plain} selects other variants of {', '.join(sorted(strange))}."
    if is_bound and spec.GetInfo("apiSchemas") == Sdf.TokenListOp.Create([BINDING_API]):
        said.discard("apiSchemas")
    for key in sorted(said):
        yield f"{plain} has its {key} overridden."


def _structure(before: Usd.Stage, after: Usd.Stage, bound: set[Sdf.Path]) -> Iterator[str]:
    """Prims, their types, properties and targets: what weaker layers could still add to."""
    everything = Usd.TraverseInstanceProxies(Usd.PrimAllPrimsPredicate)
    for prim in Usd.PrimRange.Stage(before, everything):
        path = prim.GetPath()
        twin = after.GetPrimAtPath(path)
        if not twin:
            yield f"{path} is gone."
            continue
        for what, was, now in _traits(prim, twin, path in bound):
            if was != now:
                yield f"{path} had {what} {was} and has {now}."


def _traits(prim: Usd.Prim, twin: Usd.Prim, driven: bool) -> Iterator[tuple[str, Any, Any]]:
    yield "the type", prim.GetTypeName(), twin.GetTypeName()
    yield "the specifier", prim.GetSpecifier(), twin.GetSpecifier()
    yield "activation", prim.IsActive(), twin.IsActive()
    yield "instancing", prim.IsInstance(), twin.IsInstance()
    ignored = {BINDING_API} if driven else set()
    was, now = ([*p.GetAppliedSchemas()] for p in (prim, twin))
    yield "the schemas", set(was) - ignored, set(now) - ignored
    names = set(prim.GetAuthoredPropertyNames())
    yield "the properties", names, names & set(twin.GetAuthoredPropertyNames())
    for relation in prim.GetAuthoredRelationships():
        if not (driven and relation.GetName() == ANIMATION_SOURCE):
            targets = twin.GetRelationship(relation.GetName()).GetTargets()
            yield f"the targets of {relation.GetName()}", relation.GetTargets(), targets


def _body(before: Usd.Stage, after: Usd.Stage, rig: Rig) -> Iterator[str]:
    """A new animation replaces the old one whole, so it must move all that the old one moved."""
    if rig.animation is None:
        return
    old = UsdSkel.Animation(before.GetPrimAtPath(rig.animation))
    folder = after.GetPrimAtPath(rig.folder)
    for prim in folder.GetChildren() if folder else ():
        if not prim.IsA(UsdSkel.Animation) or prim.GetName() == POINTER:
            continue
        for name in BODY:
            was, now = (_origin(p.GetAttribute(name)) for p in (old.GetPrim(), prim))
            if was != now:
                yield f"{prim.GetPath()} lost the {name} of {rig.animation}."
        if lost := sorted(set(rig.old.names) - set(shape_names(UsdSkel.Animation(prim)))):
            yield f"{prim.GetPath()} lost the shapes {', '.join(lost)} of {rig.animation}."


def _origin(attribute: Usd.Attribute) -> tuple[str, Sdf.Path] | None:
    """Layer and path of the strongest opinion on an attribute; None without any."""
    stack = attribute.GetPropertyStack(Usd.TimeCode.Default())
    return (stack[0].layer.identifier, stack[0].path) if stack else None
