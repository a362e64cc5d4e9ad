"""Fifty real lines on a real head: twelve meshes that share their shapes, in both formats."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from pxr import Usd

from animeme.files import sha256
from animeme.findings import RunReport
from animeme.rig import canonical_names
from animeme_stages.ingest.glb import open_container
from animeme_stages.write.gltf_harm import harm
from animeme_stages.write.gltf_source import source_of
from support.judges import gltf_weights, khronos_findings, select, usd_weights
from support.usd_kit import new_findings

Run = tuple[RunReport, Path, list[Path]]


def test_fifty_lines_ok(ict_run: Run) -> None:
    report, _, _ = ict_run
    assert report.exit_code == 0
    assert report.count("ok") == 50


def test_all_twelve_meshes_are_driven_alike_in_both_formats(ict_run: Run) -> None:
    _, output, _ = ict_run
    stage = Usd.Stage.Open(str(output / "en" / "ict.usdc"))
    names = [a["name"] for a in open_container(output / "en" / "ict.glb").json["animations"]]
    assert len(names) == 50
    random = np.random.default_rng(11)
    for line in names[::7]:
        at_s = random.uniform(0, 3, 20)
        gltf = gltf_weights(output / "en" / "ict.glb", line, at_s)
        select(stage, dialogueLine=line)
        usd = usd_weights(stage, at_s)
        assert len(gltf) == len(usd) == 12
        canonical = canonical_names([list(shapes) for shapes in usd.values()])
        for mesh, shapes in usd.items():
            assert np.ptp(gltf[mesh]["jawOpen"]) > 0.1
            assert len(shapes) == 23
            for stored, weights in shapes.items():
                expected = gltf[mesh][canonical[stored]]
                np.testing.assert_allclose(weights, expected, atol=0.003)


def test_nothing_is_lost(ict_run: Run) -> None:
    _, output, sources = ict_run
    assert harm(source_of(sources[0]), open_container(output / "en" / "ict.glb")) == []


@pytest.mark.parametrize("name", ["en/ict.usdc", "ict.usda"])
def test_usd_validation_finds_nothing_new(ict_run: Run, name: str) -> None:
    _, output, sources = ict_run
    assert new_findings(sources[1], output / name) == set()


def test_khronos_validator_finds_nothing_new(ict_run: Run) -> None:
    _, output, sources = ict_run
    target = output / "en" / "ict.glb"
    found = khronos_findings(sources[0], target)
    assert not found[target] - found[sources[0]]


def test_sources_are_untouched(ict_run: Run) -> None:
    _, _, sources = ict_run
    assert [sha256(source) for source in sources] == [
        "657ab138408382e40e039d16c3375e543a58299bf9e005f2a57475eff6b09663",
        "1ca0f18efe543b79254dcbb7c4d4f44ae593e37ed2b6a19ee89ee2cf35e61329",
    ]
