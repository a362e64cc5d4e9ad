"""Recordings in USD: heard with the line that is chosen, found by relative path."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import soundfile
from pxr import Usd, UsdMedia, UsdSkel

import animeme
from animeme.findings import RunReport
from conftest import LANGUAGES, SAMPLE
from support.jobs import small_job
from support.judges import select as select_default
from support.usd_kit import (
    FORMAT,
    SHAPES,
    add_mesh,
    add_skeleton,
    hero,
    line,
    new_findings,
    new_stage,
    select,
    write,
)


def recording(path: Path) -> Path:
    path.parent.mkdir(parents=True, exist_ok=True)
    soundfile.write(path, np.zeros(800), 16000)
    return path


def sounds(stage: Usd.Stage) -> list[UsdMedia.SpatialAudio]:
    prims = [prim for prim in stage.Traverse() if prim.IsA(UsdMedia.SpatialAudio)]
    return [UsdMedia.SpatialAudio(prim) for prim in prims]


def require_heard(stage: Usd.Stage, file: Path) -> None:
    """One sound, and it is `file`, from time 0, as a flat sound."""
    (sound,) = sounds(stage)
    asset = sound.GetFilePathAttr().Get()
    assert Path(asset.resolvedPath) == file.resolve()
    assert not Path(asset.path).is_absolute()
    assert sound.GetStartTimeAttr().Get() == 0.0
    assert sound.GetAuralModeAttr().Get() == UsdMedia.Tokens.nonSpatial
    assert sound.GetPlaybackModeAttr().Get() == UsdMedia.Tokens.onceFromStart


def test_each_line_is_heard_in_its_variant(tmp_path: Path) -> None:
    source = hero(tmp_path / "in" / "hero.usda")
    character = FORMAT.load(source)
    files, spoken = {}, {}
    for i, language in enumerate(("en", "de")):
        lines = []
        for k, name in enumerate(("sound", "b c")):
            audio = recording(tmp_path / "voice @1" / language / f"{name}.wav")
            lines.append(
                replace(line(name, SHAPES, language=language, seed=10 * i + k), audio=audio)
            )
            spoken[language, name] = audio
        files[language] = tmp_path / "out" / language / "hero.usda"
        FORMAT.write(character, lines, files[language])
        assert new_findings(source, files[language]) == set()
        assert str(tmp_path) not in files[language].read_text("utf-8")
    target = tmp_path / "out" / "hero.usda"
    FORMAT.write_assembly(character, files, target)
    assert FORMAT.harm(character, target) == []
    assert new_findings(source, target) == set()
    stage = Usd.Stage.Open(str(target))
    # "sound" is the name of the prim that plays: the line of that name gives way.
    for variant, name in {"sound_1": "sound", "b_c": "b c"}.items():
        for language in ("en", "de"):
            select(stage, dialogueLanguage=language)
            select(stage, dialogueLine=variant)
            require_heard(stage, spoken[language, name])


def test_a_line_without_recording_is_silent(tmp_path: Path) -> None:
    source = hero(tmp_path / "hero.usda")
    audio = recording(tmp_path / "a.wav")
    heard = replace(line("a", SHAPES), audio=audio)
    _, stage = write(source, tmp_path / "out.usdc", heard, line("b", SHAPES, seed=1))
    require_heard(stage, audio)
    select(stage, dialogueLine="b")
    assert sounds(stage) == []


def test_a_line_is_heard_once_however_many_prims_speak_it(tmp_path: Path) -> None:
    stage = new_stage(tmp_path / "hero.usda", default=False)
    for path in ("/hero", "/pet"):
        UsdSkel.Root.Define(stage, path)
        add_skeleton(stage, f"{path}/sound")
        add_mesh(stage, f"{path}/face", f"{path}/sound", SHAPES)
    stage.Save()
    audio = recording(tmp_path / "a.wav")
    spoken = replace(line("a", SHAPES), audio=audio)
    _, out = write(tmp_path / "hero.usda", tmp_path / "out.usdc", spoken)
    require_heard(out, audio)


@pytest.mark.parametrize("language", LANGUAGES)
def test_a_run_refers_to_its_recordings(sample_run: tuple[RunReport, Path], language: str) -> None:
    _, output = sample_run
    stage = Usd.Stage.Open(str(output / "ada.usda"))
    for name in ("boat", "five"):
        select_default(stage, dialogueLanguage=language, dialogueLine=name)
        require_heard(stage, SAMPLE / "dialogue" / language / f"{name}.wav")


def test_what_was_spoken_is_heard(tmp_path: Path) -> None:
    pytest.importorskip("espeakng_loader")
    job = small_job(tmp_path)
    job.asset("crab.usdc")
    job.line("en/boat").unlink()
    job.sections["characters.crab"]["asset"] = "crab.usdc"
    job.sections["dialogue"]["speak"] = True
    assert animeme.run(job.write()).exit_code == 0
    stage = Usd.Stage.Open(str(job.output / "crab.usda"))
    require_heard(stage, job.output / "speech" / "en" / "boat.wav")
