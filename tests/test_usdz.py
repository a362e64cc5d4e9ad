"""One file with every language: what is in it, and that it plays wherever it is taken."""

from __future__ import annotations

import zipfile
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import soundfile
from pxr import Sdf, Usd, UsdMedia, UsdShade, UsdUtils

from animeme.contracts import LineAnimation
from animeme.findings import Finding
from animeme_stages.write import usdz
from animeme_stages.write.usdz import package_usdz
from support.jobs import Capture, run_inline, small_job
from support.usd_kit import (
    FORMAT,
    SHAPES,
    assert_played,
    digest,
    hero,
    line,
    new_findings,
    select,
)

LANGUAGES = ("de", "en")
Lines = dict[tuple[str, str], LineAnimation]


def recording(path: Path) -> Path:
    path.parent.mkdir(parents=True, exist_ok=True)
    soundfile.write(path, np.zeros(800), 16000)
    return path


def packed(source: Path, folder: Path, suffix: str = ".wav") -> tuple[Lines, tuple[Finding, ...]]:
    """Write two lines in two languages, and pack them to ``hero.usdz``."""
    character = FORMAT.load(source)
    lines: Lines = {}
    files = {}
    for i, language in enumerate(LANGUAGES):
        for k, name in enumerate("ab"):
            audio = recording(folder / "voice" / language / f"{name}{suffix}")
            spoken = line(name, SHAPES[:2], language=language, seed=10 * i + k)
            lines[language, name] = replace(spoken, audio=audio)
        files[language] = folder / "out" / language / source.with_suffix(".usdc").name
        FORMAT.write(character, [lines[language, name] for name in "ab"], files[language])
    assembly = folder / "out" / "hero.usda"
    FORMAT.write_assembly(character, files, assembly)
    return lines, package_usdz(character, assembly, files, folder / "out" / "hero.usdz")


def taken_away(folder: Path) -> Path:
    """The package, alone in another place."""
    target = folder / "elsewhere" / "hero.usdz"
    target.parent.mkdir()
    (folder / "out" / "hero.usdz").rename(target)
    for name in ("in", "out", "voice"):
        (folder / name).rename(folder / f"gone-{name}")
    return target


def require_plays(package: Path, lines: Lines) -> None:
    stage = Usd.Stage.Open(str(package))
    assert stage.GetCompositionErrors() == []
    for (language, name), spoken in lines.items():
        select(stage, dialogueLanguage=language)
        select(stage, dialogueLine=name)
        assert_played(stage, "/hero/face", spoken.curves)
        (sound,) = [p for p in stage.Traverse() if p.IsA(UsdMedia.SpatialAudio)]
        heard = UsdMedia.SpatialAudio(sound).GetFilePathAttr().Get()
        assert heard.resolvedPath == f"{package}[sound/{language}/{name}.wav]"


@pytest.mark.parametrize("suffix", [".usda", ".usdc", ".usdz"])
def test_it_plays_alone_wherever_it_is(tmp_path: Path, suffix: str) -> None:
    source = hero(tmp_path / "in" / "hero.usdc")
    if suffix == ".usda":
        source = hero(tmp_path / "in" / "hero.usda")
    if suffix == ".usdz":
        source = tmp_path / "in" / "hero.usdz"
        assert UsdUtils.CreateNewUsdzPackage(str(tmp_path / "in" / "hero.usdc"), str(source))
    before = digest(source)
    lines, remarks = packed(source, tmp_path)
    assert remarks == ()
    assert digest(source) == before
    assert new_findings(source, tmp_path / "out" / "hero.usdz") == set()
    require_plays(taken_away(tmp_path), lines)


def test_what_belongs_to_the_source_comes_along_untouched(tmp_path: Path) -> None:
    source = hero(tmp_path / "in" / "hero.usda")
    hero(tmp_path / "in" / "parts" / "prop.usdc")
    stage = Usd.Stage.Open(str(source))
    stage.DefinePrim("/hero/prop").GetReferences().AddReference("./parts/prop.usdc")
    shader = UsdShade.Shader.Define(stage, "/hero/look")
    for name in ("skin.png", "skin.tga", "missing.png"):
        shader.CreateInput(name.replace(".", "_"), Sdf.ValueTypeNames.Asset).Set(f"./maps/{name}")
    outside = tmp_path / "elsewhere.png"
    shader.CreateInput("outside", Sdf.ValueTypeNames.Asset).Set(str(outside))
    stage.Save()
    (tmp_path / "in" / "maps").mkdir()
    for file in (tmp_path / "in/maps/skin.png", tmp_path / "in/maps/skin.tga", outside):
        file.write_bytes(b"colours")
    _, remarks = packed(source, tmp_path)
    assert {(r.code, r.message.partition(" ")[0]) for r in remarks} == {
        ("usdz-file-left-out", "maps/skin.tga"),
        ("usdz-file-left-out", "maps/missing.png"),
        ("usdz-file-left-out", f"{outside.parent.name}/elsewhere.png"),
    }
    with zipfile.ZipFile(tmp_path / "out" / "hero.usdz") as package:
        names = package.namelist()
        for name in ("hero.usda", "parts/prop.usdc", "maps/skin.png"):
            assert package.read(f"source/{name}") == (tmp_path / "in" / name).read_bytes()
    assert names[0] == "hero.usda"
    assert not any(str(tmp_path.name) in name for name in names)


def test_sounds_that_no_package_may_hold_are_left_out_and_said(tmp_path: Path) -> None:
    source = hero(tmp_path / "in" / "hero.usda")
    _, remarks = packed(source, tmp_path, ".flac")
    assert {remark.message.partition(" ")[0] for remark in remarks} == {
        f"{language}/{name}.flac" for language in LANGUAGES for name in "ab"
    }
    assert new_findings(source, tmp_path / "out" / "hero.usdz") == set()


def test_the_container_is_as_specified_and_repeats(tmp_path: Path) -> None:
    digests = set()
    for number in range(2):
        folder = tmp_path / str(number)
        packed(hero(folder / "in" / "hero.usda"), folder)
        file = folder / "out" / "hero.usdz"
        data = file.read_bytes()
        with zipfile.ZipFile(file) as package:
            assert package.testzip() is None
            for info in package.infolist():
                assert info.compress_type == zipfile.ZIP_STORED
                header = info.header_offset
                lengths = [
                    int.from_bytes(data[header + at : header + at + 2], "little") for at in (26, 28)
                ]
                assert (header + 30 + sum(lengths)) % 64 == 0
                assert info.date_time == (1980, 1, 1, 0, 0, 0)
        digests.add(digest(file))
    assert len(digests) == 1


def test_two_gigabytes_are_too_much(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(usdz, "MOST_BYTES", 1000)
    with pytest.raises(usdz.InputError, match="usdz-too-large"):
        packed(hero(tmp_path / "in" / "hero.usda"), tmp_path)
    left = [path.name for path in (tmp_path / "out").iterdir()]
    assert sorted(left) == ["de", "en", "hero.usda"]


def test_a_job_packs_its_languages(tmp_path: Path, capsys: Capture) -> None:
    job = small_job(tmp_path)
    job.timed_line("en/boat")
    job.timed_line("de/boat")
    job.asset("crab.usdc")
    crab = job.sections["characters.crab"]
    crab |= {"asset": ["crab.glb", "crab.usdc"], "usdz": True}
    assert run_inline(capsys, job).code == 0
    assert "crab.usdz" in job.report()["outputs"]
    assert job.animations("crab.usdz") >= {"boat"}
    before = digest(job.output / "crab.usdz")
    assert run_inline(capsys, job).code == 0
    assert digest(job.output / "crab.usdz") == before
    with zipfile.ZipFile(job.output / "crab.usdz") as package:
        assert "sound/de/boat.wav" in package.namelist()
    # Broken, then mended.
    crab["layout"] = "per-line"
    run_inline(capsys, job).says("characters.crab.usdz", "cannot be packed")
    del crab["layout"]
    crab["asset"] = "crab.glb"
    run_inline(capsys, job).says("characters.crab.usdz", "no asset of the character is USD")
    del crab["usdz"]
    assert run_inline(capsys, job).code == 0
