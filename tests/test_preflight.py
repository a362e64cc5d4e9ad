"""What looking at a job depends on."""

from __future__ import annotations

import shutil
from importlib import resources
from importlib.metadata import EntryPoint
from pathlib import Path

import pytest

from animeme import registry
from animeme.job import read_job
from animeme.preflight import prepare
from animeme.registry import Plugin
from animeme.store.memory import memory
from support.jobs import SmallJob, small_job


def code_beside(job: SmallJob, version: str, group: str, monkeypatch: pytest.MonkeyPatch) -> str:
    """The code that a job depends on where a studio's plug-in is installed in some version."""
    installed = registry.plugins
    studio = Plugin(group, "studio", "studio", version, EntryPoint("studio", "studio:It", group))

    def plugins(asked: str) -> dict[str, Plugin]:
        return {**installed(asked), **({"studio": studio} if asked == group else {})}

    with monkeypatch.context() as patch, memory(None) as remembered:
        patch.setattr(registry, "plugins", plugins)
        return prepare(read_job(job.write()), remembered).code


@pytest.mark.parametrize(
    ("group", "counts"),
    [
        (registry.MODELS, False),
        (registry.ALIGNERS, False),
        (registry.STAGES, False),
        (registry.DELIVERY_CHECKS, False),
        (registry.FORMATS, True),  # its files might be the studio's
    ],
)
def test_a_job_depends_on_plugins_that_it_may_use(
    group: str, counts: bool, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    job = small_job(tmp_path)
    found = {code_beside(job, version, group, monkeypatch) for version in ("1", "1", "2")}
    assert len(found) == (2 if counts else 1)


def test_a_model_in_a_file_may_be_any_models(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    job = small_job(tmp_path)
    shipped = resources.files("animeme_stages.synthesize").joinpath("dam_grid.json")
    with resources.as_file(shipped) as path:
        shutil.copy(path, job.folder / "model.json")
    job.sections["model"] = {"file": "model.json"}
    found = {code_beside(job, version, registry.MODELS, monkeypatch) for version in ("1", "2")}
    assert len(found) == 2
