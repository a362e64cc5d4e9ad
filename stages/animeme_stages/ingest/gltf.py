"""Characters in glTF: which nodes own which morph targets."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from animeme.errors import InputError
from animeme.rig import Character, MeshShapes
from animeme_stages.ingest.glb import Container, by_content, open_container
from animeme_stages.ingest.gltf_document import require_sound, target_count
from animeme_stages.ingest.vrm import bound_names, expressions

FORMAT = "gltf"


def load_gltf(path: Path) -> Character:
    """The character in a glTF file.

    Every node that instances a mesh with morph targets counts as a mesh of the character, as each
    has weights of its own. Targets without a name take that of the VRM expression bound to them.

    Raises:
        InputError: damaged, or without morph targets.
    """
    return character_in(open_container(path))


@by_content
def character_in(container: Container) -> Character:
    """As `load_gltf`, of a file that was opened.

    Raises:
        InputError: as of `load_gltf`.
    """
    require_sound(container)
    root, path = container.json, container.path
    meshes = tuple(_meshes(root))
    if not meshes:
        raise InputError(
            "asset-no-blendshapes",
            "has no mesh with morph targets, so no face that could speak",
            place=str(path),
            action="Export the character with its morph targets (shape keys, blendshapes).",
        )
    names = [str(a.get("name", f"animation {i}")) for i, a in enumerate(root.get("animations", []))]
    return Character(path, FORMAT, meshes, tuple(names), expressions(root, meshes))


def _meshes(root: Mapping[str, Any]) -> list[MeshShapes]:
    found = []
    bound = bound_names(root)
    for index, node in enumerate(root.get("nodes", [])):
        if "mesh" not in node:
            continue
        mesh = root["meshes"][node["mesh"]]
        count = target_count(mesh)
        if not count:
            continue
        rest = node.get("weights") or mesh.get("weights") or [0.0] * count
        name = str(node.get("name") or mesh.get("name") or f"node {index}")
        shapes = target_names(mesh, count)
        if shapes is None:
            shapes = _distinct(
                tuple(
                    bound.get((f"/nodes/{index}", i))
                    or bound.get((f"/meshes/{node['mesh']}", i))
                    or f"target_{i}"
                    for i in range(count)
                )
            )
        found.append(MeshShapes(f"/nodes/{index}", name, shapes, tuple(float(w) for w in rest)))
    return found


def target_names(mesh: Mapping[str, Any], count: int) -> tuple[str, ...] | None:
    """Names of a mesh's targets: its own extras, else those of its primitives, else None.

    Args:
        mesh: glTF mesh object.
        count: how many targets it has.
    """
    carriers: Sequence[Mapping[str, Any]] = [mesh, *mesh["primitives"]]
    for carrier in carriers:
        extras = carrier.get("extras")
        names = extras.get("targetNames") if isinstance(extras, dict) else None
        if isinstance(names, list) and len(names) == count:
            return _distinct(tuple(map(str, names)))
    return None


def _distinct(names: tuple[str, ...]) -> tuple[str, ...]:
    """`names` with a number on every repetition, so that each target can be told apart."""
    taken = set(names)
    if len(taken) == len(names):
        return names
    seen: set[str] = set()
    numbers: dict[str, int] = {}  # last one given to a name, or many equal names take for ever
    result = []
    for name in names:
        free = name
        while free in seen or (free != name and free in taken):
            numbers[name] = numbers.get(name, 1) + 1
            free = f"{name}#{numbers[name]}"
        seen.add(free)
        result.append(free)
    return tuple(result)
