"""Every real asset that can speak, and every coding of a mesh, in Blender and UsdSkel."""

from __future__ import annotations

from pathlib import Path
from zlib import crc32

import numpy as np
import pytest
from pxr import Usd

from animeme import registry
from animeme.contracts import LineAnimation
from animeme.curves import CurveSet, Floats, reduce_keys
from animeme.rig import Character
from support.blender import Request, Values, answers, shape_keys
from support.jobs import SAMPLE
from support.judges import node_answer, usd_weights
from test_blender import chosen, random_times_s
from test_real_assets import FOUND, REFUSED

pytestmark = pytest.mark.slow
TOLERANCE = 1e-4
MAX_ERROR = 0.002
LINES = ("first", "second")
# What Blender cannot import, whoever wrote it: what it says of the source, or that it finds no
# shape key there; and why.
BLIND = {
    # KHR_draco_mesh_compression and KHR_mesh_quantization it knows, this one it does not.
    "meshopt": "Extension EXT_meshopt_compression is not available",
    # Its shapes have offsets of normals and inbetweens only; Blender wants offsets of points.
    "openusd_blendshapesWithNormals.usda": "",
}
SPEAKING = [path for path in FOUND if path.name not in REFUSED]
USD = [path for path in SPEAKING if ".usd" in path.suffix]
GLTF = [path for path in SPEAKING if path not in USD]


def motion(shapes: tuple[str, ...], name: str) -> CurveSet:
    """At 60 keys a second, each shape on a path of its own within 0 and 1; it stops at 2.5 s."""
    random = np.random.default_rng(crc32(name.encode()))
    times_s = np.arange(181) / 60
    paces_hz, starts = random.uniform(0.2, 3, len(shapes)), random.uniform(0, 7, len(shapes))
    moved_s = np.minimum(times_s, 2.5)[:, None]
    swings = 0.5 + 0.5 * np.sin(2 * np.pi * paces_hz * moved_s + starts)
    return CurveSet(times_s, shapes, swings)


class Spoken:
    """An asset with two lines, whose keys were reduced as a run does, and when to look at them."""

    def __init__(self, source: Path, folder: Path) -> None:
        self.format = registry.format_of(source)
        self.character: Character = self.format.load(source)
        self.meant = {name: motion(self.character.shapes, name) for name in LINES}
        self.written = {name: reduce_keys(meant, MAX_ERROR) for name, meant in self.meant.items()}
        assert all(len(kept.times_s) < 160 for kept in self.written.values())
        self.at_s = {name: random_times_s(f"{source.name}/{name}") for name in LINES}
        self.file = folder / "en" / f"out{self.format.output_suffix(source)}"
        lines = [LineAnimation(name, "en", self.written[name], 3.0) for name in LINES]
        self.format.write(self.character, lines, self.file)

    def require(self, name: str, shape: str, played: Floats | list[float]) -> None:
        """A judge plays of a shape what was written, and what was meant but for dropped keys."""
        at_s, canonical = np.array(self.at_s[name]), self.character.canonical[shape]
        for curves, tolerance in (
            (self.written[name], TOLERANCE),
            (self.meant[name], TOLERANCE + MAX_ERROR),
        ):
            wanted = curves.sample(at_s)[:, curves.names.index(canonical)]
            np.testing.assert_allclose(played, wanted, rtol=0, atol=tolerance, err_msg=shape)

    def usd_layers(self, folder: Path) -> dict[str, Path]:
        """For each line a layer over the assembly that chooses it."""
        assembly = folder / "assembly.usda"
        self.format.write_assembly(self.character, {"en": self.file}, assembly)
        return {
            name: chosen(
                assembly, folder / f"{name}.usda", dialogueLanguage="en", dialogueLine=name
            )
            for name in LINES
        }


def require_nodes(spoken: Spoken, name: str, found: Values) -> None:
    """Blender shows every node of a glTF character as written."""
    assert found.keys() == {mesh.path for mesh in spoken.character.meshes}
    for mesh in spoken.character.meshes:
        for index, shape in enumerate(mesh.shapes):
            spoken.require(name, shape, found[mesh.path][str(index)])


@pytest.mark.skipif(not FOUND, reason="no ../shared with real assets beside this checkout")
@pytest.mark.parametrize("source", GLTF, ids=lambda path: path.name)
def test_blender_plays_every_real_gltf(source: Path, tmp_path: Path) -> None:
    spoken = Spoken(source, tmp_path)
    requests = [Request(str(spoken.file), spoken.at_s[name], 24.0, name) for name in LINES]
    for name, found in zip(LINES, shape_keys(requests, tmp_path), strict=True):
        require_nodes(spoken, name, found)


@pytest.mark.skipif(not FOUND, reason="no ../shared with real assets beside this checkout")
@pytest.mark.parametrize("source", USD, ids=lambda path: path.name)
def test_usdskel_and_blender_play_every_real_usd(source: Path, tmp_path: Path) -> None:
    spoken = Spoken(source, tmp_path)
    layers = spoken.usd_layers(tmp_path)
    requests = []
    for name, layer in layers.items():
        stage = Usd.Stage.Open(str(layer))
        weights = usd_weights(stage, np.array(spoken.at_s[name]))
        assert len(weights) == len(spoken.character.meshes)
        for shapes in weights.values():
            for shape, played in shapes.items():
                spoken.require(name, shape, played)
        rate_hz = stage.GetTimeCodesPerSecond()
        requests.append(Request(str(layer), spoken.at_s[name], rate_hz))
    if source.name in BLIND:
        bare = Request(str(source), [0.0], 24.0)
        keys = [set().union(*found.values()) for found in shape_keys([bare, *requests], tmp_path)]
        assert keys == [set()] * 3
        return
    for name, found in zip(layers, shape_keys(requests, tmp_path), strict=True):
        for mesh in spoken.character.meshes:
            prim = mesh.path.rpartition("/")[2]
            # Its importer numbers a name that another prim has already.
            shapes_found = found[prim if prim in found else f"{prim}.001"]
            for shape in mesh.shapes:
                spoken.require(name, shape, shapes_found[shape])


@pytest.mark.parametrize("how", ["quantize", "draco", "meshopt"])
def test_blender_plays_compressed_meshes(how: str, tmp_path: Path) -> None:
    source = tmp_path / f"{how}.glb"
    node_answer("@gltf-transform/core", "compress.mjs", str(SAMPLE / "crab.glb"), str(source), how)
    spoken = Spoken(source, tmp_path)
    requests = [Request(str(spoken.file), spoken.at_s[name], 24.0, name) for name in LINES]
    if how in BLIND:
        bare = Request(str(source), [0.0], 24.0)
        said = answers([bare, *requests], tmp_path)
        assert all(BLIND[how] in answer for answer in said if isinstance(answer, str))
        assert [type(answer) for answer in said] == [str] * 3
        return
    for name, found in zip(LINES, shape_keys(requests, tmp_path), strict=True):
        require_nodes(spoken, name, found)
