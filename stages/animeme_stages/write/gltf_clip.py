"""Files of animation alone: a small GLB per line, to play on a character that is there already.

Players find what to move by name. So the file has the nodes that a line drives, with their names
and the names of their morph targets, on meshes of one point that nobody sees.
"""

from __future__ import annotations

import re
from abc import ABC, abstractmethod
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import Any, ClassVar

from animeme.contracts import LineAnimation, Verify, unverified
from animeme.curves import CurveSet
from animeme.errors import InputError
from animeme.files import atomic_path
from animeme.rig import Character, MeshShapes
from animeme_stages.ingest.glb import Container, open_container
from animeme_stages.ingest.gltf import character_in, load_gltf
from animeme_stages.ingest.gltf_data import external_files, weight_animations
from animeme_stages.ingest.gltf_document import marked
from animeme_stages.write.glb import pack_glb
from animeme_stages.write.gltf_lines import Appended, animated, drives, free_name, node_of
from animeme_stages.write.gltf_source import source_of
from animeme_stages.write.json_splice import Encoded, dumps, dumps_members

# One point at the origin: an accessor without a buffer view is all zeros.
_POINT = {
    "componentType": 5126,
    "count": 1,
    "type": "VEC3",
    "min": [0.0, 0.0, 0.0],
    "max": [0.0, 0.0, 0.0],
}


class AnimationFile(ABC):
    """What the formats of files without a character have in common.

    Attributes:
        layout: what the job file calls it.
    """

    name: ClassVar[str]
    layout: ClassVar[str]
    suffixes: ClassVar[tuple[str, ...]]
    assembly_suffix: ClassVar[str] = ""

    def output_suffix(self, source: Path) -> str:
        """Always the same."""
        return self.suffixes[0]

    def load(self, path: Path, *, within: Path | None = None) -> Character:
        """The character of a glTF; see `animeme.contracts.Format`."""
        return load_gltf(path)

    def for_layout(self, layout: str, character: Character) -> AnimationFile:
        """Itself, for its own layout.

        Raises:
            InputError: ``layout-unsupported``.
        """
        if layout == self.layout:
            return self
        raise InputError(
            "layout-unsupported",
            f"'{self.name}' has no layout but '{self.layout}'",
            place=str(character.source),
            action=f'Use layout = "{self.layout}".',
        )

    def companions(self, character: Character) -> dict[str, Path]:
        """None: buffers and images stay with the character."""
        return {}

    def inputs(self, character: Character) -> tuple[Path, ...]:
        """Buffers and images of the character; see `animeme.contracts.Format`."""
        return external_files(character.source)

    def write_assembly(
        self,
        character: Character,
        by_language: Mapping[str, Path],
        target: Path,
        *,
        verify: Verify = unverified,
    ) -> tuple[Path, ...]:
        """Write nothing: each line stays a file of its own."""
        return ()

    @abstractmethod
    def write(
        self,
        character: Character,
        lines: Sequence[LineAnimation],
        target: Path,
        *,
        verify: Verify = unverified,
    ) -> tuple[Path, ...]:
        """See `animeme.contracts.Format`."""

    @abstractmethod
    def read_animations(self, path: Path) -> dict[str, CurveSet]:
        """See `animeme.contracts.Format`."""

    @abstractmethod
    def harm(self, character: Character, output: Path) -> list[str]:
        """What in `output` does not fit the character; it holds nothing of its source."""

    def strip(self, path: Path, target: Path) -> tuple[str, ...]:
        """Refuse: without its animation nothing is left.

        Raises:
            InputError: always ``strip-whole``.
        """
        raise all_ours(path)


def all_ours(path: Path) -> InputError:
    """The error for a file that has nothing but what animeme wrote."""
    return InputError(
        "strip-whole",
        "is a file of animation alone, animeme's from beginning to end",
        place=str(path),
        action="Delete it; the character's own file was never changed.",
    )


def file_json(
    layout: str,
    *,
    binds: Mapping[str, Any] | None = None,
    shapes: Sequence[str] | None = None,
    **members: Any,
) -> dict[str, Any]:
    """The root of such a file.

    Args:
        layout: of the file.
        binds: shapes and gains that an expression moves, for who reads it without the avatar.
        shapes: all that its lines move.
        members: of the document.
    """
    note = {"layout": layout, "binds": binds, "shapes": shapes}
    mark = marked({key: value for key, value in note.items() if value is not None})
    return {"asset": {"version": "2.0", "generator": "animeme", "extras": mark}, **members}


def save(target: Path, root: Mapping[str, Any], data: bytes, verify: Verify) -> tuple[Path, ...]:
    """Write a GLB of a document and its one buffer."""
    with atomic_path(target) as scratch:
        scratch.write_bytes(pack_glb(dumps_members(root), data))
        verify(scratch)
    return (target,)


class GltfClip(AnimationFile):
    """Layout ``animation-only``."""

    name: ClassVar[str] = "gltf-clip"
    layout: ClassVar[str] = "animation-only"
    suffixes: ClassVar[tuple[str, ...]] = (".glb",)

    def write(
        self,
        character: Character,
        lines: Sequence[LineAnimation],
        target: Path,
        *,
        verify: Verify = unverified,
    ) -> tuple[Path, ...]:
        """Write a GLB of the nodes that `lines` drive, and one animation per line."""
        source = source_of(character.source).given
        appended = Appended(1, 0)
        taken: set[str] = set()
        animations = []
        for line in lines:
            if drives(line, character):
                taken.add(name := free_name(line, taken))
                animations.append(animated(line, name, character, appended))
        driven = {c["target"]["node"] for a in animations for c in a["channels"]}
        used = {node_of(mesh): mesh for mesh in character.meshes if node_of(mesh) in driven}
        made = _points if source.is_short else _points.__wrapped__
        points = made(source, tuple(used.items()))
        for animation in animations:
            for channel in animation["channels"]:
                channel["target"]["node"] = points.places[channel["target"]["node"]]
        size = len(appended.data)
        root = file_json(
            self.layout,
            scene=0,
            scenes=[{"nodes": [*range(points.count)]}],
            nodes=points.nodes,
            meshes=points.meshes,
            accessors=[_POINT, *appended.accessors],
            bufferViews=[{"buffer": 0, "byteLength": size}],
            buffers=[{"byteLength": size}],
            animations=animations,
        )
        if not animations:
            root = file_json(self.layout)
        return save(target, root, bytes(appended.data), verify)

    def read_animations(self, path: Path) -> dict[str, CurveSet]:
        """Weight curves of every animation in the file."""
        container = open_container(path)
        if not container.json.get("animations"):
            return {}
        return weight_animations(container, character_in(container))

    def harm(self, character: Character, output: Path) -> list[str]:
        """Nodes and morph targets that the character does not have."""
        container = open_container(output)
        if not container.json.get("nodes"):
            return []
        nodes = source_of(character.source).given.json["nodes"]
        known = {
            (name, mesh.shapes)
            for mesh in character.meshes
            for name in (mesh.name, f"mesh_{nodes[node_of(mesh)]['mesh']}")
        }
        return [
            f"the character has no node '{mesh.name}' with these morph targets"
            for mesh in character_in(container).meshes
            if (mesh.name, mesh.shapes) not in known
        ]


@dataclass(frozen=True)
class _Points:
    """What stands for the character: JSON of nodes and of meshes, and where its own nodes are."""

    nodes: Encoded
    meshes: Encoded
    count: int
    places: Mapping[int, int]


@lru_cache(maxsize=4)
def _points(container: Container, driven: tuple[tuple[int, MeshShapes], ...]) -> _Points:
    """Nodes that stand for the character's, and the meshes that they share as it does.

    Most lines of a character drive the same ones.

    three.js numbers names that several nodes have, in the order of the scene. For its numbers to
    be the same here, nodes of such names are here as well, empty.
    """
    source, used = container.json, dict(driven)
    nodes: list[dict[str, Any]] = []
    meshes: list[dict[str, Any]] = []
    shared: dict[tuple[int, tuple[str, ...]], int] = {}
    places: dict[int, int] = {}
    names = {_three_name(source["nodes"][index].get("name")) for index in used}
    names |= {
        _three_name(source["meshes"][source["nodes"][index]["mesh"]].get("name")) for index in used
    }
    for index in _in_order(source):
        node = source["nodes"][index]
        named: dict[str, Any] = {"name": str(node["name"])} if node.get("name") else {}
        if index in used:
            # A mesh without names may have others on each node: those of a VRM's binds.
            key = (node["mesh"], used[index].shapes)
            if key not in shared:
                shared[key] = len(meshes)
                meshes.append(_point_mesh(node["mesh"], source, used[index]))
            weights = {"weights": list(used[index].rest)} if any(used[index].rest) else {}
            places[index] = len(nodes)
            nodes.append({**named, "mesh": shared[key], **weights})
        elif named and _three_name(node["name"]) in names:
            nodes.append(named)
    return _Points(Encoded(dumps(nodes)), Encoded(dumps(meshes)), len(nodes), places)


def _point_mesh(index: int, source: Mapping[str, Any], mesh: MeshShapes) -> dict[str, Any]:
    theirs = source["meshes"][index]
    point: dict[str, Any] = {"attributes": {"POSITION": 0}, "mode": 0}
    point["targets"] = [{"POSITION": 0}] * len(mesh.shapes)
    return {
        "name": theirs.get("name") or f"mesh_{index}",  # as three.js calls it
        "primitives": [point] * len(theirs["primitives"]),
        "extras": {"targetNames": list(mesh.shapes)},
    }


def _three_name(name: Any) -> str:
    """A node's name as three.js has it."""
    return re.sub(r"[\[\].:/]", "", re.sub(r"\s", "_", str(name or "")))


def _in_order(source: Mapping[str, Any]) -> Iterator[int]:
    """All nodes: those of the scene from its roots down, then the rest."""
    nodes = source["nodes"]
    try:
        roots = [*reversed(source["scenes"][source.get("scene", 0)]["nodes"])]
    except (IndexError, KeyError, TypeError):
        roots = []  # a library of meshes without a scene
    pending = [*range(len(nodes) - 1, -1, -1), *roots]
    seen: set[int] = set()
    while pending:
        index = pending.pop()
        if isinstance(index, int) and 0 <= index < len(nodes) and index not in seen:
            seen.add(index)
            yield index
            children = nodes[index].get("children")
            pending += reversed(children) if isinstance(children, list) else []
