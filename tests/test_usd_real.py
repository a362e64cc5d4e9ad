"""Real USD assets: written and read back, or refused for a reason."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from pxr import Usd, UsdSkel

from animeme.errors import InputError
from support.usd_kit import (
    FORMAT,
    ICT,
    SHARED,
    assert_played,
    joints,
    line,
    write,
)

REFUSED = {
    "mayausd_HIK_Export.usda": "asset-no-blendshapes",
    "openusd_populate.usda": "asset-no-blendshapes",
    "tinyusdz_inbetween-blendshape-001.usda": "asset-no-blendshapes",
    "usdwg_CesiumMan.usdz": "asset-no-blendshapes",
}


def real_assets() -> list[Any]:
    params = []
    files = sorted((SHARED / "usd").glob("*.usd*")) if SHARED.exists() else []
    for path in [*files, ICT]:
        absent = pytest.mark.skipif(not path.exists(), reason=f"{path} is not here")
        params.append(pytest.param(path, marks=absent, id=path.name))
    return params


@pytest.mark.parametrize("source", real_assets())
def test_real_assets_are_written_or_refused(tmp_path: Path, source: Path) -> None:
    if code := REFUSED.get(source.name):
        with pytest.raises(InputError, match=code):
            FORMAT.load(source)
        return
    character = FORMAT.load(source)
    spoken = line("hello", character.shapes)
    _, out = write(source, tmp_path / "en" / "real.usdc", spoken)
    for mesh in character.meshes:
        assert_played(out, mesh.path, spoken.curves, **dict(character.canonical))
    before = Usd.Stage.Open(str(source))
    for prim in before.Traverse():
        if prim.IsA(UsdSkel.Skeleton):
            path = str(prim.GetPath())
            np.testing.assert_array_equal(joints(out, path), joints(before, path))
    read = FORMAT.read_animations(tmp_path / "en" / "real.usdc")["hello"]
    assert set(read.names) == set(character.shapes)
    target = tmp_path / "real.usda"
    FORMAT.write_assembly(character, {"en": tmp_path / "en" / "real.usdc"}, target)
    assert FORMAT.harm(character, target) == []
    for mesh in character.meshes:
        assert_played(
            Usd.Stage.Open(str(target)), mesh.path, spoken.curves, **dict(character.canonical)
        )


@pytest.mark.skipif(not ICT.exists(), reason=f"{ICT} is not here")
def test_ict_head() -> None:
    character = FORMAT.load(ICT)
    assert len(character.meshes) == 12
    assert len(character.shapes) == 23
    assert character.animations == ("Action",)
