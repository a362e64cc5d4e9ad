"""Real USD assets: written and read back, or refused for a reason."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from pxr import Usd, UsdSkel

from animeme.errors import InputError
from animeme_stages.write.usdz import package_usdz
from support.usd_kit import (
    FORMAT,
    ICT,
    SHARED,
    assert_played,
    digest,
    joints,
    line,
    new_findings,
    write,
)

# The page says of each file what this test finds.
PAGE = Path(__file__).parents[1] / "docs" / "assets-usd.md"
ROW = re.compile(
    r"^\| `(?P<name>[^`]+\.usd\w?)` \| (?P<meshes>\d+) \| (?P<shapes>\d+) \| (?P<end>.*) \|$"
)


def said_of(name: str) -> re.Match[str]:
    """The page's row about a file."""
    rows = map(ROW.match, PAGE.read_text("utf-8").splitlines())
    (row,) = [row for row in rows if row and row["name"] == name]
    return row


def digests(source: Path) -> dict[str, str]:
    """Of the asset and of everything beside it: other layers, textures."""
    return {path.name: digest(path) for path in source.parent.iterdir() if path.is_file()}


def real_assets() -> list[Any]:
    params = []
    files = sorted((SHARED / "usd").glob("*.usd*")) if SHARED.exists() else []
    for path in [*files, ICT]:
        absent = pytest.mark.skipif(not path.exists(), reason=f"{path} is not here")
        params.append(pytest.param(path, marks=absent, id=path.name))
    return params


@pytest.mark.parametrize("source", real_assets())
def test_real_assets_are_written_or_refused(tmp_path: Path, source: Path) -> None:
    before_all, row = digests(source), said_of(source.name)
    if row["end"] != "animated":
        code = row["end"].partition("`")[2].partition("`")[0]
        with pytest.raises(InputError, match=code):
            FORMAT.load(source)
        assert digests(source) == before_all
        return
    character = FORMAT.load(source)
    assert (len(character.meshes), len(character.shapes)) == (
        int(row["meshes"]),
        int(row["shapes"]),
    )
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
    package = tmp_path / "real.usdz"
    assert package_usdz(character, target, {"en": tmp_path / "en" / "real.usdc"}, package) == ()
    assert new_findings(source, package) == set()
    assert digests(source) == before_all


@pytest.mark.skipif(not ICT.exists(), reason=f"{ICT} is not here")
def test_ict_head() -> None:
    character = FORMAT.load(ICT)
    assert len(character.meshes) == 12
    assert len(character.shapes) == 23
    assert character.animations == ("Action",)
