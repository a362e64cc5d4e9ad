"""Schemas say what is true, and every version of every document can be read."""

from __future__ import annotations

import json
from pathlib import Path

import jsonschema
import pytest

import animeme_schemas
from animeme import documents
from animeme.curves import CurveSet
from animeme.documents.kinds import KINDS, VERSIONS
from animeme.findings import RunReport
from animeme.phones import PhoneTrack
from conftest import SAMPLE

FROZEN = Path(__file__).parent / "fixtures" / "documents"


@pytest.mark.parametrize("kind", sorted(KINDS))
def test_schema_files_are_current(kind: str) -> None:
    assert animeme_schemas.text(kind) == documents.schema_text(kind), "run `make schemas`"


def test_every_kind_has_a_schema_and_a_frozen_fixture() -> None:
    versions = [
        (kind, number)
        for kind, newest in sorted(VERSIONS.items())
        for number in range(1, newest + 1)
    ]
    assert animeme_schemas.kinds() == versions
    frozen = {
        (kind, int(number)) for kind, number, *_ in (p.name.split(".") for p in FROZEN.iterdir())
    }
    assert frozen == set(versions)


@pytest.mark.parametrize("path", sorted(FROZEN.iterdir()), ids=lambda path: path.name)
def test_frozen_documents_are_read(path: Path) -> None:
    kind, number, *_ = path.name.split(".")
    jsonschema.validate(documents.parse_file(path), animeme_schemas.load(kind, int(number)))
    document = documents.read(kind, path)
    if kind == "alignment":
        assert PhoneTrack.from_document(document).to_document() == document
    if kind == "curves":
        assert CurveSet.from_document(document).to_document() == document


def test_what_a_run_writes_fits_its_schema(sample_run: tuple[RunReport, Path]) -> None:
    _, output = sample_run
    report = json.loads((output / "report.json").read_text(encoding="utf-8"))
    jsonschema.validate(report, animeme_schemas.load("report"))
    for path in (output / "alignments").rglob("*.json"):
        jsonschema.validate(json.loads(path.read_text()), animeme_schemas.load("alignment"))


@pytest.mark.parametrize(("kind", "file"), [("job", "job.toml"), ("rig", "crab.rig.toml")])
def test_sample_documents_fit_their_schemas(kind: str, file: str) -> None:
    jsonschema.validate(documents.parse_file(SAMPLE / file), animeme_schemas.load(kind))
