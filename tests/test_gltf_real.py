"""Real glTF assets: they speak and lose nothing, or are refused for a reason.

``docs/assets.md`` has these as a table.
"""

from __future__ import annotations

import shutil
from pathlib import Path
from urllib.parse import quote

import numpy as np
import pytest

import animeme
from animeme.errors import InputError
from support.gltf_build import document_of
from support.gltf_kit import FORMAT, animate, line, require_agreement, speech
from support.judges import three_weights

ROOT = Path(__file__).parents[1]
SHARED = ROOT.parent / "shared" / "assets"
SUFFIXES = (".glb", ".gltf", ".vrm", ".vrma")
REAL = sorted(p for p in SHARED.rglob("*") if p.suffix in SUFFIXES and p.is_file())
SAMPLES = sorted((ROOT / "sample_assets").glob("*.glb"))
# The first has no morph target at all; the second is an animation, not a character.
REFUSED = {
    "saturday06_Example.vrm": "asset-no-blendshapes",
    "test.vrma": "asset-format-unknown",
}
SPEAKING = [path for path in (*REAL, *SAMPLES) if path.name not in REFUSED]


@pytest.mark.skipif(not REAL, reason="../shared/assets is not here")
@pytest.mark.parametrize("source", REAL, ids=lambda path: path.relative_to(SHARED).as_posix())
def test_a_real_asset_speaks_and_loses_nothing(source: Path, tmp_path: Path) -> None:
    if source.name in REFUSED:
        with pytest.raises(InputError, match=REFUSED[source.name]):
            animeme.load_character(source)
        return
    shapes = FORMAT.load(source).shapes
    curves = speech(shapes[:: max(1, len(shapes) // 5)], seed=7)
    target = tmp_path / f"out{FORMAT.output_suffix(source)}"
    if source.suffix == ".gltf":
        target = tmp_path / quote(source.name)
    animate(source, target, curves)


@pytest.mark.skipif(not REAL, reason="../shared/assets is not here")
def test_the_documentation_lists_every_real_asset() -> None:
    text = (ROOT / "docs" / "assets.md").read_text(encoding="utf-8")
    rows = {row.split("|")[1].strip(" `"): row for row in text.splitlines() if row.startswith("|")}
    for source in REAL:
        row = rows[source.relative_to(SHARED).as_posix()]
        if source.name in REFUSED:
            assert REFUSED[source.name] in row
            continue
        character = FORMAT.load(source)
        counts = f"{len(character.meshes)} | {len(character.shapes)}"
        assert counts in row, f"{row} should have {counts}"


@pytest.mark.slow
@pytest.mark.parametrize("source", SPEAKING, ids=lambda path: path.name)
def test_three_js_plays_what_was_meant(source: Path, tmp_path: Path) -> None:
    character = FORMAT.load(source)
    lines = [line(speech(character.shapes, seed=seed), name) for seed, name in enumerate("ab")]
    target = tmp_path / source.name
    FORMAT.write(character, lines, target)
    clip = tmp_path / "clip.glb"
    FORMAT.for_layout("animation-only", character).write(character, lines, clip)
    found = FORMAT.read_animations(target)
    for spoken in lines:
        at_s = np.sort(np.random.default_rng(5).uniform(0, spoken.duration_s, 20))
        for played in (
            three_weights(target, spoken.name, at_s),
            three_weights(source, spoken.name, at_s, clip=clip),
        ):
            require_agreement(played, found[spoken.name], at_s, character)


@pytest.mark.slow
@pytest.mark.parametrize("source", SPEAKING, ids=lambda path: path.name)
def test_ten_runs_upon_runs_are_as_one(source: Path, tmp_path: Path) -> None:
    character = FORMAT.load(source)
    languages = [line(speech(character.shapes[:3], seed=i), f"line{i}") for i in range(3)]
    once = tmp_path / "once" / source.name
    FORMAT.write(character, languages, once)
    over = tmp_path / "over" / source.name
    FORMAT.write(character, languages[:1], over)
    for number in range(10):
        FORMAT.write(FORMAT.load(over), [languages[number % 3]], over)
    sizes = [
        sum(path.stat().st_size for path in file.parent.rglob("*") if path.is_file())
        for file in (once, over)
    ]
    assert abs(sizes[0] - sizes[1]) < 400  # names of folders and side-cars are in the JSON
    assert unmarked(once) == unmarked(over)
    FORMAT.strip(over, over)
    assert over.read_bytes() == source.read_bytes()
    shutil.rmtree(over.parent)


def unmarked(path: Path) -> list[dict[str, object]]:
    """Animations of a file without their extras, which name the file they were made from."""
    return [a | {"extras": None} for a in document_of(path)["animations"]]
