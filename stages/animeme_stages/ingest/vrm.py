"""What a VRM file calls its poses: expressions (1.0) and blend shape groups (0.x).

After the schemas of VRMC_vrm 1.0 (expressions.schema.json) and VRM 0.x (blendshape.schema.json).
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

from animeme.rig import Drive, MeshShapes, canonical_names

# VRM 0.x counts bind weights in percent.
_PERCENT = 100.0


def expressions(
    root: Mapping[str, Any], meshes: Sequence[MeshShapes]
) -> dict[str, tuple[Drive, ...]]:
    """Each expression that moves shapes, as the shapes that it binds; {} where the file is no VRM.

    A bind that points at nothing is left out, as viewers do: the asset can be driven without it.

    Args:
        root: the file's JSON.
        meshes: what was read of it, one per node.
    """
    canonical = canonical_names([mesh.shapes for mesh in meshes])
    shapes = {mesh.path: [canonical[name] for name in mesh.shapes] for mesh in meshes}
    found: dict[str, tuple[Drive, ...]] = {}
    for name, binds in (*_version_1(root), *_version_0(root)):
        drives: dict[str, float] = {}
        for node, index, weight in binds:
            own = shapes.get(f"/nodes/{node}", [])
            if isinstance(index, int) and 0 <= index < len(own) and _is_number(weight):
                drives[own[index]] = max(drives.get(own[index], 0.0), min(float(weight), 1.0))
        moved = tuple(Drive(shape, weight) for shape, weight in drives.items() if weight > 0)
        if moved:
            found.setdefault(name, moved)
    return found


_Binds = list[tuple[Any, Any, Any]]


def _version_1(root: Mapping[str, Any]) -> Iterator[tuple[str, _Binds]]:
    groups = _member(_member(root, "extensions"), "VRMC_vrm")
    for kind in ("preset", "custom"):
        for name, expression in _member(_member(groups, "expressions"), kind).items():
            binds = _items(expression, "morphTargetBinds")
            yield name, [(b.get("node"), b.get("index"), b.get("weight")) for b in binds]


def _version_0(root: Mapping[str, Any]) -> Iterator[tuple[str, _Binds]]:
    master = _member(_member(_member(root, "extensions"), "VRM"), "blendShapeMaster")
    nodes = _items(root, "nodes")
    for group in _items(master, "blendShapeGroups"):
        preset = group.get("presetName")
        known = isinstance(preset, str) and preset not in ("", "unknown")
        name = preset if known else group.get("name")
        binds = [
            (node, bind.get("index"), bind["weight"] / _PERCENT)
            for bind in _items(group, "binds")
            if _is_number(bind.get("weight"))
            for node, holder in enumerate(nodes)
            if holder.get("mesh") == bind.get("mesh")
        ]
        if isinstance(name, str) and name:
            yield name, binds


def _member(holder: Any, name: str) -> Mapping[str, Any]:
    member = holder.get(name) if isinstance(holder, dict) else None
    return member if isinstance(member, dict) else {}


def _items(holder: Any, name: str) -> list[Mapping[str, Any]]:
    items = holder.get(name) if isinstance(holder, dict) else None
    return [item for item in items if isinstance(item, dict)] if isinstance(items, list) else []


def _is_number(value: Any) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool) and abs(value) < 1e9
