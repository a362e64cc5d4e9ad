"""What looking at a job depends on, and what it does first."""

from __future__ import annotations

import shutil
from dataclasses import replace
from importlib import resources
from pathlib import Path

import pytest

from animeme import preflight, registry
from animeme.errors import JobError
from animeme.executors.inline import InlineExecutor
from animeme.job import read_job
from animeme.registry import Plugin
from animeme.store.memory import memory
from support.jobs import SmallJob, small_job


def depends(job: SmallJob, group: str, name: str, monkeypatch: pytest.MonkeyPatch) -> bool:
    """Whether what is found out about a job depends on the version of a plug-in."""
    installed, codes = registry.plugins, set()
    for version in ("1", "2"):

        def plugins(asked: str, version: str = version) -> dict[str, Plugin]:
            found = dict(installed(asked))
            if asked == group:
                found[name] = replace(found[name], version=version)
            return found

        with monkeypatch.context() as patch, memory(None) as remembered:
            patch.setattr(registry, "plugins", plugins)
            codes.add(preflight.prepare(read_job(job.write()), remembered).code)
    return len(codes) == 2


@pytest.mark.parametrize(
    ("group", "name", "counts"),
    [
        (registry.MODELS, "dam", True),
        (registry.MODELS, "mmm", False),
        (registry.MODELS, "cohen-massaro", False),
        (registry.ALIGNERS, "pocketsphinx", True),
        (registry.FORMATS, "usd", True),
        (registry.LINE_CHECKS, "mouth-moves", True),
        (registry.REPORTS, "junit", True),
        (registry.STAGES, "bind-rig", True),
        (registry.STAGES, "film", False),
        (registry.DELIVERY_CHECKS, "khronos", False),
        (registry.PROFILES, "strict", False),
    ],
)
def test_a_job_depends_on_plugins_that_have_a_say_in_it(
    group: str, name: str, counts: bool, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    assert depends(small_job(tmp_path), group, name, monkeypatch) == counts


def test_a_characters_own_model_counts(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    job = small_job(tmp_path)
    job.sections["characters.crab.model"] = {"name": "cohen-massaro"}
    assert depends(job, registry.MODELS, "cohen-massaro", monkeypatch)


def test_of_a_model_in_a_file_every_model_may_say_that_it_reads_it(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    job = small_job(tmp_path)
    shipped = resources.files("animeme_stages.synthesize").joinpath("dam_grid.json")
    with resources.as_file(shipped) as path:
        shutil.copy(path, job.folder / "model.json")
    job.sections["model"] = {"file": "model.json"}
    assert depends(job, registry.MODELS, "mmm", monkeypatch)


def test_a_job_that_is_wrong_is_refused_before_its_assets_are_opened_here(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    opened: list[object] = []
    monkeypatch.setattr(preflight, "try_asset", opened.append)
    job = small_job(tmp_path)
    job.sections["align"] = {"aligner": "sphinx"}
    with memory(None) as remembered:
        form = read_job(job.write(), check=False)
        with pytest.raises(JobError, match="there is no aligner"):
            preflight.prepare(form, remembered, InlineExecutor())
        assert not opened
        job.sections["align"] = {"aligner": "pocketsphinx"}
        preflight.prepare(read_job(job.write(), check=False), remembered, InlineExecutor())
    assert len(opened) == 1
