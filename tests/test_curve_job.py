"""A job's ``[curves]``: keys on frames, offset, pre-roll, curve files out and in, edits kept."""

from __future__ import annotations

import json
import shutil
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from pxr import Usd, UsdSkel

import animeme
from animeme import registry
from animeme.curves import CurveSet
from animeme.timing import RATES
from animeme_stages.curve_files.read import read_curves
from animeme_stages.curve_files.write import write_curves
from support.gltf_kit import Reader
from support.jobs import Capture, SmallJob, run_inline, small_job

BOUND = 0.002
AUDIO_S = 2.704875


@pytest.fixture(scope="module")
def plain_job(tmp_path_factory: pytest.TempPathFactory) -> SmallJob:
    """A job without any settings, run once."""
    made = small_job(tmp_path_factory.mktemp("plain") / "job", "en/boat")
    made.timed_line()
    animeme.run(made.write(), executor="inline")
    return made


@pytest.fixture
def plain(plain_job: SmallJob) -> CurveSet:
    """The line's curves in that job."""
    return written(plain_job)


@pytest.fixture
def job(tmp_path: Path) -> SmallJob:
    """The crab with one line, which is timed already."""
    made = small_job(tmp_path / "job", "en/boat")
    made.timed_line()
    made.sections["curves"] = {}
    return made


def written(job: SmallJob, file: str = "en/crab.glb", line: str = "boat") -> CurveSet:
    path = job.output / file
    return registry.format_of(path).read_animations(path)[line]


def codes(job: SmallJob, line: str = "en/boat") -> list[str]:
    """What is said of a line, but for its timings, and that a mouth moved by hand stays open."""
    found = [f["code"] for f in job.findings(line)]
    return [code for code in found if code not in ("timings-used", "bilabial-open")]


def apart(first: CurveSet, second: CurveSet, at_s: Any, later_s: float = 0.0) -> float:
    """Largest difference of what both have at `at_s`, the second `later_s` later."""
    error = 0.0
    for name in first.names:
        one = first.sample(at_s)[:, first.names.index(name)]
        other = second.sample(np.asarray(at_s) + later_s)[:, second.names.index(name)]
        error = max(error, float(np.abs(one - other).max()))
    return error


# Out


def test_uniform_keys_are_on_the_frames_of_film(job: SmallJob, capsys: Capture) -> None:
    job.sections["curves"] = {"keys": "uniform", "frame_rate": 23.976, "preroll_s": 0.5}
    job.sections["characters.crab"]["asset"] = ["crab.glb", "crab.usdc"]
    job.asset("crab.usdc")
    assert run_inline(capsys, job).code == 0
    times_s = RATES["23.976"].times_s(AUDIO_S + 0.5)
    assert times_s[-2] < AUDIO_S + 0.5 <= times_s[-1]

    reader = Reader(job.output / "en/crab.glb")
    (animation,) = [a for a in reader.root["animations"] if a["name"] == "boat"]
    keys = reader.accessor(animation["samplers"][0]["input"])
    np.testing.assert_array_equal(keys, times_s.astype(np.float32))
    assert animation["extras"]["animeme"]["audio_start_s"] == 0.5

    stage = Usd.Stage.Open(str(job.output / "en/crab.usdc"))
    (prim,) = (p for p in stage.Traverse() if p.GetName() == "boat")
    samples = UsdSkel.Animation(prim).GetBlendShapeWeightsAttr().GetTimeSamples()
    seconds = np.array(samples) / stage.GetTimeCodesPerSecond()
    np.testing.assert_allclose(seconds, times_s, rtol=0, atol=1e-12)
    assert prim.GetCustomData()["animeme"]["audio_start_s"] == 0.5
    assert stage.GetEndTimeCode() / stage.GetTimeCodesPerSecond() >= AUDIO_S + 0.5


@pytest.mark.parametrize("offset_s", [-0.08, 0.25])
def test_an_offset_moves_the_motion_and_not_the_audio(
    offset_s: float, job: SmallJob, plain: CurveSet, capsys: Capture
) -> None:
    job.sections["curves"] = {"offset_s": offset_s}
    assert run_inline(capsys, job).code == 0
    moved = written(job)
    assert moved.times_s[0] == 0
    assert moved.duration_s == pytest.approx(AUDIO_S + max(offset_s, 0), abs=1e-6)
    at_s = np.linspace(max(0, -offset_s), plain.duration_s - 0.1, 500)
    assert apart(plain, moved, at_s, offset_s) <= 2 * BOUND + 1e-6
    # The checks still compare the mouth with the phones that it belongs to.
    assert all(finding["code"] != "bilabial-open" for finding in job.findings("en/boat"))


def test_a_preroll_is_motion_before_the_audio(
    job: SmallJob, plain: CurveSet, capsys: Capture
) -> None:
    job.sections["curves"] = {"preroll_s": 0.4}
    assert run_inline(capsys, job).code == 0
    late = written(job)
    assert late.times_s[0] == 0
    assert late.duration_s == pytest.approx(AUDIO_S + 0.4, abs=1e-6)
    assert apart(plain, late, np.linspace(0.3, 2.6, 400), 0.4) < 0.08
    # The alignment stays in the recording's time.
    alignment = json.loads((job.output / "alignments/en/boat.json").read_text(encoding="utf-8"))
    assert alignment["duration_s"] == pytest.approx(AUDIO_S, abs=1e-3)


def test_curve_files_hold_what_the_asset_holds(job: SmallJob, capsys: Capture) -> None:
    job.timed_line("en/deep/sea")
    job.sections["curves"] = {"export": ["csv", "json", "npz", "livelink-csv"]}
    ran = run_inline(capsys, job)
    assert ran.code == 0
    folder = job.output / "curves/crab/en"
    found = sorted(path.relative_to(folder).as_posix() for path in folder.rglob("*.*"))
    assert found == [f"{line}.{e}" for line in ("boat", "deep/sea") for e in ("csv", "json", "npz")]
    outputs = job.report()["outputs"]
    assert {f"curves/crab/en/{name}" for name in found} < set(outputs)
    asset = written(job)
    for suffix in (".csv", ".json", ".npz"):
        back, _ = read_curves(folder / f"boat{suffix}")
        assert 0 < len(back.names) <= len(asset.names)
        np.testing.assert_array_equal(back.times_s.astype(np.float32), asset.times_s)
        assert apart(back, asset, back.times_s) < 3e-6  # times are rounded as well
    # The crab is none of ARKit's: said per line, and no reason to hold the line back.
    assert job.statuses() == {"en/boat": "review", "en/deep/sea": "review"}
    assert codes(job) == ["curves-not-arkit"]


def test_two_lines_that_share_a_curve_file_are_refused(job: SmallJob, capsys: Capture) -> None:
    job.timed_line("en/boat.livelink")
    job.sections["curves"] = {"export": ["csv", "livelink-csv"]}
    ran = run_inline(capsys, job)
    assert ran.code == 2
    ran.says("curves.export", "two lines would write", "boat.livelink.csv")
    job.sections["curves"] = {"export": ["csv"]}
    assert run_inline(capsys, job).code == 0


BAD_SETTINGS = [
    ({"frame_rate": 23}, ("curves.frame_rate", "no frame rate", "23.976")),
    ({"frame_rate": "29.97 drop"}, ("curves.frame_rate", "29.97df")),
    ({"keys": "all"}, ("curves.keys", "'reduced' or 'uniform'")),
    ({"preroll_s": -1}, ("curves.preroll_s", "greater than or equal to 0")),
    ({"offset_s": 100}, ("curves.offset_s", "60")),
    ({"export": ["csb"]}, ("curves.export.0", "'csb'", "Did you mean 'csv'?")),
    ({"offset": 1.0}, ("curves.offset", "unknown key", "offset_s")),
]


@pytest.mark.parametrize(("settings", "words"), BAD_SETTINGS)
def test_settings_that_make_no_sense_are_refused(
    settings: dict[str, Any], words: tuple[str, ...], job: SmallJob, capsys: Capture
) -> None:
    job.sections["curves"] = settings
    ran = run_inline(capsys, job)
    assert ran.code == 2
    ran.says(*words)
    assert not job.output.exists()


# In


def put(job: SmallJob, name: str, text: str) -> Path:
    path = job.dialogue / "en" / name
    path.write_text(text, encoding="utf-8")
    return path


DRAWN = "time_s,MawGape,FeelerUp\n0,0,\n1,0.7,0.2\n2,0.1,0.2\n2.7,0,0.2\n"


def test_curves_by_hand_replace_the_synthesis(job: SmallJob, capsys: Capture) -> None:
    shapes = written_shapes(job)
    put(job, "boat.curves.csv", DRAWN.replace("MawGape", shapes[0]).replace("FeelerUp", shapes[1]))
    job.timed_line("en/other")
    put(job, "other.curves.csv", DRAWN.replace(",MawGape,FeelerUp", f",{shapes[0]},nothing"))
    put(job, "other.crab.curves.csv", "time_s,jawOpen\n0,0\n1,0.5\n9,0\n")
    assert run_inline(capsys, job).code == 0
    assert codes(job) == []
    assert written(job).sample([0, 1, 2]).max(axis=1) == pytest.approx([0.2, 0.7, 0.2], abs=1e-3)
    # The character's own goes before everybody's, and jawOpen is a control of its rig.
    assert codes(job, "en/other") == ["curves-overhang"]
    other = written(job, line="other")
    assert other.duration_s == pytest.approx(AUDIO_S, abs=1e-6)
    assert other.sample([1.0]).max() == pytest.approx(0.7, abs=1e-3)  # its rig's gain is 1.4


def written_shapes(job: SmallJob) -> tuple[str, ...]:
    return registry.format_named("gltf").load(job.folder / "crab.glb").shapes


def test_exported_curves_come_back_in(job: SmallJob, plain: CurveSet, capsys: Capture) -> None:
    job.sections["curves"] = {"export": ["csv", "json", "npz"]}
    for line in ("one", "two"):
        job.timed_line(f"en/{line}")
    assert run_inline(capsys, job).code == 0
    exported = job.output / "curves/crab/en"
    names = ("boat.curves.csv", "one.curves.json", "two.crab.curves.npz")
    for name, suffix in zip(names, (".csv", ".json", ".npz"), strict=True):
        shutil.copy(exported / f"boat{suffix}", job.dialogue / "en" / name)
    assert run_inline(capsys, job).code == 0
    for line in ("boat", "one", "two"):
        assert apart(plain, written(job, line=line), np.linspace(0, 2.7, 500)) <= 2 * BOUND + 1e-6
        assert codes(job, f"en/{line}") == []


def test_a_take_of_live_link_face_drives_the_line(job: SmallJob, capsys: Capture) -> None:
    times_s = np.array([0.0, 0.5, 1.0, 2.7])
    take = CurveSet(times_s, ("jawOpen", "eyeBlinkLeft"), [[0, 0], [0.6, 1], [0.2, 0], [0, 0]])
    path = job.dialogue / "en" / "boat.curves.csv"
    write_curves(take, path, "livelink-csv", frame_rate=RATES["29.97df"])
    assert run_inline(capsys, job).code == 0
    maw = written(job).curve("MawGape")
    assert np.interp([0.5005, 1.001], written(job).times_s, maw) == pytest.approx(
        [0.84, 0.28],
        abs=5e-3,  # the rig opens the maw 1.4 times as far
    )
    # The crab cannot blink: of 52 columns, only one that moves is worth a remark.
    assert codes(job) == ["curves-column-unknown"]
    (finding,) = (f for f in job.findings("en/boat") if f["code"] == "curves-column-unknown")
    assert finding["message"].endswith("answers to: eyeBlinkLeft")


BAD_CURVES = [
    (".curves.csv", "MawGape\n1\n2\n", "motion-no-time", "failed"),
    (".curves.csv", "time_s,MawGape\n0,0\n2,1\n1,1\n", "motion-time-order", "failed"),
    (".curves.csv", "frame,jawOpen\n0,0\n24,1\n", "motion-rate", "failed"),
    (".curves.csv", "time_s,tail\n0,0\n1,1\n", "curves-unknown", "failed"),
    (".curves.json", '{"schema": "animeme.curves/9"}', "document-kind", "failed"),
    (".curves.npz", "no", "curves-broken", "failed"),
    (".curves.csv", "time_s,jawOpen\n0,0\n1,NaN\n2.7,1\n", "curves-nan", "review"),
    (".curves.csv", "time_s,jawOpen\n0,0\n0.5,1\n", "curves-short", "review"),
]


def test_bad_curves_are_told_and_mended(job: SmallJob, capsys: Capture) -> None:
    paths = []
    for number, (suffix, text, _, _) in enumerate(BAD_CURVES):
        job.timed_line(f"en/line{number}")
        paths.append(put(job, f"line{number}{suffix}", text))
    assert run_inline(capsys, job).code == 1
    statuses = job.statuses()
    assert statuses.pop("en/boat") == "ok"
    for number, (_, _, code, status) in enumerate(BAD_CURVES):
        assert code in codes(job, f"en/line{number}")
        assert statuses[f"en/line{number}"] == status
    for path in paths:
        path.unlink()
    assert run_inline(capsys, job).code == 0
    assert set(job.statuses().values()) == {"ok"}


def test_files_by_hand_without_a_line_are_told(job: SmallJob, capsys: Capture) -> None:
    put(job, "baot.curves.csv", DRAWN)
    put(job, "boat.carb.edits.toml", "")
    assert run_inline(capsys, job).code == 0
    found = {finding["code"]: finding["place"] for finding in job.report()["findings"]}
    assert found["curves-without-line"].endswith("baot.curves.csv")
    assert found["edits-without-line"].endswith("boat.carb.edits.toml")


def test_two_files_of_one_kind_fail_the_line(job: SmallJob, capsys: Capture) -> None:
    put(job, "boat.curves.csv", DRAWN)
    put(job, "boat.curves.json", "{}")
    assert run_inline(capsys, job).code == 1
    assert "line-duplicate" in codes(job)


# Edits

OFFSET = """schema = "animeme.edits/1"
[[edit]]
do = "offset"
control = "jawOpen"
by = 0.3
from = { text = "boat" }
to = { text = "boat", edge = "end" }
"""


def test_edits_are_kept_on_every_run(job: SmallJob, plain: CurveSet, capsys: Capture) -> None:
    path = put(job, "boat.edits.toml", OFFSET)
    for _ in range(2):
        assert run_inline(capsys, job).code == 0
        assert path.read_text(encoding="utf-8") == OFFSET
        assert codes(job) == []
        document = json.loads((job.output / "alignments/en/boat.json").read_text(encoding="utf-8"))
        (word,) = (w for w in document["words"] if w["text"] == "boat")
        middle_s = (word["start_s"] + word["end_s"]) / 2
        assert apart(plain, written(job), [middle_s]) > 0.1
        outside_s = [*np.linspace(0, word["start_s"], 50), *np.linspace(word["end_s"], 2.7, 50)]
        assert apart(plain, written(job), outside_s) <= 2 * BOUND + 1e-6


STALE = [
    (OFFSET.replace('"boat"', '"ship"'), "edit-word-gone"),
    (OFFSET.replace("jawOpen", "jawOpne"), "edit-curve-unknown"),
    (OFFSET.replace("0.3", "0.0"), "edit-no-effect"),
    (OFFSET.replace("[[edit]]", 'made_for_text = "Ahoy."\n[[edit]]'), "edits-text-changed"),
    (OFFSET + 'character = "carb"\n', "edit-character-unknown"),
    (OFFSET.replace('{ text = "boat", edge = "end" }', "9.5"), "edit-outside-line"),
]


def test_a_stale_edit_is_for_review_and_fails_nothing(job: SmallJob, capsys: Capture) -> None:
    for number, (text, _) in enumerate(STALE):
        job.timed_line(f"en/line{number}")
        put(job, f"line{number}.edits.toml", text)
    assert run_inline(capsys, job).code == 0
    statuses = job.statuses()
    assert statuses.pop("en/boat") == "ok"
    assert set(statuses.values()) == {"review"}
    for number, (_, code) in enumerate(STALE):
        assert codes(job, f"en/line{number}") == [code]
        assert f"line{number}" in job.animations()


def test_broken_edits_fail_their_line_alone(job: SmallJob, capsys: Capture) -> None:
    job.timed_line("en/other")
    put(job, "boat.edits.toml", OFFSET.replace("by = 0.3", "bye = 0.3"))
    assert run_inline(capsys, job).code == 1
    assert job.statuses() == {"en/boat": "failed", "en/other": "ok"}
    (finding,) = [f for f in job.findings("en/boat") if f["severity"] == "error"]
    assert finding["code"] == "document-invalid"
    assert "Did you mean 'by'?" in finding["message"]


def test_a_shape_is_edited_after_retargeting(
    job: SmallJob, plain: CurveSet, capsys: Capture
) -> None:
    shape = next(s for s in written_shapes(job) if s not in plain.names or not plain.curve(s).any())
    put(
        job,
        "boat.crab.edits.toml",
        f'schema = "animeme.edits/1"\n[[edit]]\ndo = "replace"\nshape = "{shape}"\n'
        "from = 0.5\nkeys = [[0.2, 0.8], [0.6, 0.0]]\n",
    )
    assert run_inline(capsys, job).code == 0
    assert codes(job) == []
    assert written(job).sample([0.7])[0, written(job).names.index(shape)] == pytest.approx(0.8)
