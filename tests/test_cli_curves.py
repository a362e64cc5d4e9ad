"""``animeme curves`` and ``animeme edits``: what people type, and what they get."""

from __future__ import annotations

import json
import re
from pathlib import Path

import numpy as np
import pytest

import animeme as package
from animeme import registry
from animeme.edits import read_edits
from animeme.timing import RATES
from animeme_stages.curve_files.read import read_curves
from conftest import SAMPLE
from support.jobs import Capture, SmallJob, animeme, small_job


@pytest.fixture(scope="module")
def spoken(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The output of a job: ada says one line, in both formats."""
    job: SmallJob = small_job(tmp_path_factory.mktemp("spoken") / "job", "en/boat")
    job.sections["characters.ada"] = {"asset": ["ada.glb", "ada.usdc"]}
    del job.sections["characters.crab"]
    job.asset("ada.glb")
    job.asset("ada.usdc")
    package.run(job.write())
    return job.output


@pytest.mark.parametrize("file", ["en/ada.glb", "en/ada.usdc", "ada.usda"])
def test_animations_are_listed(file: str, spoken: Path, capsys: Capture, wide: None) -> None:
    ran = animeme(capsys, "curves", "list", spoken / file)
    assert ran.code == 0
    assert "boat" in ran.out
    document = json.loads(animeme(capsys, "curves", "list", spoken / file, "--json").out)
    (entry,) = document["animations"]
    assert (entry["name"], entry["start_s"]) == ("boat", 0.0)
    assert entry["end_s"] == pytest.approx(2.704875, abs=1e-6)
    # What stays at rest is no curve, though glTF holds it: ada has 52 shapes.
    assert 10 < len(entry["shapes"]) < 30
    assert "jawOpen" in entry["shapes"]


def test_an_asset_without_our_animations_is_listed_too(capsys: Capture) -> None:
    ran = animeme(capsys, "curves", "list", SAMPLE / "ada.glb", "--json")
    assert (ran.code, json.loads(ran.out)["animations"]) == (0, [])


@pytest.mark.parametrize("kind", ["csv", "json", "npz", "livelink-csv"])
@pytest.mark.parametrize("file", ["en/ada.glb", "en/ada.usdc"])
def test_an_animation_becomes_a_curve_file(
    file: str, kind: str, spoken: Path, tmp_path: Path, capsys: Capture
) -> None:
    output = tmp_path / f"boat.{kind.rpartition('-')[2]}"
    ran = animeme(
        capsys, "curves", "export", spoken / file, "--line", "boat", "--format", kind,
        "--frame-rate", "25", "--output", output, "--json",
    )  # fmt: skip
    assert ran.code == 0
    assert json.loads(ran.out)["output"] == str(output)
    back, _ = read_curves(output)
    times_s = RATES["25"].times_s(2.704875)
    np.testing.assert_allclose(back.times_s, times_s, rtol=0, atol=1e-9)
    played = registry.format_of(spoken / file).read_animations(spoken / file)["boat"]
    jaw = played.sample(times_s)[:, played.names.index("jawOpen")]
    np.testing.assert_allclose(back.curve("jawOpen"), jaw, rtol=0, atol=1e-6)


def test_keys_can_be_moved_to_the_recording_s_time(
    spoken: Path, tmp_path: Path, capsys: Capture
) -> None:
    asset, output = spoken / "en/ada.glb", tmp_path / "boat.csv"
    options = ("--line", "boat", "--format", "csv", "--output", output)
    assert animeme(capsys, "curves", "export", asset, *options, "--shift-s", "-0.5").code == 0
    assert read_curves(output)[0].times_s[0] == -0.5


REFUSED = [
    (("--line", "bota"), ("no animation 'bota'", "Did you mean 'boat'?")),
    (("--format", "cvs"), ("--format", "csv")),
    (("--frame-rate", "23"), ("--frame-rate", "no frame rate", "23.976")),
    (("--shift-s", "nan"), ("--shift-s",)),
    (("--rig", "arkti"), ("no rig profile 'arkti'", "arkit")),
]


@pytest.mark.parametrize(("wrong", "words"), REFUSED)
def test_wrong_options_are_refused(
    wrong: tuple[str, str], words: tuple[str, ...], spoken: Path, tmp_path: Path, capsys: Capture
) -> None:
    given = {"--line": "boat", "--format": "csv", "--output": str(tmp_path / "boat.csv")}
    given |= dict([wrong])
    options = [part for option in given.items() for part in option]
    ran = animeme(capsys, "curves", "export", spoken / "en/ada.glb", *options)
    assert (ran.code, ran.out) == (2, "")
    ran.says(*words)
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("name", ["nobody.glb", "job.toml"])
def test_files_that_are_no_assets_are_refused(name: str, tmp_path: Path, capsys: Capture) -> None:
    (tmp_path / "job.toml").write_text("", encoding="utf-8")
    ran = animeme(capsys, "curves", "list", tmp_path / name)
    assert ran.code == 2
    ran.says(name)


def test_the_asset_itself_is_never_overwritten(tmp_path: Path, capsys: Capture) -> None:
    asset = tmp_path / "crab.glb"
    asset.write_bytes((SAMPLE / "crab.glb").read_bytes())
    options = ("--line", "Idle", "--format", "csv", "--output", asset)
    assert animeme(capsys, "curves", "export", asset, *options).code == 2
    assert asset.read_bytes() == (SAMPLE / "crab.glb").read_bytes()


# Edits


@pytest.mark.parametrize(
    ("options", "name"), [((), "boat.edits.toml"), (("--character", "ada"), "boat.ada.edits.toml")]
)
def test_a_file_of_edits_is_started_and_kept(
    options: tuple[str, ...], name: str, tmp_path: Path, capsys: Capture
) -> None:
    job = small_job(tmp_path / "job", "en/boat")
    recording = job.dialogue / "en/boat.wav"
    ran = animeme(capsys, "edits", recording, *options, "--json")
    made = job.dialogue / "en" / name
    assert (ran.code, json.loads(ran.out)) == (0, [str(made)])
    document = read_edits(made)
    assert document.made_for_text == "Mama bought a big blue boat for Bob."
    assert document.edit == []
    # What its comment shows can be used.
    text = made.read_text(encoding="utf-8")
    head, _, example = text.partition("# [[edit]]")
    shown = f"{head}[[edit]]" + re.sub("^# ", "", example, flags=re.MULTILINE)
    made.write_text(shown, encoding="utf-8")
    assert len(read_edits(made).edit) == 1
    again = animeme(capsys, "edits", recording, *options)
    assert again.code == 2
    again.says("is there already", name)
    assert made.read_text(encoding="utf-8") == shown


def test_edits_need_a_recording(tmp_path: Path, capsys: Capture) -> None:
    ran = animeme(capsys, "edits", tmp_path / "boat.wav")
    assert ran.code == 2
    ran.says("no such recording")
    assert list(tmp_path.iterdir()) == []
