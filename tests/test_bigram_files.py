"""Sets of bigrams as documents: what they extend, what they change, what is refused."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import animeme
from animeme import bigrams, testing
from animeme.errors import InputError
from animeme.phones import Phone, PhoneTrack
from animeme_stages.synthesize.bigram_files import find_set, shipped_names, shipped_set
from animeme_stages.synthesize.bigram_set import COMMON
from support.jobs import Capture, SmallJob, run_inline
from support.schemas import validate

LOW = {"open": [[0.0, 0.0], [0.5, 0.8], [1.0, 0.0]], "Grin": [[0.0, 0.2], [1.0, 0.4]]}
TRACK = PhoneTrack("en", "arpabet", (Phone("L", 0.0, 0.1), Phone("OW", 0.1, 0.3)))


def write(path: Path, **members: Any) -> Path:
    document = {"schema": "animeme.bigrams/1", **members}
    path.write_text(json.dumps(document, ensure_ascii=False), encoding="utf-8")
    return path


@pytest.mark.slow
def test_shipped_sets_have_every_pair() -> None:
    assert set(shipped_names()) >= {"facefx", "facefx-poses", "mandarin", "viseme-poses"}
    english, mandarin = shipped_set("facefx").set_, shipped_set("mandarin").set_
    assert len(english.polygons) == 22**2
    assert sum("_" not in pair for pair in english.polygons) == 441
    # One class more (2013 paper, section 4.4): 43 further pairs of phones, and two with a pause.
    assert len(mandarin.polygons) == 23**2
    assert mandarin.class_of("y") == "yu"
    assert english.class_of("y") != "yu"
    names = [Path(entry).stem for entry in shipped_names()]
    for name in names:
        validate("bigrams", shipped_set(name).to_json())


def test_a_set_plays_as_a_model(tmp_path: Path) -> None:
    file = write(tmp_path / "own.json", pairs={"l|ow": {"curves": LOW}}, poses={"open": {"jaw": 2}})
    model = animeme.load_model(file)
    testing.check_model(model)
    # A pose without controls drives the control of its own name.
    assert model.controls == ("jaw", "Grin")
    curves = model.synthesize(TRACK, rate_hz=60)
    assert 0.6 < curves.curve("jaw").max() <= 1.6
    codes = {finding.code for finding in model.remarks(TRACK)}
    assert codes == {"bigram-pair-missing"}


def test_a_set_changes_what_it_extends(tmp_path: Path) -> None:
    write(tmp_path / "base.json", pairs={"l|ow": {"curves": LOW}, "ow|l": {"curves": LOW}},
          licence="CC0", speed=9.0)  # fmt: skip
    still = write(tmp_path / "still.json", extends="base.json", pairs={"ow|l": {"curves": {}}})
    found = find_set(str(still))
    assert set(found.set_.polygons) == {"l|ow", "ow|l"}
    assert found.set_.polygons["ow|l"] == {}
    assert found.speed == 9.0
    assert "CC0" in found.credits
    assert found.owners == {"l|ow": str(tmp_path / "base.json"), "ow|l": str(still)}


def test_a_class_can_be_split(tmp_path: Path) -> None:
    """A phone leaves the class that it had; pairs that are not drawn yet move like the old ones."""
    split = find_set(str(write(tmp_path / "m.json", extends="facefx", phones={"m": ["m"]})))
    assert split.set_.class_of("m") == "m"
    assert split.set_.class_of("b") == "bmp"
    assert "m" not in split.set_.classes["bmp"]
    assert split.set_.source("m", "aa") == "bmp|aa"
    assert split.set_.source("m", "m") == "bmp|bmp"


@pytest.mark.parametrize(
    ("members", "said"),
    [
        ({"pairs": {"lo|ow": {"curves": {}}}}, "'lo' in the pair 'lo|ow' is no class"),
        ({"pairs": {"low": {"curves": {}}}}, "not a pair"),
        ({"pairs": {"l|ow": {"curves": {"a": [[0, 0]]}}}}, "pairs.l|ow.curves.a"),
        ({"pairs": {"l|ow": {"curves": {"a": [[0, 0], [2, 0]]}}}}, "less than or equal to 1"),
        ({"pairs": {"l|ow": {"curves": {"a": [[0.5, 0], [0.2, 0]]}}}}, "go back"),
        ({"pairs": {"l|ow": {"curve": {}}}}, "Did you mean 'curves'"),
        ({"phones": {"x": ["m"], "y": ["m"]}}, "in two classes"),
        ({"phones": {"a|b": ["m"]}}, "cannot be a class"),
        ({"priority": ["nose"]}, "no pose 'nose'"),
        ({"extends": "facefy"}, "Did you mean 'facefx'"),
        ({"extends": "missing.json"}, "no such file"),
        ({"extends": "own.json"}, "extends itself"),
    ],
)
def test_broken_sets_are_refused(tmp_path: Path, members: dict[str, Any], said: str) -> None:
    file = write(tmp_path / "own.json", **members)
    with pytest.raises(InputError) as caught:
        animeme.load_model(file)
    assert said in str(caught.value)


@pytest.mark.slow
def test_characters_of_a_job_have_sets_of_their_own(job: SmallJob, capsys: Capture) -> None:
    """Two characters, one line: each moves by its own set, and what is missing is said of it."""
    still = {"l|ow": {"curves": {"open": [[0, 0], [1, 0]]}}}
    write(job.folder / "still.json", extends="facefx-poses", pairs=still)
    job.sections["model"] = {"name": "bigram"}
    job.sections["characters.rock"] = {"asset": "crab.glb", "rig": "crab.rig.toml"}
    job.sections["characters.rock.model"] = {"file": "nope.json"}
    ran = run_inline(capsys, job)
    assert ran.code == 2
    ran.says("characters.rock.model.file", "no such file")
    job.sections["characters.rock.model"] = {"file": "still.json"}
    run_inline(capsys, job)
    assert job.statuses()["en/boat"] == "ok"
    assert "bigram-pair-missing" in {f["code"] for f in job.findings("en/boat", "rock")}
    assert "mouth-still" in {f["code"] for f in job.findings("en/boat", "rock")}
    assert "bigram-pair-missing" not in {f["code"] for f in job.findings("en/boat", "crab")}


@pytest.mark.slow
def test_a_seeded_set_moves_like_its_model(tmp_path: Path) -> None:
    output = tmp_path / "seeded.json"
    found = bigrams.seed_bigrams("cohen-massaro", output=output)
    validate("bigrams", json.loads(output.read_text(encoding="utf-8")))
    assert len(found.document["pairs"]) == (len(COMMON) + 1) ** 2
    known = [r for r in found.correlation.values() if r is not None]
    assert np.median(known) > 0.85
    assert max(found.rmse.values()) < 0.08


def test_poses_can_be_a_crabs(tmp_path: Path) -> None:
    """Any poses: here two of the crab's, and a class of its own."""
    write(
        tmp_path / "crab.json",
        poses={"Gape": {"jawOpen": 1.0}, "Ring": {"mouthPucker": 1.0}, "Claw": {"claw": 1.0}},
        phones={"open": ["a", "æ", "ə"], "other": ["i", "u", "t", "k"], "lips": ["p", "m"]},
    )
    output = tmp_path / "sets" / "crab-set.json"
    found = bigrams.seed_bigrams("dam", poses=str(tmp_path / "crab.json"), output=output)
    assert len(found.document["pairs"]) == 16
    assert found.document["extends"] == "../crab.json"
    again = bigrams.seed_bigrams("dam", poses=str(tmp_path / "crab.json"), output=output)
    assert again == found
    assert {f.code for f in found.findings} == {"bigrams-pose-empty"}
    model = animeme.load_model(output)
    assert model.controls == ("jawOpen", "mouthPucker")
    assert model.synthesize(TRACK, rate_hz=60).curve("jawOpen").max() > 0.02
