"""Which files a USD asset may pull in: those of its own folder, or of one that the job names.

USD's own resolver opens whatever path a layer names. So the paths are looked at first, layer by
layer, before any stage is composed; a file outside is never opened. Textures and sounds are not
looked at: nobody here opens them.
"""

from __future__ import annotations

import os
import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from pxr import Ar, Sdf

from animeme.errors import InputError

# "http:", "omniverse:", and the drive letters of Windows, which are absolute paths.
_SCHEME = re.compile(r"[A-Za-z][A-Za-z0-9+.-]*:")
CLIPS = "clips"


def require_local(path: Path, folder: Path) -> None:
    """Make sure that the layers of the asset at `path` are all within `folder`.

    Raises:
        InputError: ``asset-uri-refused``: a sublayer, reference, payload or value clip is absolute,
            names a network host, or leaves the folder.
    """
    inside = os.path.realpath(folder)
    waiting, seen = [str(path)], set()
    while waiting:
        identifier = waiting.pop()
        if identifier in seen:
            continue
        seen.add(identifier)
        layer = Sdf.Layer.FindOrOpen(identifier)
        if layer is None:
            continue  # missing or damaged: composition reports it
        for asset in sorted(set(_assets(layer))):
            found = layer.ComputeAbsolutePath(asset)
            if problem := _problem(asset, _file(found, identifier), inside):
                raise InputError(
                    "asset-uri-refused",
                    f"refers to {asset[:120]!r}, which {problem}",
                    place=identifier,
                    action="Refer to it by a relative path, from a folder that the character's "
                    "'asset_root' in the job names (its own by default), or flatten the asset "
                    "into one file (usdcat --flatten).",
                )
            waiting.append(found)


def _file(found: str, identifier: str) -> str:
    """The file that a resolved path of the layer `identifier` is, or is in."""
    layer_file: str = Ar.SplitPackageRelativePathOuter(identifier)[0]
    file: str = Ar.SplitPackageRelativePathOuter(found)[0]
    # What neither folder nor search path have stays relative.
    return os.path.join(os.path.dirname(os.path.abspath(layer_file)), file)


def _problem(asset: str, file: str, inside: str) -> str:
    """What is wrong with `asset`, which is `file`; "" if nothing is."""
    if asset.startswith(("//", "\\\\")) or _SCHEME.match(asset):
        return "names a network host or a drive"
    if asset.startswith(("/", "\\", "~")):
        return "is an absolute path"
    if os.path.commonpath([inside, os.path.realpath(file)]) != inside:
        return f"is not below {inside}"
    return ""


def _assets(layer: Sdf.Layer) -> Iterator[str]:
    """Every path that composing `layer` may open."""
    # Not GetCompositionAssetDependencies: on a damaged layer it ends the process (26.11).
    yield from layer.subLayerPaths
    yield from layer.GetExternalAssetDependencies()  # of file formats that are made of others
    prims: list[Sdf.Path] = []
    layer.Traverse(Sdf.Path.absoluteRootPath, prims.append)
    for path in prims:
        if not path.IsPropertyPath() and (spec := layer.GetPrimAtPath(path)):
            for arcs in ("references", "payload"):
                if spec.HasInfo(arcs):
                    yield from _assets_of(spec.GetInfo(arcs))
            if spec.HasInfo(CLIPS):
                yield from _paths_in(spec.GetInfo(CLIPS))


def _assets_of(arcs: Any) -> Iterator[str]:
    """Asset paths in a list of references or payloads, however they are put together."""
    for items in (arcs.explicitItems, arcs.prependedItems, arcs.appendedItems, arcs.addedItems):
        yield from (arc.assetPath for arc in items if arc.assetPath)


def _paths_in(value: object) -> Iterator[str]:
    """Every asset path in the nested value of a ``clips`` dictionary."""
    if isinstance(value, Sdf.AssetPath):
        yield value.path
    elif isinstance(value, dict):
        for name, item in value.items():
            if name == "templateAssetPath" and isinstance(item, str):
                yield item
            yield from _paths_in(item)
    elif isinstance(value, Sdf.AssetPathArray):
        yield from (item.path for item in value)
