"""`animeme bigrams`, from the outside."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest

from animeme import load_model
from animeme_stages.synthesize.bigram_files import find_set
from conftest import SAMPLE
from support.jobs import Capture, animeme
from support.schemas import validate

KEYS = [[-0.01, 0.0], [0.5, 0.7], [1.02, 0.0]]


def published(path: Path, diphones: dict[str, Any]) -> Path:
    path.write_text(json.dumps({"set": "ours", "diphones": diphones}), encoding="utf-8")
    return path


def test_import_maps_phones_and_lists_what_is_left(tmp_path: Path, capsys: Capture) -> None:
    file = published(
        tmp_path / "in.json",
        {
            "l|ow": {"open": KEYS},
            "M|AA": {"PBM": KEYS, "Ear": KEYS},
            "bmp|aa": {"PBM": KEYS},
            "sil|l": {"open": KEYS},
            "q|ow": {"open": KEYS},
            "oo|l": {"W": KEYS},
            "z|ow": {"open": [[0.5, 0.1]], "W": KEYS},
        },
    )
    output = tmp_path / "out.json"
    ran = animeme(capsys, "bigrams", "import", file, "--output", output, "--map", "oo=w",
                  "--licence", "LGPL-3.0", "--source", "a studio", "--json")  # fmt: skip
    assert ran.code == 0
    ran.says("'q' (1 pairs)", "M|AA (there is bmp|aa)", "open in z|ow")
    assert json.loads(ran.out)["pairs"] == 5
    document = json.loads(output.read_text(encoding="utf-8"))
    validate("bigrams", document)
    assert set(document["pairs"]) == {"l|ow", "bmp|aa", "_|l", "w|l", "z|ow"}
    assert document["licence"] == "LGPL-3.0"
    assert document["extends"] == "facefx-poses"
    assert document["pairs"]["l|ow"]["curves"]["open"] == [[0.0, 0.0], [0.5, 0.7], [1.0, 0.0]]
    assert document["pairs"]["w|l"]["note"] == "imported from oo|l"
    assert "a studio; LGPL-3.0" in find_set(str(output)).credits

    ran = animeme(capsys, "bigrams", "import", file, "--output", output)
    assert ran.code == 2
    ran.says("is there already")


@pytest.mark.parametrize(
    ("content", "options", "said"),
    [
        ("[]", (), "not an object"),
        ('{"diphones": []}', (), 'no table "diphones"'),
        ('{"schema": "animeme.bigrams/1"}', (), "is a set of bigrams already"),
        ('{"diphones": {"q|x": {}}}', (), "no pair that could be used"),
        ('{"diphones": {}}', ("--map", "oo"), "not NAME=CLASS"),
        ('{"diphones": {}}', ("--map", "oo=u"), "'u' is no common phone"),
        ('{"diphones": {"l|ow": {"a": [[0, 0], [1, 1]]}}}', ("--poses", "face"), "no set"),
    ],
)
def test_import_refuses_what_is_no_set(
    tmp_path: Path, capsys: Capture, content: str, options: tuple[str, ...], said: str
) -> None:
    (tmp_path / "in.json").write_text(content, encoding="utf-8")
    ran = animeme(
        capsys, "bigrams", "import", tmp_path / "in.json", "--output", tmp_path / "o.json", *options
    )
    assert ran.code == 2
    ran.says(said)
    assert not (tmp_path / "o.json").exists()


@pytest.mark.parametrize(
    ("name", "pairs"), [("default", 439), ("angry_facefx", 169), ("neutral_facefx", 169)]
)
def test_published_sets_are_imported(
    shared: Path, tmp_path: Path, capsys: Capture, name: str, pairs: int
) -> None:
    file = shared / "data" / "bigrams" / f"smartbody_diphones_{name}.json"
    ran = animeme(capsys, "bigrams", "import", file, "--output", tmp_path / "x.json", "--json")
    assert ran.code == 0
    assert json.loads(ran.out)["pairs"] == pairs
    assert "jawOpen" in load_model(tmp_path / "x.json").controls


def test_coverage_counts_pairs_by_hand(tmp_path: Path, capsys: Capture) -> None:
    """Low, low: _l l-ow ow-l l-ow ow_; the set has one pair of the five that are said, twice."""
    (tmp_path / "dialogue" / "en").mkdir(parents=True)
    (tmp_path / "dialogue" / "en" / "a.txt").write_text("Low, low!", encoding="utf-8")
    published(tmp_path / "in.json", {"l|ow": {"open": KEYS}})
    animeme(capsys, "bigrams", "import", tmp_path / "in.json", "--output", tmp_path / "s.json")
    ran = animeme(
        capsys, "bigrams", "coverage", tmp_path / "dialogue", "--set", tmp_path / "s.json", "--json"
    )
    assert ran.code == 0
    found = json.loads(ran.out)
    assert (found["pairs"], found["different"], found["covered"]) == (5, 4, 2)
    assert found["share"] == 0.4
    missing = {entry["pair"]: entry for entry in found["missing"]}
    assert set(missing) == {"_|l", "ow|l", "ow|_"}
    assert missing["ow|l"] == {
        "pair": "ow|l", "count": 1, "share": 0.2, "like": "l|ow", "example": "low",
        "lines": ["en/a"],
    }  # fmt: skip


def test_coverage_of_languages_and_of_broken_lines(tmp_path: Path, capsys: Capture) -> None:
    ran = animeme(capsys, "bigrams", "coverage", SAMPLE / "dialogue", "--language", "en", "--json")
    assert ran.code == 0
    assert json.loads(ran.out)["lines"] == 6
    assert json.loads(ran.out)["missing"] == []
    (tmp_path / "en").mkdir()
    (tmp_path / "en" / "a.txt").write_bytes(b"\xff\xfe\xff")
    (tmp_path / "en" / "b.txt").write_text("low", encoding="utf-8")
    ran = animeme(capsys, "bigrams", "coverage", tmp_path, "--json")
    assert ran.code == 1
    ran.says("en/a")
    assert json.loads(ran.out)["lines"] == 1
    ran = animeme(capsys, "bigrams", "coverage", tmp_path / "nowhere")
    assert ran.code == 2


def test_trace_names_the_pair_of_every_key(tmp_path: Path, capsys: Capture) -> None:
    document = {
        "schema": "animeme.alignment/1", "language": "en", "inventory": "arpabet",
        "duration_s": 0.4, "words": [],
        "phones": [{"symbol": "L", "start_s": 0.0, "end_s": 0.2},
                   {"symbol": "OW", "start_s": 0.2, "end_s": 0.4}],
    }  # fmt: skip
    line = tmp_path / "line.json"
    line.write_text(json.dumps(document), encoding="utf-8")
    published(tmp_path / "in.json", {"l|ow": {"open": KEYS}})
    animeme(capsys, "bigrams", "import", tmp_path / "in.json", "--output", tmp_path / "s.json")
    ran = animeme(capsys, "bigrams", "trace", line, "--set", tmp_path / "s.json", "--json")
    assert ran.code == 0
    found = json.loads(ran.out)
    keys = found["poses"]["open"]
    peak = max((k for k in keys if k["pair"] == "l|ow"), key=lambda key: key["weight"])
    assert peak["from"] == "l|ow"
    assert peak["set"] == str(tmp_path / "s.json")
    assert abs(peak["at"] - peak["time_s"] / 0.4) < 1e-3
    assert [phone["symbol"] for phone in peak["phones"]] == ["L", "OW"]
    assert found["missing"] == {"_|l": "like l|ow", "ow|_": "like l|ow"}
    assert animeme(capsys, "bigrams", "trace", line).out.count("l|ow") > 0
    ran = animeme(capsys, "bigrams", "trace", tmp_path / "nothing.wav")
    assert ran.code == 2
    ran.says("neither an alignment nor a recording")
