"""The sample job from its file to what other programs read out of the outputs."""

from __future__ import annotations

import json
import tomllib
from pathlib import Path

import numpy as np
import pytest
from pxr import Usd

from animeme.files import sha256
from animeme.findings import RunReport
from animeme.phones import PhoneTrack
from animeme.plan import REPORT_NAMES
from animeme_stages.ingest.glb import open_container
from animeme_stages.write.gltf_harm import harm
from animeme_stages.write.gltf_source import source_of
from conftest import LANGUAGES, SAMPLE
from support.judges import gltf_weights, khronos_findings, select, usd_weights
from support.usd_kit import new_findings

CHARACTERS = ("ada", "crab")
LINES = ("boat", "count", "five", "moon", "think", "welcome")
Run = tuple[RunReport, Path]


@pytest.fixture(scope="module", autouse=True)
def digests_before() -> dict[Path, str]:
    return {path: sha256(path) for path in sorted(SAMPLE.rglob("*.*")) if path.is_file()}


def test_every_line_is_ok(sample_run: Run) -> None:
    report, _ = sample_run
    assert report.exit_code == 0
    for character in CHARACTERS:
        assert report.count("ok", character=character) == 18
    assert [finding for finding in report.all_findings if finding.severity > 0] == []


def test_report_document_says_the_same(sample_run: Run) -> None:
    report, output = sample_run
    document = json.loads((output / "report.json").read_text(encoding="utf-8"))
    assert document["totals"] == {c: {"ok": 18, "review": 0, "failed": 0} for c in CHARACTERS}
    assert document["outputs"] == list(report.outputs)
    assert all((output / name).is_file() for name in document["outputs"])
    events = [json.loads(line) for line in (output / "run.jsonl").read_text().splitlines()]
    assert [e["event"] for e in events].count("line") == 18
    summary = (output / "summary.md").read_text(encoding="utf-8")
    assert "| es | crab | 6 | 6 | 0 | 0 |" in summary


def test_nothing_else_is_left_behind(sample_run: Run) -> None:
    report, output = sample_run
    known = {*report.outputs, *REPORT_NAMES}
    known |= {f"alignments/{language}/{line}.json" for language in LANGUAGES for line in LINES}
    found = {p.relative_to(output).as_posix() for p in output.rglob("*") if p.is_file()}
    assert found == known


@pytest.mark.parametrize("language", LANGUAGES)
@pytest.mark.parametrize("character", CHARACTERS)
def test_one_animation_per_line(sample_run: Run, language: str, character: str) -> None:
    _, output = sample_run
    old = open_container(SAMPLE / f"{character}.glb").json.get("animations", [])
    new = open_container(output / language / f"{character}.glb").json["animations"]
    assert new[: len(old)] == old
    assert [animation["name"] for animation in new[len(old) :]] == list(LINES)


@pytest.mark.parametrize("language", LANGUAGES)
@pytest.mark.parametrize("character", CHARACTERS)
def test_usd_plays_the_same_weights_as_gltf(sample_run: Run, language: str, character: str) -> None:
    """By name, at random times, each read by a library that is not ours."""
    _, output = sample_run
    random = np.random.default_rng(7)
    layer = Usd.Stage.Open(str(output / language / f"{character}.usdc"))
    assembly = Usd.Stage.Open(str(output / f"{character}.usda"))
    for line in LINES:
        at_s = random.uniform(0, 3, 20)
        gltf = gltf_weights(output / language / f"{character}.glb", line, at_s)
        select(layer, dialogueLine=line)
        select(assembly, dialogueLanguage=language, dialogueLine=line)
        for stage in (layer, assembly):
            usd = usd_weights(stage, at_s)
            assert set(usd) >= set(gltf)
            for mesh, shapes in usd.items():
                for shape, weights in shapes.items():
                    # glTF animates only meshes that own a driven shape; the others rest at 0.
                    expected = gltf[mesh][shape] if mesh in gltf else np.zeros(20)
                    np.testing.assert_allclose(weights, expected, atol=0.003)


def test_curves_move(sample_run: Run) -> None:
    _, output = sample_run
    at_s = np.linspace(0, 3, 60)
    crab = gltf_weights(output / "de" / "crab.glb", "boat", at_s)
    moved = {shape: float(np.ptp(w)) for m in crab.values() for shape, w in m.items()}
    assert moved["MawGape"] > 0.3
    assert {shape for shape, span in moved.items() if span > 0.1} >= {"LipRing", "GrinWide"}


@pytest.mark.parametrize("language", LANGUAGES)
@pytest.mark.parametrize("character", CHARACTERS)
def test_the_old_file_is_in_the_new_one(sample_run: Run, language: str, character: str) -> None:
    _, output = sample_run
    source, target = SAMPLE / f"{character}.glb", output / language / f"{character}.glb"
    old, new = open_container(source), open_container(target)
    assert harm(source_of(source), new) == []
    assert old.bin is not None
    assert new.bin is not None
    old_bytes = source.read_bytes()[old.bin.start : old.bin.start + old.bin.length]
    new_bytes = target.read_bytes()[new.bin.start : new.bin.start + new.bin.length]
    assert len(new_bytes) > len(old_bytes)
    assert new_bytes.startswith(old_bytes)


def test_sources_are_untouched(sample_run: Run, digests_before: dict[Path, str]) -> None:
    assert {path: sha256(path) for path in digests_before} == digests_before


def test_khronos_validator_finds_nothing_new(sample_run: Run) -> None:
    _, output = sample_run
    sources = [SAMPLE / f"{character}.glb" for character in CHARACTERS]
    targets = sorted(output.rglob("*.glb"))
    found = khronos_findings(*sources, *targets)
    assert len(targets) == 6
    for target in targets:
        assert not found[target] - found[SAMPLE / target.name]


@pytest.mark.parametrize("name", ["ada.usda", "crab.usda", "en/ada.usdc", "es/crab.usdc"])
def test_usd_validation_finds_nothing_new(sample_run: Run, name: str) -> None:
    _, output = sample_run
    source = SAMPLE / Path(name).with_suffix(".usdc").name
    assert new_findings(source, output / name) == set()


def test_body_animation_goes_on(sample_run: Run) -> None:
    """Ada came with `idle`: her neck and head still sway while she speaks."""
    from pxr import UsdSkel

    _, output = sample_run
    before = Usd.Stage.Open(str(SAMPLE / "ada.usdc"))
    after = Usd.Stage.Open(str(output / "ada.usda"))
    poses = []
    for stage in (before, after):
        (prim,) = [p for p in stage.Traverse() if p.IsA(UsdSkel.Skeleton)]
        query = UsdSkel.Cache().GetSkelQuery(UsdSkel.Skeleton(prim))
        poses.append(
            np.array([query.ComputeJointLocalTransforms(code) for code in (0.0, 7.0, 30.0)])
        )
    np.testing.assert_array_equal(poses[0], poses[1])
    assert np.ptp(poses[0], axis=0).max() > 0.01


@pytest.mark.parametrize("language", LANGUAGES)
def test_alignments_say_the_transcript(sample_run: Run, language: str) -> None:
    _, output = sample_run
    for line in LINES:
        document = json.loads((output / "alignments" / language / f"{line}.json").read_text())
        track = PhoneTrack.from_document(document)
        text = (SAMPLE / "dialogue" / language / f"{line}.txt").read_text(encoding="utf-8")
        assert track.language == language
        for word in track.words:
            spoken = text[word.source[0] : word.source[1]]
            assert spoken.lower() == word.text or not spoken.isalpha()
        assert track.inventory == ("arpabet" if language == "en" else "ipa")


def test_the_sample_is_small() -> None:
    files = [p for p in SAMPLE.rglob("*") if p.suffix in (".glb", ".usdc", ".wav", ".txt")]
    assert sum(path.stat().st_size for path in files) <= 6_000_000
    job = tomllib.loads((SAMPLE / "job.toml").read_text(encoding="utf-8"))
    assert set(job["characters"]) == set(CHARACTERS)
