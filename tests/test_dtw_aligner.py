"""A second aligner, which knows nothing of the first, comes in through its entry point."""

from __future__ import annotations

import json
import os
import subprocess
from collections.abc import Iterator
from importlib.metadata import distributions
from pathlib import Path

import numpy as np
import pytest

from animeme import registry, testing
from animeme.contracts import Aligner, Anchor, Speech
from support.jobs import CONSOLE, PATIENCE_S, small_job
from support.plugins import install

SAMPLE = Path(__file__).parents[1] / "sample_assets"
# The sample's lines were spoken by espeak-ng; warped onto themselves they are almost exact.
CLOSE_S = 0.04


@pytest.fixture(scope="module")
def site(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The plug-in as pip would have installed it."""
    pytest.importorskip("espeakng_loader")
    return install("dtw_aligner", tmp_path_factory.mktemp("site"))


@pytest.fixture
def dtw(site: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Aligner]:
    """The aligner, found by its entry point."""
    monkeypatch.syspath_prepend(site)
    assert "animeme-dtw-aligner" in {found.name for found in distributions(path=[str(site)])}
    caches = (registry._installed, registry.plugins, registry.aligner)
    for cached in caches:
        cached.cache_clear()
    yield registry.aligner("dtw")
    for cached in caches:
        cached.cache_clear()


def line(key: str) -> tuple[Speech, str]:
    file = SAMPLE / "dialogue" / f"{key}.wav"
    speech: Speech = registry.stage("read-speech")(file)
    return speech, file.with_suffix(".txt").read_text(encoding="utf-8").strip()


@pytest.mark.parametrize("tag", ["en", "de", "es"])
def test_it_passes_the_contract_suite(dtw: Aligner, tag: str) -> None:
    speech, text = line(f"{tag}/boat")
    testing.check_aligner(dtw, speech, text, language=tag)


@pytest.mark.parametrize("tag", ["en", "de", "es"])
def test_it_agrees_with_the_default_aligner(dtw: Aligner, tag: str) -> None:
    speech, text = line(f"{tag}/boat")
    mine = dtw.align(speech, text, language=tag)
    other = registry.aligner("pocketsphinx").align(speech, text, language=tag).track
    assert [word.text for word in mine.track.words] == [word.text for word in other.words]
    pairs = zip(mine.track.words, other.words, strict=True)
    assert np.median([abs(a.start_s - b.start_s) for a, b in pairs]) < CLOSE_S
    assert mine.findings == ()
    wrong = dtw.align(speech, line(f"{tag}/moon")[1], language=tag)
    assert mine.score is not None
    assert wrong.score is not None
    assert mine.score > 2 * wrong.score


def test_known_times_are_kept(dtw: Aligner) -> None:
    speech, text = line("en/boat")
    free = dtw.align(speech, text, language="en").track.words
    late = free[3].start_s + 0.25
    anchor = Anchor(*free[3].source, late, late + 0.3, 0.02)
    held = dtw.align(speech, text, language="en", anchors=[anchor]).track.words
    assert held[3].start_s >= late - 0.04
    assert held[3].start_s > free[3].start_s + 0.15


@pytest.mark.slow
def test_the_command_and_a_job_use_it(site: Path, tmp_path: Path) -> None:
    job = small_job(tmp_path, "en/boat")
    job.sections["align"] = {"aligner": "dtw"}
    audio = job.dialogue / "en" / "boat.wav"
    path = os.pathsep.join(filter(None, (str(site), os.environ.get("PYTHONPATH", ""))))
    for arguments in (
        ("align", audio, audio.with_suffix(".txt"), "--aligner", "dtw", "--json"),
        ("run", job.write(), "--workers", "1", "--json"),
    ):
        ran = subprocess.run(
            [CONSOLE, *map(str, arguments)],
            env={**os.environ, "PYTHONPATH": path},
            capture_output=True,
            text=True,
            timeout=PATIENCE_S,
        )
        assert ran.returncode == 0, ran.stderr
        assert json.loads(ran.stdout)
    assert job.statuses() == {"en/boat": "ok"}
    aligned = json.loads((job.output / "alignments" / "en" / "boat.json").read_text("utf-8"))
    assert {phone["score"] for phone in aligned["phones"]} == {None}  # not PocketSphinx's
