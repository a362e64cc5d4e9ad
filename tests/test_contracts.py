"""Every plug-in of ours passes the suites that a studio's has to pass."""

from __future__ import annotations

from pathlib import Path

import pytest

from animeme import registry, testing
from animeme.errors import InputError
from animeme_stages.ingest.audio import read_speech
from conftest import SAMPLE
from support.motion import captured

# Models that work without training.
SHIPPED = ("bigram", "cohen-massaro", "dam")


@pytest.mark.parametrize("name", sorted(registry.plugins(registry.MODELS)))
def test_models(name: str) -> None:
    kind = registry.model_type(name)
    testing.check_fit(kind, captured(lines=12))
    if name in SHIPPED:
        testing.check_model(kind.default())
    else:
        with pytest.raises(InputError, match=f"animeme train DATASET --model {name}"):
            kind.default()


@pytest.mark.parametrize("name", sorted(registry.plugins(registry.ALIGNERS)))
@pytest.mark.parametrize("language", ["en", "de", "es"])
def test_aligners(name: str, language: str) -> None:
    folder = SAMPLE / "dialogue" / language
    text = (folder / "boat.txt").read_text(encoding="utf-8").strip()
    speech = read_speech(folder / "boat.wav")
    testing.check_aligner(registry.aligner(name), speech, text, language=language)


@pytest.mark.parametrize("asset", ["ada.glb", "ada.usdc", "crab.glb", "crab.usdc"])
def test_formats(asset: str, tmp_path: Path) -> None:
    path = SAMPLE / asset
    testing.check_format(registry.format_of(path), path, tmp_path)


@pytest.mark.parametrize("group", registry.SUBJECTS)
def test_checks(group: str) -> None:
    found = registry.checks(group)
    assert found
    for check in found:
        testing.check_check(check)


def test_no_two_checks_share_an_id() -> None:
    ids = [check.id for group in registry.SUBJECTS for check in registry.checks(group)]
    assert len(set(ids)) == len(ids)
    assert set(ids) == {name for group in registry.SUBJECTS for name in registry.plugins(group)}
