"""Override layers: a source by relative path, and above it only what dialogue needs."""

from __future__ import annotations

import os
import re
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from pxr import Sdf, Tf, Usd, Vt

from animeme.contracts import LineAnimation, Verify
from animeme.files import atomic_path
from animeme.rig import Character
from animeme_stages.ingest.usd import CUSTOM_DATA, POINTER, SOUND, quiet
from animeme_stages.ingest.usd_variants import LANGUAGE_SET, LINE_SET
from animeme_stages.write.usd_plan import (
    Host,
    Rig,
    distinct_identifiers,
    shape_weights,
)

ANIMATION_SOURCE = "skel:animationSource"
BINDING_API = "SkelBindingAPI"

# Not copied from the source's root layer: the first two are ours to say; relocations compose from
# the sublayer by themselves.
OWN_METADATA = frozenset({"subLayers", "subLayerOffsets", "layerRelocates"})


def override_layer(source_path: Path, stage: Usd.Stage, target: Path, *, end_s: float) -> Sdf.Layer:
    """A layer in memory that sublayers a source and speaks for it.

    Stage metadata is read from the root layer alone, so that all of the source's is repeated.

    Args:
        source_path: the source.
        stage: the same, composed.
        target: where the layer will be written.
        end_s: the end time is at least this, seconds.
    """
    source = stage.GetRootLayer()
    layer = Sdf.Layer.CreateAnonymous(".usda")
    layer.subLayerPaths.append(relative_asset(source_path, target))
    for key, value in root_metadata(source, target).items():
        layer.pseudoRoot.SetInfo(key, value)
    codes_per_s = stage.GetTimeCodesPerSecond()
    # Said outright, even where the source leaves them to be derived: a root layer that does not
    # gets 24, and the source's keys would be rescaled.
    layer.timeCodesPerSecond = codes_per_s
    layer.framesPerSecond = stage.GetFramesPerSecond()
    layer.startTimeCode = min(0.0, stage.GetStartTimeCode())
    layer.endTimeCode = max(stage.GetEndTimeCode(), end_s * codes_per_s)
    return layer


def root_metadata(source: Sdf.Layer, target: Path) -> dict[str, Any]:
    """The stage metadata of a root layer, asset paths in it found again from `target`."""
    root = source.pseudoRoot
    return {
        key: _moved(root.GetInfo(key), source, target)
        for key in sorted(root.ListInfoKeys())
        if key not in OWN_METADATA
    }


def _moved(value: Any, source: Sdf.Layer, target: Path) -> Any:
    """`value` with every relative asset path in it made relative to `target`'s folder."""
    if isinstance(value, dict):
        return {key: _moved(item, source, target) for key, item in value.items()}
    if isinstance(value, Sdf.AssetPathArray):
        return Sdf.AssetPathArray([_moved(item, source, target) for item in value])
    if isinstance(value, Sdf.AssetPath) and value.path.startswith("."):
        return Sdf.AssetPath(relative_asset(Path(source.ComputeAbsolutePath(value.path)), target))
    return value


def relative_asset(path: Path, target: Path) -> str:
    """`path` as an asset path in a file at `target`."""
    relative = Path(os.path.relpath(path, target.absolute().parent)).as_posix()
    # Without a leading dot USD would look for it along its search path.
    return relative if relative.startswith("../") else f"./{relative}"


def add_lines(
    layer: Sdf.Layer,
    host: Host,
    character: Character,
    lines: Sequence[LineAnimation],
    target: Path,
    *,
    heard: bool,
) -> None:
    """Author one animation per line and skeleton, and the variants that choose between them.

    Args:
        layer: to author in.
        host: the prim that carries them.
        character: whose lines they are.
        lines: the lines.
        target: where the layer will be written.
        heard: let the variants play the recordings too.
    """
    ordered = sorted(lines, key=lambda line: line.name)
    names = distinct_identifiers([line.name for line in ordered], taken=[POINTER, SOUND])
    _folder(layer, host.scope)
    for rig in host.rigs:
        _folder(layer, rig.folder)
        for line, name in zip(ordered, names, strict=True):
            _add_line(layer, rig, rig.folder.AppendChild(name), character, line)
    variants = variant_set(layer, host, LINE_SET, names[0])
    for line, name in zip(ordered, names, strict=True):
        inside = Sdf.VariantSpec(variants, name).primSpec.path
        for rig in host.rigs:
            path = rig.pointer.ReplacePrefix(host.path, inside)
            _animation(layer, path, rig.folder.AppendChild(name))
        if heard and line.audio is not None:
            path = host.scope.AppendChild(SOUND).ReplacePrefix(host.path, inside)
            start = line.audio_start_s * layer.timeCodesPerSecond
            _add_sound(layer, path, relative_asset(line.audio, target), start)


def add_languages(
    layer: Sdf.Layer, host: Host, by_language: Mapping[str, Path], target: Path
) -> None:
    """Author one variant per language, which references that language's layer."""
    tags = sorted(by_language)
    names = [re.sub(r"[^\w-]", "_", tag) for tag in tags]
    variants = variant_set(layer, host, LANGUAGE_SET, names[0])
    for tag, name in zip(tags, names, strict=True):
        asset = relative_asset(by_language[tag], target)
        inside = Sdf.VariantSpec(variants, name).primSpec
        inside.referenceList.Prepend(Sdf.Reference(asset, host.path))


def variant_set(layer: Sdf.Layer, host: Host, name: str, selected: str) -> Sdf.VariantSetSpec:
    """A new variant set on the character prim, with its selection."""
    prim = Sdf.CreatePrimInLayer(layer, host.path)
    if host.instanceable:
        prim.SetInfo("instanceable", False)
    prim.variantSetNameList.Prepend(name)
    prim.variantSelections[name] = selected
    return Sdf.VariantSetSpec(prim, name)


def bind_pointers(layer: Sdf.Layer, stage: Usd.Stage, host: Host) -> None:
    """Let each skeleton (or instance) play what its pointer points at.

    The binding is local because a variant's would be weaker than the one in the sublayer.
    """
    for rig in host.rigs:
        prim = Sdf.CreatePrimInLayer(layer, rig.bound)
        if BINDING_API not in stage.GetPrimAtPath(rig.bound).GetAppliedSchemas():
            prim.SetInfo("apiSchemas", Sdf.TokenListOp.Create(prependedItems=[BINDING_API]))
        relation = Sdf.RelationshipSpec(prim, ANIMATION_SOURCE, custom=False)
        relation.targetPathList.explicitItems = [rig.pointer]


def _folder(layer: Sdf.Layer, path: Sdf.Path) -> None:
    prim = Sdf.CreatePrimInLayer(layer, path)
    prim.specifier = Sdf.SpecifierDef
    prim.typeName = "Scope"
    prim.customData = {CUSTOM_DATA: {"role": "dialogue"}}


def _animation(layer: Sdf.Layer, path: Sdf.Path, base: Sdf.Path | None) -> Sdf.PrimSpec:
    """A SkelAnimation that has everything `base` has, until something is said about it."""
    prim = Sdf.CreatePrimInLayer(layer, path)
    prim.specifier = Sdf.SpecifierDef
    prim.typeName = "SkelAnimation"
    if base is not None:
        prim.referenceList.Prepend(Sdf.Reference(primPath=base))
    return prim


def _add_line(
    layer: Sdf.Layer, rig: Rig, path: Sdf.Path, character: Character, line: LineAnimation
) -> None:
    prim = _animation(layer, path, rig.animation)
    note = {
        "line": line.name,
        "language": line.language,
        "duration_s": float(line.duration_s),
    }
    if line.audio_start_s:
        note["audio_start_s"] = float(line.audio_start_s)
    if line.events:
        note["eventTags"] = Vt.StringArray([event.tag for event in line.events])
        note["eventTimes_s"] = Vt.DoubleArray([event.time_s for event in line.events])
    prim.customData = {CUSTOM_DATA: note}
    names, codes, weights = shape_weights(rig, character, line.curves, layer.timeCodesPerSecond)
    types = Sdf.ValueTypeNames
    shapes = Sdf.AttributeSpec(prim, "blendShapes", types.TokenArray, Sdf.VariabilityUniform)
    shapes.default = Vt.TokenArray(list(names))
    values = Sdf.AttributeSpec(prim, "blendShapeWeights", types.FloatArray)
    for code, row in zip(codes.tolist(), weights, strict=True):
        layer.SetTimeSample(values.path, code, Vt.FloatArray.FromNumpy(row))


def _add_sound(layer: Sdf.Layer, path: Sdf.Path, asset: str, start: float) -> None:
    """A recording that starts at a time code of its line and is heard alike from everywhere.

    It has no place in space because the mouth moves with the head: who wants it to come from there
    puts it there.
    """
    prim = Sdf.CreatePrimInLayer(layer, path)
    prim.specifier = Sdf.SpecifierDef
    prim.typeName = "SpatialAudio"
    types, uniform = Sdf.ValueTypeNames, Sdf.VariabilityUniform
    for name, kind, value in (
        ("filePath", types.Asset, Sdf.AssetPath(asset)),
        ("auralMode", types.Token, "nonSpatial"),
        ("playbackMode", types.Token, "onceFromStart"),
        ("startTime", types.TimeCode, Sdf.TimeCode(start)),
    ):
        Sdf.AttributeSpec(prim, name, kind, uniform).default = value


def export(layer: Sdf.Layer, target: Path, verify: Verify) -> None:
    """Write `layer` to `target`, binary or text by its suffix, atomically, once it is verified.

    Raises:
        InputError: ``output-unwritable``.
    """
    with atomic_path(target) as scratch:
        try:
            with quiet():  # it warns that sounds need a newer crate than our animation does
                layer.Export(str(scratch))
        except Tf.ErrorException as error:
            raise OSError(str(error)) from error
        verify(scratch)
    # A layer that somebody in this process still holds would hide the new file from us.
    if stale := Sdf.Layer.Find(str(target.absolute())):
        stale.Reload(force=True)
