"""Lines as glTF animations: channels, samplers, and the accessors and bytes behind them."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from dataclasses import dataclass, field
from itertools import chain, count
from typing import Any

import numpy as np
from numpy.typing import NDArray

from animeme.contracts import LineAnimation
from animeme.curves import CurveSet
from animeme.rig import Character, MeshShapes
from animeme_stages.ingest.glb import unreadable
from animeme_stages.ingest.gltf_data import Buffers
from animeme_stages.ingest.gltf_document import MALFORMED, marked

FLOAT = 5126


@dataclass
class Appended:
    """Accessors and bytes on their way into a file.

    Attributes:
        first_accessor: index of the first one.
        view: index of the buffer view that all of them are in.
        accessors, data: what was appended so far.
    """

    first_accessor: int
    view: int
    accessors: list[dict[str, Any]] = field(default_factory=list)
    data: bytearray = field(default_factory=bytearray)

    def floats(
        self, values: NDArray[np.float32], *, bounds: bool = False, kind: str = "SCALAR"
    ) -> int:
        """Append an accessor of floats and return its index.

        Args:
            values: shape (count,) or, for vectors, (count, components).
            bounds: say the smallest and the largest value.
            kind: glTF's accessor type.
        """
        array = np.ascontiguousarray(values, "<f4")
        rows = array.reshape(-1, array.shape[-1]) if kind != "SCALAR" else array.reshape(-1, 1)
        accessor: dict[str, Any] = {"bufferView": self.view, "byteOffset": len(self.data)}
        accessor |= {"componentType": FLOAT, "count": len(rows), "type": kind}
        if bounds:
            low, high = rows.min(axis=0), rows.max(axis=0)
            accessor |= {"min": [float(v) for v in low], "max": [float(v) for v in high]}
        self.data += array.tobytes()
        self.accessors.append(accessor)
        return self.first_accessor + len(self.accessors) - 1


def drives(line: LineAnimation, character: Character) -> bool:
    """Whether a line moves anything.

    Raises:
        ValueError: it has a curve for a shape that `character` lacks.
    """
    unknown = set(line.curves.names) - set(character.canonical.values())
    if unknown:
        raise ValueError(f"{character.source} has no shape {', '.join(sorted(unknown))}")
    return bool(line.curves.names)


def carried(
    animation: Mapping[str, Any], buffers: Buffers, appended: Appended, copies: dict[int, int]
) -> dict[str, Any]:
    """An animation of an earlier run of ours, with its data moved to `appended`.

    Args:
        animation: as it stands in the earlier file.
        buffers: of that file.
        appended: gets times and weights.
        copies: accessor there → accessor here; is added to.

    Raises:
        InputError: its data cannot be read.
    """

    def moved(index: int) -> int:
        if index not in copies:
            bounds = "min" in buffers.container.json["accessors"][index]
            copies[index] = appended.floats(buffers.floats(index), bounds=bounds)
        return copies[index]

    try:
        samplers = [
            {**sampler, "input": moved(sampler["input"]), "output": moved(sampler["output"])}
            for sampler in animation["samplers"]
        ]
    except MALFORMED as error:
        name = str(animation.get("name"))[:80]
        problem = f"its animation '{name}', of an earlier run, is broken ({error})"
        raise unreadable(buffers.container.path, problem) from error
    return {**animation, "samplers": samplers}


def animated(
    line: LineAnimation, name: str, character: Character, appended: Appended
) -> dict[str, Any]:
    """The glTF animation of one line, called `name`; its data goes to `appended`."""
    columns = {shape: index for index, shape in enumerate(line.curves.names)}
    times_s, weights = as_floats(line.curves)
    time_accessor = appended.floats(times_s, bounds=True)
    channels: list[dict[str, Any]] = []
    samplers: dict[tuple[Any, ...], int] = {}
    made: list[dict[str, Any]] = []
    for mesh in character.meshes:
        targets = tuple(columns.get(character.canonical[shape], -1) for shape in mesh.shapes)
        if max(targets) < 0:
            continue
        key = (targets, mesh.rest)
        if key not in samplers:
            samplers[key] = len(made)
            output = appended.floats(_mesh_weights(mesh, targets, weights))
            made.append({"input": time_accessor, "interpolation": "LINEAR", "output": output})
        target = {"node": node_of(mesh), "path": "weights"}
        channels.append({"sampler": samplers[key], "target": target})
    return {"name": name, "channels": channels, "samplers": made, "extras": marked(note_of(line))}


def node_of(mesh: MeshShapes) -> int:
    """Index of the node that `mesh` stands for."""
    return int(mesh.path.rpartition("/")[2])


def note_of(line: LineAnimation) -> dict[str, Any]:
    """What an animation says of its line."""
    note: dict[str, Any] = {
        "line": line.name,
        "language": line.language,
        "duration_s": line.duration_s,
    }
    if line.audio_start_s:
        note["audio_start_s"] = line.audio_start_s
    if line.events:
        note["events"] = [{"tag": e.tag, "time_s": e.time_s} for e in line.events]
    return note


def free_name(line: LineAnimation, taken: Collection[str]) -> str:
    """The line's name, with its language or a number where that name is taken."""
    candidates = chain(
        (line.name, f"{line.name}_{line.language}"),
        (f"{line.name}_{line.language}_{number}" for number in count(2)),
    )
    return next(name for name in candidates if name not in taken)


def as_floats(curves: CurveSet) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """Times and weights as float32; keys that coincide in float32 are one key."""
    times_s = curves.times_s.astype(np.float32)
    keep = np.append(True, np.diff(times_s) > 0)
    return times_s[keep], curves.weights[keep].astype(np.float32)


def _mesh_weights(
    mesh: MeshShapes, targets: tuple[int, ...], weights: NDArray[np.float32]
) -> NDArray[np.float32]:
    """All targets of a mesh per key, shape (T, targets); undriven ones at rest."""
    full = np.tile(np.array(mesh.rest, np.float32), (len(weights), 1))
    for column, source in enumerate(targets):
        if source >= 0:
            full[:, column] = weights[:, source]
    return full
