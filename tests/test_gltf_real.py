"""Real glTF assets: they speak and lose nothing, or are refused for a reason."""

from __future__ import annotations

from pathlib import Path
from urllib.parse import quote

import pytest

from animeme.errors import InputError
from support.gltf_kit import FORMAT, animate, speech

SHARED = Path(__file__).parents[2] / "shared" / "assets"
REAL = sorted(
    path
    for folder in ("gltf", "vrm")
    for path in (SHARED / folder).rglob("*")
    if path.suffix in (".glb", ".gltf", ".vrm", ".vrma")
)
# Neither has a single morph target.
REFUSED = {
    "saturday06_Example.vrm": "asset-no-blendshapes",
    "test.vrma": "asset-no-blendshapes",
}


@pytest.mark.skipif(not REAL, reason="../shared/assets is not here")
@pytest.mark.parametrize("source", REAL, ids=lambda path: path.relative_to(SHARED).as_posix())
def test_a_real_asset_speaks_and_loses_nothing(source: Path, tmp_path: Path) -> None:
    if source.name in REFUSED:
        with pytest.raises(InputError, match=REFUSED[source.name]):
            FORMAT.load(source)
        return
    shapes = FORMAT.load(source).shapes
    curves = speech(shapes[:: max(1, len(shapes) // 5)], seed=7)
    target = tmp_path / f"out{FORMAT.output_suffix(source)}"
    if source.suffix == ".gltf":
        target = tmp_path / quote(source.name)
    animate(source, target, curves)
