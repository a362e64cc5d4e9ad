"""Broken models and rigs: refused before anything is written."""

from __future__ import annotations

import json
import os
import pickle
from typing import Any

import pytest

from animeme import load_model
from support.bad_input import expect_refused, expect_success
from support.jobs import SAMPLE, Capture, SmallJob, run_inline


class _Bomb:
    """A pickle that leaves a trace when it is loaded."""

    def __reduce__(self) -> tuple[Any, ...]:
        return os.mkdir, ("exploded",)


def _model_text(**changes: Any) -> str:
    return json.dumps({**load_model("cohen-massaro").to_document(), **changes})


BAD_MODELS = (
    pytest.param(_model_text()[:2000].encode(), ("model.file",), id="truncated"),
    pytest.param(b"", ("model.file",), id="empty"),
    pytest.param(b"[]", ("not an object",), id="list"),
    pytest.param(
        _model_text(schema="animeme.model/2").encode(),
        ("animeme.model/2", "newer animeme"),
        id="future-version",
    ),
    pytest.param(
        _model_text(schema="animeme.rig/1").encode(), ("animeme.rig/1", "right kind"), id="a-rig"
    ),
    pytest.param(_model_text(model="cohen").encode(), ("'cohen'", "cohen-massaro"), id="unknown"),
    pytest.param(_model_text(groups=[]).encode(), ("not a cohen-massaro model",), id="no-groups"),
    pytest.param(_model_text(config=3).encode(), ("config",), id="wrong-member"),
    pytest.param(pickle.dumps(_Bomb()), ("model.file",), id="pickle"),
    pytest.param(b"[" * 100_000, ("model.file",), id="nested-deeply"),
)


@pytest.mark.parametrize(("content", "words"), BAD_MODELS)
def test_a_broken_model_file_is_refused(
    content: bytes,
    words: tuple[str, ...],
    job: SmallJob,
    capsys: Capture,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.chdir(job.folder)
    (job.folder / "hero.json").write_bytes(content)
    job.sections["model"] = {"file": "hero.json"}
    ran = run_inline(capsys, job)
    expect_refused(job, ran, "model.file", "hero.json", *words)
    assert not (job.folder / "exploded").exists()

    (job.folder / "hero.json").write_text(_model_text())
    expect_success(job, run_inline(capsys, job))


RIG = (SAMPLE / "crab.rig.toml").read_text(encoding="utf-8")
BAD_RIGS = (
    pytest.param(RIG[:300], ("end of document",), id="truncated"),
    pytest.param("", ("schema", "animeme.rig/2"), id="empty"),
    pytest.param(RIG.replace("rig/2", "rig/3"), ("animeme.rig/3", "newer animeme"), id="future"),
    pytest.param(
        RIG.replace("gain = 0.4 }]", "gian = 0.4 }]", 1),
        ("controls.jawOpen.1.gian", "Did you mean 'gain'?"),
        id="typo",
    ),
    pytest.param(
        RIG.replace('"MawGape", gain = 1.4', '"MawGape", gain = "much"'),
        ("controls.jawOpen.0.gain", "'much'", "animeme schema rig"),
        id="word-for-number",
    ),
    pytest.param(
        RIG.replace('"MawGape", gain = 1.4', '"MawGape", gain = nan'),
        ("controls.jawOpen.0.gain", "finite"),
        id="nan",
    ),
    pytest.param(
        'schema = "animeme.rig/1"\nname = "x"\n[controls]\n',
        ("no control drives any shape", "animeme rig"),
        id="drives-nothing",
    ),
    pytest.param(RIG + 'Nope = "MawGape"\n', ("Nope", "nothing drives"), id="stray-ceiling"),
    pytest.param(
        RIG + "[limits]\nMawGape = [1.0, 0.0]\n", ("low above high", "MawGape"), id="limits-swapped"
    ),
    pytest.param(
        'schema = "animeme.rig/1"\nname = "x"\ncontrols = []\n', ("controls",), id="list-for-table"
    ),
)


@pytest.mark.parametrize(("content", "words"), BAD_RIGS)
def test_a_broken_rig_document_is_refused(
    content: str, words: tuple[str, ...], job: SmallJob, capsys: Capture
) -> None:
    (job.folder / "crab.rig.toml").write_text(content, encoding="utf-8")
    ran = run_inline(capsys, job)
    expect_refused(job, ran, "characters.crab.rig", *words)

    job.asset("crab.rig.toml")
    expect_success(job, run_inline(capsys, job))


def test_a_broken_rig_document_is_named(job: SmallJob, capsys: Capture) -> None:
    (job.folder / "crab.rig.toml").write_text(RIG[:300], encoding="utf-8")
    expect_refused(job, run_inline(capsys, job), "characters.crab.rig", "crab.rig.toml")


def test_a_rig_of_another_character_is_refused(job: SmallJob, capsys: Capture) -> None:
    job.sections["characters.crab"]["rig"] = "arkit"
    ran = run_inline(capsys, job)
    expect_refused(job, ran, "characters.crab", "'arkit'", "Choose another profile")


def test_a_rig_that_nobody_knows_is_refused_with_the_way_on(job: SmallJob, capsys: Capture) -> None:
    del job.sections["characters.crab"]["rig"]
    ran = run_inline(capsys, job)
    expect_refused(job, ran, "characters.crab", "no known rig family", "animeme rig", "--draft")
