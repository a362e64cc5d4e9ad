"""VRM Animation (``.vrma``): a line as weights of expressions, for any VRM avatar.

``VRMC_vrm_animation`` 1.0: each expression is a node, whose translation along x is its weight.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, ClassVar

import numpy as np
import scipy  # its parts load when they are first used
from numpy.typing import NDArray

from animeme.contracts import LineAnimation, Verify, unverified
from animeme.curves import CurveSet
from animeme.errors import InputError
from animeme.rig import Character, Drive
from animeme_stages.ingest.glb import open_container
from animeme_stages.ingest.gltf_data import Buffers
from animeme_stages.ingest.gltf_document import MALFORMED, mark_of, marked
from animeme_stages.write.gltf_clip import AnimationFile, file_json, save
from animeme_stages.write.gltf_lines import Appended, as_floats, free_name, note_of

_EXTENSION = "VRMC_vrm_animation"
_MOUTH = ("aa", "ih", "ou", "ee", "oh")
# VRM 1.0's presets, without those of the gaze, which an animation may not have.
_PRESETS = frozenset(
    (
        *_MOUTH, "happy", "angry", "sad", "relaxed", "surprised", "neutral", "blink", "blinkLeft",
        "blinkRight",
    )
)  # fmt: skip
# What VRM 0.x calls them.
_OLD = {
    "A": "aa", "I": "ih", "U": "ou", "E": "ee", "O": "oh", "joy": "happy", "sorrow": "sad",
    "fun": "relaxed", "blink_l": "blinkLeft", "blink_r": "blinkRight",
}  # fmt: skip
_GAZE = frozenset(f"look{way}".lower() for way in ("up", "down", "left", "right"))
# How far the expressions may stay from a line's weights before it is another line.
_CLOSE = 1e-3


class Vrma(AnimationFile):
    """Layout ``vrma``."""

    name: ClassVar[str] = "vrma"
    layout: ClassVar[str] = "vrma"
    suffixes: ClassVar[tuple[str, ...]] = (".vrma",)

    def for_layout(self, layout: str, character: Character) -> AnimationFile:
        """Itself, for characters that have expressions of a VRM avatar.

        Raises:
            InputError: ``layout-unsupported``.
        """
        if layout == self.layout and not expressions_of(character):
            raise InputError(
                "layout-unsupported",
                "is no VRM with expressions of the mouth, and has no shapes of their names "
                f"({', '.join(_MOUTH)}), so no .vrma can say what it does",
                place=str(character.source),
                action='Use layout = "animation-only", or deliver the character as .vrm.',
            )
        return super().for_layout(layout, character)

    def write(
        self,
        character: Character,
        lines: Sequence[LineAnimation],
        target: Path,
        *,
        verify: Verify = unverified,
    ) -> tuple[Path, ...]:
        """Write `lines` as weights of expressions; players take the first.

        Raises:
            InputError: ``vrma-inexpressible``: a line moves what no expression moves.
        """
        found = expressions_of(character)
        solved = [(line, *_solved(line, found, character)) for line in lines]
        names = [name for name in found if any(name in used for _, used, _ in solved)]
        bones, human = _bones(open_container(character.source).json, len(names))
        appended = Appended(0, 0)
        taken: set[str] = set()
        animations = []
        for line, used, weights in solved:
            taken.add(name := free_name(line, taken))
            animation = _animation(line, [names.index(n) for n in used], weights, appended)
            animations += [{"name": name, **animation}] if used else []
        size = len(appended.data)
        nodes = [*({"name": name} for name in names), *bones]
        extension = {"specVersion": "1.0", **human, "expressions": _declared(names)}
        inner = {child for bone in bones for child in bone.get("children", [])}
        binds = {name: [[d.shape, d.gain] for d in found[name]] for name in names}
        shapes = [*dict.fromkeys(shape for line in lines for shape in line.curves.names)]
        root = file_json(
            self.layout,
            binds=binds,
            shapes=shapes,
            scene=0,
            scenes=[{"nodes": [i for i in range(len(nodes)) if i not in inner]}],
            nodes=nodes,
            accessors=appended.accessors,
            bufferViews=[{"buffer": 0, "byteLength": size}],
            buffers=[{"byteLength": size}],
            animations=animations,
            extensionsUsed=[_EXTENSION],
            extensions={_EXTENSION: extension},
        )
        if not animations:
            root = file_json(self.layout)
        return save(target, root, bytes(appended.data), verify)

    def read_animations(self, path: Path) -> dict[str, CurveSet]:
        """Weights of the shapes that the expressions of every animation come to.

        The binds are taken from our note: a .vrma itself does not know them.
        """
        container = open_container(path)
        root, buffers = container.json, Buffers(container)
        declared = root.get("extensions", {}).get(_EXTENSION, {}).get("expressions", {})
        nodes = {e["node"]: n for kind in declared.values() for n, e in kind.items()}
        note = mark_of(root["asset"]) or {}
        binds, shapes = note.get("binds", {}), note.get("shapes", [])
        result = {}
        for animation in root.get("animations", []):
            total: dict[str, NDArray[np.float64]] = {}
            times_s = np.zeros(1)
            for channel in animation["channels"]:
                name = nodes.get(channel["target"]["node"])
                if name is None or channel["target"]["path"] != "translation":
                    continue
                sampler = animation["samplers"][channel["sampler"]]
                times_s = buffers.floats(sampler["input"])[:, 0].astype(np.float64)
                weight = buffers.floats(sampler["output"])[:, 0].astype(np.float64)
                for shape, gain in binds.get(name, [[name, 1.0]]):
                    total[shape] = total.get(shape, 0.0) + gain * weight
            rest = np.zeros(len(times_s))
            names = tuple(dict.fromkeys([*shapes, *total]))
            columns = np.array([total.get(name, rest) for name in names]).T
            weights = columns.reshape(len(times_s), len(names))
            result[str(animation.get("name"))] = CurveSet(times_s, names, weights)
        return result

    def harm(self, character: Character, output: Path) -> list[str]:
        """Nothing: a .vrma has nothing of the character's to change."""
        open_container(output)
        return []


def expressions_of(character: Character) -> dict[str, tuple[Drive, ...]]:
    """The character's expressions by their names in VRM 1.0; {} if none moves the mouth.

    Those that a VRM declares; of another character, its shapes, if some have a preset's name.
    """
    own = {_OLD.get(n, n): d for n, d in character.expressions.items() if n.lower() not in _GAZE}
    if not own:
        own = {_OLD.get(name, name): (Drive(name),) for name in character.shapes}
    return own if set(_MOUTH) & own.keys() else {}


def _solved(
    line: LineAnimation, found: Mapping[str, tuple[Drive, ...]], character: Character
) -> tuple[list[str], NDArray[np.float64]]:
    """The expressions that make a line's shapes, and their weights (T, expressions)."""
    shapes = line.curves.names
    if strange := set(shapes) - set(character.shapes):
        raise ValueError(f"{line.name}: no such shapes: {', '.join(sorted(strange))}")
    # Only what moves nothing else may be used.
    used = [name for name, drives in found.items() if {d.shape for d in drives} <= {*shapes}]
    mixed = np.array(
        [
            [{d.shape: d.gain for d in found[name]}.get(shape, 0.0) for name in used]
            for shape in shapes
        ]
    ).reshape(len(shapes), len(used))
    rows = line.curves.weights
    weights = (
        np.array([scipy.optimize.nnls(mixed, row)[0] for row in rows]) if used and shapes else None
    )
    weights = np.zeros((len(rows), len(used))) if weights is None else np.minimum(weights, 1.0)
    error = np.abs(weights @ mixed.T - rows).max(axis=0, initial=0.0)
    if (error > _CLOSE).any():
        worst = int(np.argmax(error))
        raise InputError(
            "vrma-inexpressible",
            f"no expression of the avatar's gives '{shapes[worst]}' what line '{line.name}' needs: "
            f"it is off by up to {error[worst]:.2f}",
            place=str(character.source),
            action="Use a rig that drives what its expressions are bound to, or another layout.",
        )
    return used, weights


def _animation(
    line: LineAnimation, nodes: Sequence[int], weights: NDArray[np.float64], appended: Appended
) -> dict[str, Any]:
    times_s, values = as_floats(CurveSet(line.curves.times_s, tuple(map(str, nodes)), weights))
    key = appended.floats(times_s, bounds=True) if nodes else -1
    samplers: list[dict[str, Any]] = []
    channels: list[dict[str, Any]] = []
    for column, node in enumerate(nodes):
        places = np.zeros((len(values), 3), np.float32)
        places[:, 0] = values[:, column]
        output = appended.floats(places, kind="VEC3")
        channels.append({"sampler": len(samplers), "target": {"node": node, "path": "translation"}})
        samplers.append({"input": key, "interpolation": "LINEAR", "output": output})
    return {"channels": channels, "samplers": samplers, "extras": marked(note_of(line))}


def _declared(names: Sequence[str]) -> dict[str, dict[str, dict[str, int]]]:
    kinds: dict[str, dict[str, dict[str, int]]] = {}
    for node, name in enumerate(names):
        kind = "preset" if name in _PRESETS else "custom"
        kinds.setdefault(kind, {})[name] = {"node": node}
    return kinds


def _bones(root: Mapping[str, Any], first: int) -> tuple[list[dict[str, Any]], dict[str, Any]]:
    """The skeleton of a VRM 1.0 at rest, which readers of whole bodies ask for; else nothing.

    Args:
        root: the character's document.
        first: index of the first node of the skeleton in the new file.
    """
    try:
        bones = {
            name: int(bone["node"])
            for name, bone in root["extensions"]["VRMC_vrm"]["humanoid"]["humanBones"].items()
            if name not in ("leftEye", "rightEye")
        }
        parents = {c: i for i, node in enumerate(root["nodes"]) for c in node.get("children", [])}
        kept: set[int] = set()
        for node in bones.values():
            while node not in kept and 0 <= node < len(root["nodes"]):
                kept.add(node)
                node = parents.get(node, -1)
        places = {node: first + place for place, node in enumerate(sorted(kept))}
        made = [_bone(root["nodes"][node], places) for node in sorted(kept)]
        human = {name: {"node": places[node]} for name, node in bones.items()}
    except MALFORMED:
        return [], {}
    return made, {"humanoid": {"humanBones": human}}


def _bone(node: Mapping[str, Any], places: Mapping[int, int]) -> dict[str, Any]:
    made = {
        key: node[key]
        for key in ("name", "translation", "rotation", "scale", "matrix")
        if key in node
    }
    children = [places[child] for child in node.get("children", []) if child in places]
    return made | ({"children": children} if children else {})
