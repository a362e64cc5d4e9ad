"""VRM's expressions: poses that the file names, and the morph targets that they are bound to.

Both are read: VRM 1.0 (``VRMC_vrm``) binds by node, VRM 0.x (``VRM``) by mesh and in percent. What
is malformed is left out; it is no reason not to animate the mesh.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from contextlib import suppress
from typing import Any

from animeme.rig import Drive, MeshShapes, canonical_names
from animeme_stages.ingest.gltf_document import MALFORMED

# VRM 0.x's presets of the mouth, as its models call them.
_VOWELS_0 = {"a": "A", "i": "I", "u": "U", "e": "E", "o": "O"}

Bind = tuple[str, int, float]  # node or mesh as a JSON pointer, target, weight


def expressions(
    root: Mapping[str, Any], meshes: Sequence[MeshShapes]
) -> dict[str, tuple[Drive, ...]]:
    """Expressions that move a morph target, as drives of canonical shape names.

    Args:
        root: the glTF document.
        meshes: of the character.
    """
    canonical = canonical_names([mesh.shapes for mesh in meshes])
    by_path = {mesh.path: mesh for mesh in meshes}
    for mesh in meshes:
        node = root["nodes"][int(mesh.path.rpartition("/")[2])]
        by_path.setdefault(f"/meshes/{node['mesh']}", mesh)
    found: dict[str, tuple[Drive, ...]] = {}
    for name, binds in _expressions(root):
        drives: dict[str, float] = {}
        for path, index, weight in binds:
            owner = by_path.get(path)
            if owner is not None and 0 <= index < len(owner.shapes) and weight:
                drives.setdefault(canonical[owner.shapes[index]], weight)
        if drives and name not in found:
            found[name] = tuple(Drive(shape, gain) for shape, gain in drives.items())
    return found


def bound_names(root: Mapping[str, Any]) -> dict[tuple[str, int], str]:
    """Node or mesh, and target → the expression that says most about that target alone.

    Names for targets that have none.
    """
    fewest: dict[tuple[str, int], tuple[int, str]] = {}
    for name, binds in _expressions(root):
        for path, index, _ in binds:
            other = fewest.get((path, index))
            if other is None or len(binds) < other[0]:
                fewest[path, index] = len(binds), name
    return {place: name for place, (_, name) in fewest.items()}


def _expressions(root: Mapping[str, Any]) -> Iterator[tuple[str, list[Bind]]]:
    with suppress(*MALFORMED):
        declared = root["extensions"]["VRMC_vrm"]["expressions"]
        for kind in ("preset", "custom"):
            for name, expression in declared.get(kind, {}).items():
                if isinstance(expression, dict) and expression.get("isBinary") is not True:
                    yield name, list(_binds_1(expression))
    with suppress(*MALFORMED):
        for group in root["extensions"]["VRM"]["blendShapeMaster"]["blendShapeGroups"]:
            if isinstance(group, dict) and group.get("isBinary") is not True:
                preset = str(group.get("presetName", "unknown")).lower()
                name = str(group.get("name", "")) if preset == "unknown" else preset
                yield _VOWELS_0.get(name, name), list(_binds_0(group))


def _binds_1(expression: Mapping[str, Any]) -> Iterator[Bind]:
    with suppress(*MALFORMED):
        for bind in expression.get("morphTargetBinds", []):
            yield f"/nodes/{int(bind['node'])}", int(bind["index"]), _finite(bind["weight"])


def _binds_0(group: Mapping[str, Any]) -> Iterator[Bind]:
    with suppress(*MALFORMED):
        for bind in group.get("binds", []):
            yield f"/meshes/{int(bind['mesh'])}", int(bind["index"]), _finite(bind["weight"]) / 100


def _finite(value: Any) -> float:
    number = float(value)
    if not abs(number) < 1e6:
        raise ValueError("no weight")
    return number
