"""Curve files: out in four kinds, in again as they were, and refused where they are damaged."""

from __future__ import annotations

import csv
import json
import pickle
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from animeme import documents, load_character, registry
from animeme.curves import CurveSet
from animeme.errors import InputError
from animeme.rig import BoundRig
from animeme.timing import RATES
from animeme_stages.curve_files.read import read_curves
from animeme_stages.curve_files.write import SUFFIXES, write_curves
from conftest import SAMPLE

ARKIT = ("jawOpen", "mouthClose", "browInnerUp", "eyeBlinkLeft")
# From the header of a take; the two spellings of the count are both found.
HEADER = (
    "Timecode,BlendShapeCount,EyeBlinkLeft,EyeLookDownLeft,EyeLookInLeft,EyeLookOutLeft,"
    "EyeLookUpLeft,EyeSquintLeft,EyeWideLeft,EyeBlinkRight,EyeLookDownRight,EyeLookInRight,"
    "EyeLookOutRight,EyeLookUpRight,EyeSquintRight,EyeWideRight,JawForward,JawRight,JawLeft,"
    "JawOpen,MouthClose,MouthFunnel,MouthPucker,MouthRight,MouthLeft,MouthSmileLeft,"
    "MouthSmileRight,MouthFrownLeft,MouthFrownRight,MouthDimpleLeft,MouthDimpleRight,"
    "MouthStretchLeft,MouthStretchRight,MouthRollLower,MouthRollUpper,MouthShrugLower,"
    "MouthShrugUpper,MouthPressLeft,MouthPressRight,MouthLowerDownLeft,MouthLowerDownRight,"
    "MouthUpperUpLeft,MouthUpperUpRight,BrowDownLeft,BrowDownRight,BrowInnerUp,BrowOuterUpLeft,"
    "BrowOuterUpRight,CheekPuff,CheekSquintLeft,CheekSquintRight,NoseSneerLeft,NoseSneerRight,"
    "TongueOut,HeadYaw,HeadPitch,HeadRoll,LeftEyeYaw,LeftEyePitch,LeftEyeRoll,RightEyeYaw,"
    "RightEyePitch,RightEyeRoll"
)


def curves(names: tuple[str, ...] = ARKIT, *, end_s: float = 2.7) -> CurveSet:
    rng = np.random.default_rng(7)
    times_s = np.sort(np.append(rng.uniform(0, end_s, 60), [0.0, end_s]))
    return CurveSet(times_s, names, rng.uniform(-0.2, 1.3, (62, len(names))))


def read_plainly(path: Path) -> tuple[list[str], np.ndarray[Any, Any]]:
    """A second reader: Python's own."""
    with path.open(encoding="utf-8", newline="") as stream:
        header, *rows = csv.reader(stream)
    return header, np.array(rows)


@pytest.mark.parametrize("kind", ["csv", "json", "npz"])
def test_keys_come_back_as_they_were(kind: str, tmp_path: Path) -> None:
    path = tmp_path / f"boat.curves{SUFFIXES[kind]}"
    given = curves(("jawOpen", "Mäulchen, weit", "a b"))
    write_curves(given, path, kind)
    back, findings = read_curves(path)
    assert findings == ()
    assert back.names == given.names
    assert back.times_s.tobytes() == given.times_s.tobytes()
    np.testing.assert_array_equal(back.weights.astype(np.float32), given.weights.astype(np.float32))
    assert [entry.name for entry in tmp_path.iterdir()] == [path.name]


def test_others_read_them_too(tmp_path: Path) -> None:
    given = curves()
    for kind in ("csv", "json", "npz"):
        write_curves(given, tmp_path / f"a.{kind}", kind)
    header, cells = read_plainly(tmp_path / "a.csv")
    assert header == ["time_s", *ARKIT]
    np.testing.assert_allclose(cells.astype(np.float64)[:, 1:], given.weights, atol=1e-7)
    document = json.loads((tmp_path / "a.json").read_text(encoding="utf-8"))
    documents.KINDS["curves"].model_validate(document)
    assert document["curves"]["jawOpen"] == given.curve("jawOpen").tolist()
    with np.load(tmp_path / "a.npz", allow_pickle=False) as data:
        assert data["names"].tolist() == list(ARKIT)
        np.testing.assert_array_equal(data["weights"], given.weights)


@pytest.mark.parametrize("rate", [None, "23.976", "25", "29.97df", "29.97", "48"])
def test_live_link_has_the_curve_at_each_frame(rate: str | None, tmp_path: Path) -> None:
    path = tmp_path / "a.csv"
    given, frame_rate = curves(end_s=61.0), RATES[rate] if rate else None
    assert write_curves(given, path, "livelink-csv", frame_rate=frame_rate) == ()
    header, cells = read_plainly(path)
    assert ",".join(header) == HEADER
    times_s = (frame_rate or RATES["60"]).times_s(61.0)
    assert len(cells) == len(times_s)
    assert set(cells[:, 1]) == {"61"}
    for name in ARKIT:
        column = cells[:, header.index(name[0].upper() + name[1:])].astype(np.float32)
        expected = given.sample(times_s)[:, ARKIT.index(name)]
        np.testing.assert_array_equal(column, expected.astype(np.float32))
    assert (cells[:, header.index("HeadYaw")] == "0").all()
    back, findings = read_curves(path, frame_rate=frame_rate)
    assert findings == ()
    assert len(back.names) == 52
    np.testing.assert_allclose(back.times_s, times_s, rtol=0, atol=1e-12)
    np.testing.assert_allclose(
        back.curve("browInnerUp"), given.sample(times_s)[:, 2], rtol=0, atol=1e-7
    )


def test_a_take_in_drop_frame_is_labelled_so(tmp_path: Path) -> None:
    path = tmp_path / "a.csv"
    write_curves(curves(end_s=61.0), path, "livelink-csv", frame_rate=RATES["29.97df"])
    labels = read_plainly(path)[1][:, 0]
    assert labels[0] == "00:00:00;00.000"
    assert labels[1799:1802].tolist() == [
        "00:00:59;29.000", "00:01:00;02.000", "00:01:00;03.000",
    ]  # fmt: skip


@pytest.mark.parametrize("rate", ["24", "25", "30", "48", "50", "60", "29.97df", "59.94df"])
def test_a_take_tells_its_rate(rate: str, tmp_path: Path) -> None:
    path = tmp_path / "a.csv"
    write_curves(curves(), path, "livelink-csv", frame_rate=RATES[rate])
    back, _ = read_curves(path)
    np.testing.assert_allclose(back.times_s, RATES[rate].times_s(2.7), rtol=0, atol=1e-9)


def test_live_link_takes_the_rig_s_word_for_a_shape(tmp_path: Path) -> None:
    rig: BoundRig = registry.stage("bind-rig")("auto", load_character(SAMPLE / "ada.glb"), Path())
    renamed = BoundRig(rig.profile, {"jawOpen": "Kiefer", "mouthClose": "Mund"}, ())
    given = curves(("Kiefer", "tail", "mouthFunnel"))
    (finding,) = write_curves(given, tmp_path / "a.csv", "livelink-csv", rig=renamed)
    assert (finding.code, finding.severity.label) == ("curves-left-out", "info")
    assert finding.message.endswith("for tail")
    back, _ = read_curves(tmp_path / "a.csv")
    moving = {name for name in back.names if back.curve(name).any()}
    assert moving == {"jawOpen", "mouthFunnel"}


def test_live_link_is_refused_where_nothing_is_arkit_s(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="curves-not-arkit"):
        write_curves(curves(("MawGape",)), tmp_path / "a.csv", "livelink-csv")
    assert list(tmp_path.iterdir()) == []


def test_empty_cells_are_no_keys(tmp_path: Path) -> None:
    path = tmp_path / "a.csv"
    path.write_text("time_s,jawOpen,mouthClose\n0,0,\n1,,0.5\n2,1,\n", encoding="utf-8")
    back, findings = read_curves(path)
    assert findings == ()
    assert back == CurveSet([0, 1, 2], ARKIT[:2], [[0, 0.5], [0.5, 0.5], [1, 0.5]])


def test_frames_are_counted_at_the_job_s_rate(tmp_path: Path) -> None:
    path = tmp_path / "a.csv"
    path.write_text("frame;jawOpen\n0;0,5\n24000;1\n", encoding="utf-8")
    with pytest.raises(InputError, match=r"motion-rate") as caught:
        read_curves(path)
    assert "frame_rate" in caught.value.action
    back, _ = read_curves(path, frame_rate=RATES["23.976"])
    assert back.times_s[-1] == pytest.approx(1001.0, abs=1e-9)


REFUSED = {
    "no time": ("a.csv", b"jawOpen\n0\n1\n", "motion-no-time"),
    "back": ("a.csv", b"time_s,a\n0,1\n2,1\n1,1\n", "motion-time-order"),
    "one row": ("a.csv", b"time_s,a\n0,1\n", "motion-short"),
    "text": ("a.csv", b"time_s,a\n0,1\n1,x\n", "motion-broken"),
    "infinite": ("a.csv", b"time_s,a\n0,1\n1,inf\n", "motion-broken"),
    "no value": ("a.csv", b"time_s,a\n0,\n1,\n", "curves-empty"),
    "not text": ("a.csv", b"\xff\xfe\xfd", "motion-unreadable"),
    "no JSON": ("a.json", b"{", "document-unreadable"),
    "another kind": ("a.json", b'{"schema": "animeme.job/1"}', "document-kind"),
    "from the future": ("a.json", b'{"schema": "animeme.curves/2"}', "document-kind"),
    "uneven": (
        "a.json",
        b'{"schema": "animeme.curves/1", "times_s": [0, 1], "curves": {"a": [0]}}',
        "curves-broken",
    ),
    "NaN": (
        "a.json",
        b'{"schema": "animeme.curves/1", "times_s": [0, 1], "curves": {"a": [0, NaN]}}',
        "document-invalid",
    ),
    "no NPZ": ("a.npz", b"PK\x03\x04 and no more", "curves-broken"),
    "empty": ("a.npz", b"", "curves-broken"),
    "a pickle": ("a.npz", pickle.dumps({"times_s": [0]}), "curves-broken"),
}


@pytest.mark.parametrize("case", REFUSED)
def test_damaged_files_are_refused(case: str, tmp_path: Path) -> None:
    name, content, code = REFUSED[case]
    (tmp_path / name).write_bytes(content)
    with pytest.raises(InputError) as caught:
        read_curves(tmp_path / name)
    assert caught.value.code == code
    assert caught.value.place.startswith(str(tmp_path / name))
    assert caught.value.action


ARRAYS: dict[str, Any] = {
    "times_s": np.array([0.0, 1.0]), "names": np.array(["a"]), "weights": np.zeros((2, 1)),
}  # fmt: skip


@pytest.mark.parametrize(
    ("change", "word"),
    [
        ({"weights": np.zeros((3, 1))}, "shape"),
        ({"times_s": np.array([1.0, 0.0])}, "increasing"),
        ({"weights": np.full((2, 1), np.nan)}, "not finite"),
        ({"names": np.array([object()])}, "pickle"),
        ({"times_s": np.array(["x", "y"])}, "convert"),
    ],
)
def test_arrays_that_do_not_fit_are_refused(
    change: dict[str, Any], word: str, tmp_path: Path
) -> None:
    np.savez(tmp_path / "a.npz", **{**ARRAYS, **change})
    with pytest.raises(InputError, match=word):
        read_curves(tmp_path / "a.npz")


def test_every_cut_of_an_npz_is_refused(tmp_path: Path) -> None:
    write_curves(curves(), tmp_path / "whole.npz", "npz")
    data = (tmp_path / "whole.npz").read_bytes()
    for length in range(0, len(data), 97):
        (tmp_path / "a.npz").write_bytes(data[:length])
        with pytest.raises(InputError, match="curves-broken"):
            read_curves(tmp_path / "a.npz")


def test_an_array_that_is_missing_is_named(tmp_path: Path) -> None:
    np.savez(tmp_path / "a.npz", times_s=ARRAYS["times_s"])
    with pytest.raises(InputError, match="has no array names, weights"):
        read_curves(tmp_path / "a.npz")
