"""glTF's JSON made safe to walk: what is a list is a list, and indices point at something.

Only what animeme itself follows is looked at; the rest of the document is none of its business.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

from animeme_stages.ingest.glb import Container, unreadable

# Top-level arrays of objects that are read, appended to, or whose files come along.
_ARRAYS = ("accessors", "animations", "bufferViews", "buffers", "images", "meshes", "nodes")
_MARK = "animeme"
# What comes of following JSON that is not as it should be; `int` of an infinite number among it.
MALFORMED = (ArithmeticError, AttributeError, IndexError, KeyError, TypeError, ValueError)


def require_sound(container: Container) -> None:
    """Refuse a document whose structure cannot be followed.

    Raises:
        InputError: names the first broken place as a JSON pointer.
    """
    for pointer, problem in _problems(container.json):
        raise unreadable(container.path, f"is broken at {pointer}: {problem}")


def mark_of(item: Mapping[str, Any]) -> Mapping[str, Any] | None:
    """The note that we leave in what is ours; None in everybody else's."""
    extras = item.get("extras")
    note = extras.get(_MARK) if isinstance(extras, dict) else None
    return note if isinstance(note, dict) else None


def marked(note: Mapping[str, Any]) -> dict[str, Any]:
    """Extras that make an animation, or a buffer view, ours."""
    return {_MARK: dict(note)}


def line_of(animation: Mapping[str, Any]) -> tuple[str, str] | None:
    """Line and language of an animation of ours, None for somebody else's."""
    note = mark_of(animation)
    return (str(note.get("line")), str(note.get("language"))) if note is not None else None


def _problems(root: Mapping[str, Any]) -> Iterator[tuple[str, str]]:
    for name in _ARRAYS:
        yield from _objects(root, name, "")
    for index, mesh in enumerate(root.get("meshes", [])):
        yield from _mesh_problems(mesh, f"/meshes/{index}")
    for index, node in enumerate(root.get("nodes", [])):
        yield from _node_problems(node, root, f"/nodes/{index}")


def _objects(holder: Mapping[str, Any], name: str, pointer: str) -> Iterator[tuple[str, str]]:
    """Whether a member, if it is there, is a list of objects."""
    items = holder.get(name, [])
    if not isinstance(items, list):
        yield f"{pointer}/{name}", "not a list"
        return
    for index, item in enumerate(items):
        if not isinstance(item, dict):
            yield f"{pointer}/{name}/{index}", "not an object"


def _mesh_problems(mesh: Mapping[str, Any], pointer: str) -> Iterator[tuple[str, str]]:
    if "primitives" not in mesh:
        yield f"{pointer}/primitives", "missing"
    broken = list(_objects(mesh, "primitives", pointer))
    yield from broken
    if broken:
        return
    counts = set()
    for index, primitive in enumerate(mesh.get("primitives", [])):
        yield from _objects(primitive, "targets", f"{pointer}/primitives/{index}")
        targets = primitive.get("targets", [])
        counts.add(len(targets) if isinstance(targets, list) else 0)
    yield from _weight_problems(mesh, max(counts, default=0), pointer)


def _node_problems(
    node: Mapping[str, Any], root: Mapping[str, Any], pointer: str
) -> Iterator[tuple[str, str]]:
    if "mesh" not in node:
        return
    mesh, meshes = node["mesh"], root.get("meshes", [])
    if not isinstance(mesh, int) or isinstance(mesh, bool) or not 0 <= mesh < len(meshes):
        yield f"{pointer}/mesh", "points at no mesh"
        return
    yield from _weight_problems(node, target_count(meshes[mesh]), pointer)


def _weight_problems(
    holder: Mapping[str, Any], count: int, pointer: str
) -> Iterator[tuple[str, str]]:
    weights = holder.get("weights")
    if weights is None or not count:
        return
    if not isinstance(weights, list) or not all(map(_is_float32, weights)):
        yield f"{pointer}/weights", "not a list of numbers"
    elif weights and len(weights) != count:
        yield f"{pointer}/weights", f"{len(weights)} weights for {count} morph targets"


def _is_float32(value: Any) -> bool:
    number = isinstance(value, int | float) and not isinstance(value, bool)
    return number and abs(value) <= 3.4e38


def target_count(mesh: Mapping[str, Any]) -> int:
    """How many morph targets a mesh has."""
    return max((len(p.get("targets", [])) for p in mesh["primitives"]), default=0)
