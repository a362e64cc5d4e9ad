"""Weights of glTF animations, read by a library that the product does not read them with."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pygltflib
from numpy.typing import NDArray


class Animated:
    """The linear weight channels of a GLB without sparse weights."""

    def __init__(self, path: Path) -> None:
        loaded = pygltflib.GLTF2().load(str(path))
        assert loaded is not None, f"{path} is not a glTF file"
        self.gltf: Any = loaded

    def weights_at(self, animation: str, time_s: float) -> dict[str, float]:
        """Shape → weight; of meshes that share a shape the last one's."""
        found: dict[str, float] = {}
        (chosen,) = (a for a in self.gltf.animations if a.name == animation)
        for channel in chosen.channels:
            if channel.target.path != "weights":
                continue
            sampler = chosen.samplers[channel.sampler]
            assert sampler.interpolation in (None, "LINEAR")
            mesh = self.gltf.meshes[self.gltf.nodes[channel.target.node].mesh]
            names = mesh.extras["targetNames"]
            times_s = self._floats(sampler.input)
            values = self._floats(sampler.output).reshape(len(times_s), len(names))
            for name, column in zip(names, values.T, strict=True):
                found[name] = float(np.interp(time_s, times_s, column))
        return found

    def _floats(self, index: int) -> NDArray[np.float64]:
        accessor = self.gltf.accessors[index]
        view = self.gltf.bufferViews[accessor.bufferView]
        start = (view.byteOffset or 0) + (accessor.byteOffset or 0)
        data = self.gltf.binary_blob()
        return np.frombuffer(data, "<f4", accessor.count, start).astype(np.float64)
