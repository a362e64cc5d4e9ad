"""``animeme schema``: every kind of document has a sound one."""

from __future__ import annotations

import json

import jsonschema
import pytest

import animeme_schemas
from support.jobs import Capture, animeme

KINDS = [f"{kind}/{number}" for kind, number in animeme_schemas.kinds()]


def test_schema_lists_the_kinds(capsys: Capture) -> None:
    names = [f"animeme.{kind}" for kind in KINDS]
    assert animeme(capsys, "schema").out.split() == names
    assert json.loads(animeme(capsys, "schema", "--json").out) == names
    assert {"animeme.job/1", "animeme.report/1", "animeme.rig/1"} <= set(names)


@pytest.mark.parametrize("prefix", ["", "animeme."])
@pytest.mark.parametrize("kind", KINDS)
def test_schema_prints_a_sound_schema_of_each_kind(kind: str, prefix: str, capsys: Capture) -> None:
    ran = animeme(capsys, "schema", prefix + kind)
    assert ran.code == 0
    schema = json.loads(ran.out)
    jsonschema.Draft202012Validator.check_schema(schema)
    assert schema["$id"] == f"animeme.{kind}"
    name, _, number = kind.partition("/")
    assert schema == animeme_schemas.load(name, int(number))


@pytest.mark.parametrize("kind", ["jobs", "job/99", "job/x", "job/²", "", "../job"])
def test_schema_refuses_a_kind_it_does_not_know(kind: str, capsys: Capture) -> None:
    ran = animeme(capsys, "schema", kind)
    ran.says(f"'{kind}'", "Known:", "job", "report", "rig")
    assert (ran.code, ran.out) == (2, "")
