"""Fixtures that several test files share; the expensive ones are made once per process."""

from __future__ import annotations

import shutil
from collections.abc import Iterator
from pathlib import Path

import pytest

import animeme
from animeme.findings import RunReport
from support.bad_input import BAD, GOOD
from support.good_delivery import Good, deliver, tiny_head
from support.jobs import SmallJob, small_job

ROOT = Path(__file__).parents[1]
SAMPLE = ROOT / "sample_assets"
LANGUAGES = ("de", "en", "es")


@pytest.fixture(scope="session", autouse=True)
def _session_cache(tmp_path_factory: pytest.TempPathFactory) -> Iterator[None]:
    """No test meets results of the user's runs."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("ANIMEME_CACHE", str(tmp_path_factory.mktemp("cache")))
        yield


@pytest.fixture(autouse=True)
def cache(tmp_path_factory: pytest.TempPathFactory, monkeypatch: pytest.MonkeyPatch) -> Path:
    """The user's cache folder: no test meets results of another."""
    folder = tmp_path_factory.mktemp("cache")
    monkeypatch.setenv("ANIMEME_CACHE", str(folder))
    return folder


@pytest.fixture
def importable(monkeypatch: pytest.MonkeyPatch) -> None:
    """Let processes that are started import `support`."""
    monkeypatch.setenv("PYTHONPATH", str(Path(__file__).parent))


@pytest.fixture(scope="session")
def shared() -> Path:
    """The folder of real data and assets; skips where it is absent."""
    folder = ROOT.parent / "shared"
    if not (folder / "assets").is_dir():
        pytest.skip("no ../shared with real data and assets beside this checkout")
    return folder


@pytest.fixture(scope="session")
def warm_cache(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A cache folder after a run of the job that `job` gives."""
    folder = tmp_path_factory.mktemp("warm")
    job = small_job(folder / "job", GOOD, BAD)
    animeme.run(job.write(), cache=folder / "cache", executor="inline")
    return folder / "cache"


@pytest.fixture
def job(tmp_path: Path, cache: Path, warm_cache: Path) -> SmallJob:
    """A crab with a line that stays sound and one to be broken.

    The user has run it before: what is sound is known, so that each of hundreds of tests takes no
    more than what it changes.
    """
    shutil.copytree(warm_cache, cache, dirs_exist_ok=True)
    return small_job(tmp_path / "job", GOOD, BAD)


@pytest.fixture
def wide(monkeypatch: pytest.MonkeyPatch) -> None:
    """A terminal so wide that no table breaks its lines."""
    monkeypatch.setenv("COLUMNS", "300")


@pytest.fixture(scope="session")
def sample_run(tmp_path_factory: pytest.TempPathFactory) -> tuple[RunReport, Path]:
    """The sample job, run once: its report and its output folder."""
    output = tmp_path_factory.mktemp("sample") / "out"
    return animeme.run(SAMPLE / "job.toml", output=output), output


@pytest.fixture(scope="session")
def tiny(tmp_path_factory: pytest.TempPathFactory) -> Good:
    """What a head of one triangle says, delivered: quick to judge, and to break."""
    folder = tmp_path_factory.mktemp("tiny")
    return deliver(folder / "job", tiny_head(folder / "hero.glb"))


@pytest.fixture(scope="session")
def ict_run(
    tmp_path_factory: pytest.TempPathFactory, shared: Path
) -> tuple[RunReport, Path, list[Path]]:
    """Fifty real lines on the ICT head in both formats: report, output, the two sources."""
    folder = tmp_path_factory.mktemp("ict")
    lines = sorted((shared / "data" / "grid-s1" / "lines").glob("*.flac"))[:50]
    (folder / "dialogue" / "en").mkdir(parents=True)
    for line in lines:
        for file in (line, line.with_suffix(".txt")):
            shutil.copyfile(file, folder / "dialogue" / "en" / file.name)
    sources = [
        shared / "assets" / "ict" / f"ict_multimesh_speech{suffix}" for suffix in (".glb", ".usdc")
    ]
    (folder / "job.toml").write_text(
        '[job]\nname = "ict"\n[dialogue]\nroot = "dialogue"\n[characters.ict]\n'
        f"asset = {[str(source) for source in sources]}\n",
        encoding="utf-8",
    )
    output = folder / "out"
    return animeme.run(folder / "job.toml", output=output), output, sources
