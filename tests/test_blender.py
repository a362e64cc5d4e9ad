"""What Blender plays of our files, against what independent readers say is in them."""

from __future__ import annotations

from pathlib import Path
from typing import Any
from zlib import crc32

import numpy as np
import pytest
from pxr import Usd, UsdUtils

from animeme.contracts import LineAnimation
from animeme.curves import CurveSet
from animeme.findings import RunReport
from conftest import LANGUAGES
from support.blender import Request, Values, shape_keys
from support.gltf_build import document_of
from support.judges import gltf_weights, usd_weights
from support.usd_kit import FORMAT, SHAPES, hero

pytestmark = pytest.mark.slow
LINES = ("boat", "count", "five", "moon", "think", "welcome")
TOLERANCE = 1e-4


def random_times_s(key: str) -> list[float]:
    times_s: list[float] = np.sort(
        np.random.default_rng(crc32(key.encode())).uniform(0, 3, 20)
    ).tolist()
    return times_s


def chosen(assembly: Path, target: Path, **variants: str) -> Path:
    """A layer over `assembly` that chooses variants, as an artist would."""
    stage = Usd.Stage.CreateNew(str(target))
    stage.GetRootLayer().subLayerPaths.append(str(assembly))
    UsdUtils.CopyLayerMetadata(
        Usd.Stage.Open(str(assembly)).GetRootLayer(), stage.GetRootLayer(), True
    )
    host = stage.GetDefaultPrim() or stage.GetPseudoRoot().GetChildren()[0]
    for name, variant in variants.items():
        host.GetVariantSet(name).SetVariantSelection(variant)
    stage.Save()
    return target


def require_agree(found: Values, expected: dict[str, dict[str, np.ndarray]]) -> int:
    """Each shape that the reader tells of has the value that Blender shows; how many moved."""
    moved = 0
    for mesh, shapes in expected.items():
        for shape, weights in shapes.items():
            # Its importer numbers a name that another prim has already.
            played = found[mesh if mesh in found else f"{mesh}.001"][shape]
            np.testing.assert_allclose(played, weights, atol=TOLERANCE, err_msg=shape)
            moved += bool(np.ptp(weights) > 0.05)
    return moved


@pytest.mark.parametrize("character", ["ada", "crab"])
def test_usd_plays_in_blender(
    sample_run: tuple[RunReport, Path], tmp_path: Path, character: str
) -> None:
    _, output = sample_run
    requests, expected = [], []
    for language in LANGUAGES:
        for name in LINES:
            variants = {"dialogueLanguage": language, "dialogueLine": name}
            file = tmp_path / f"{language}-{name}.usda"
            chosen(output / f"{character}.usda", file, **variants)
            stage = Usd.Stage.Open(str(file))
            times_s = random_times_s(f"{language}/{name}")
            requests.append(Request(str(file), times_s, stage.GetTimeCodesPerSecond()))
            expected.append(usd_weights(stage, np.array(times_s)))
    for found, wanted in zip(shape_keys(requests, tmp_path), expected, strict=True):
        assert require_agree(found, wanted) > 2


@pytest.mark.parametrize("language", LANGUAGES)
def test_glb_plays_in_blender(
    sample_run: tuple[RunReport, Path], tmp_path: Path, language: str
) -> None:
    _, output = sample_run
    file = output / language / "ada.glb"
    times_s = {name: random_times_s(name) for name in LINES}
    requests = [Request(str(file), times_s[name], 24.0, name) for name in LINES]
    for name, found in zip(LINES, shape_keys(requests, tmp_path), strict=True):
        wanted = by_index(file, gltf_weights(file, name, np.array(times_s[name])))
        assert require_agree(found, wanted) > 2


def by_index(file: Path, weights: dict[str, dict[str, np.ndarray]]) -> dict[str, Any]:
    """Weights by node and target, instead of by their names."""
    root = document_of(file)
    indices = {node.get("name"): index for index, node in enumerate(root["nodes"])}
    return {
        f"/nodes/{indices[name]}": {str(i): found for i, found in enumerate(shapes.values())}
        for name, shapes in weights.items()
    }


@pytest.mark.parametrize("rate_hz", [24.0, 30.0, 60.0, 23.976])
def test_blender_agrees_at_any_rate(tmp_path: Path, rate_hz: float) -> None:
    """With weights at arbitrary times, far from Blender's frames."""
    source = hero(tmp_path / "hero.usda", old=["browUp"], weights=[0.25])
    stage = Usd.Stage.Open(str(source))
    stage.SetTimeCodesPerSecond(rate_hz)
    stage.SetFramesPerSecond(rate_hz)
    stage.Save()
    random = np.random.default_rng(5)
    keys_s = np.sort(random.uniform(0, 3, 40))
    curves = CurveSet(keys_s, tuple(SHAPES[:2]), random.random((40, 2)))
    target = tmp_path / "out.usda"
    FORMAT.write(FORMAT.load(source), [LineAnimation("a", "en", curves, 3.0)], target)
    times_s = random_times_s("rate")
    (found,) = shape_keys([Request(str(target), times_s, rate_hz)], tmp_path)
    wanted = usd_weights(Usd.Stage.Open(str(target)), np.array(times_s))
    assert require_agree(found, wanted) == 2
