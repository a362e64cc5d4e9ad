"""Reading captured motion: the formats, the gaps, and everything that can be wrong."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

import animeme
from animeme.dataset import folds, holdout
from animeme.errors import InputError
from animeme.findings import Severity
from animeme_stages.dataset.folder import read_dataset
from animeme_stages.dataset.motion import read_motion
from support.motion import CONTROLS, captured, captured_line, write_line, write_motion


def put(folder: Path, text: str, name: str = "a.csv") -> Path:
    path = folder / name
    path.write_text(text, encoding="utf-8")
    return path


def test_our_own_files(tmp_path: Path) -> None:
    found = read_motion(put(tmp_path, "time_s,jaw,lips\n0,0.1,0.2\n0.04,,0.3\n"))
    assert found.controls == ("jaw", "lips")
    np.testing.assert_array_equal(found.times_s, [0, 0.04])
    np.testing.assert_array_equal(found.values, [[0.1, 0.2], [np.nan, 0.3]])


LIVE_LINK = (
    "Timecode,BlendShapeCount,EyeBlinkLeft,JawOpen,MouthFunnel,HeadYaw\n"
    "23:59:59:58.250,61,0.1,0.2,0.3,0.4\n23:59:59:59.250,61,0.1,0.25,0.3,0.4\n"
    "00:00:00:00.250,61,0.1,0.3,0.35,0.4\n"
)


def test_live_link_face(tmp_path: Path) -> None:
    """Its names become ARKit's, its timecodes seconds from the start, over midnight too."""
    found = read_motion(put(tmp_path, LIVE_LINK))
    assert found.controls == ("jawOpen", "mouthFunnel")
    np.testing.assert_allclose(found.times_s, [0, 1 / 60, 2 / 60], atol=1e-9)
    np.testing.assert_allclose(found.values[:, 0], [0.2, 0.25, 0.3])


@pytest.mark.parametrize(
    ("text", "times"),
    [
        ("frame;jaw\n10;0,5\n11;0,75\n", [10 / 24, 11 / 24]),
        ("Frame\tjaw\n0\t0.5\n12\t0.75\n", [0, 0.5]),
        ("seconds,jaw\r\n0.5,0.5\r\n0.75,0.75\r\n", [0.5, 0.75]),
        ("\ufefftime,jaw\n0.5,0.5\n\n0.75,0.75\n", [0.5, 0.75]),
    ],
)
def test_exports_of_animation_tools(tmp_path: Path, text: str, times: list[float]) -> None:
    found = read_motion(put(tmp_path, text), rate_hz=24)
    np.testing.assert_allclose(found.times_s, times)
    np.testing.assert_allclose(found.values[:, 0], [0.5, 0.75])


@pytest.mark.parametrize(
    ("text", "code", "said"),
    [
        ("jaw,lips\n0,1\n1,2\n", "motion-no-time", "no time column"),
        ("frame,jaw\n0,1\n1,2\n", "motion-rate", "frame"),
        ("time_s,jaw\n0,1\n0.2,1\n0.1,1\n", "motion-time-order", "row 4 time goes back to 0.1 s"),
        ("time_s,jaw\n0,1\n0,1\n", "motion-time-order", "stays at"),
        ("time_s,jaw\n0,1\n", "motion-short", "1 frame"),
        ("time_s,jaw\n", "motion-short", "0 frames"),
        ("time_s,jaw\n0,1\n0.1,open\n", "motion-broken", "'open' for 'jaw'"),
        ("time_s,jaw\n0,1\n0.1,inf\n", "motion-broken", "inf"),
        ("time_s,jaw\n0,1\nnan,1\n", "motion-broken", "time 'nan'"),
        ("time_s,jaw\n0,1\n0.1\n", "motion-broken", "1 cells"),
        ("time_s,jaw,jaw\n0,1,1\n0.1,1,1\n", "motion-columns", "two columns called jaw"),
        ("time_s,jaw,\n0,1,1\n0.1,1,1\n", "motion-columns", "without a name"),
        ("time_s\n0\n0.1\n", "motion-columns", "no control"),
        ("", "motion-empty", "empty"),
        ("Timecode,JawOpen\nsoon,1\n", "motion-broken", "timecode"),
    ],
)
def test_what_cannot_be_read_is_refused(tmp_path: Path, text: str, code: str, said: str) -> None:
    with pytest.raises(InputError) as caught:
        read_motion(put(tmp_path, text))
    assert caught.value.code == code
    assert said in caught.value.problem
    assert "a.csv" in caught.value.place
    assert caught.value.action


@pytest.mark.parametrize("data", [b"\xff\x00\x01\x02", b"\x80\x04\x95pickle", b"PK\x03\x04\xff"])
def test_files_that_are_no_text(tmp_path: Path, data: bytes) -> None:
    (tmp_path / "a.csv").write_bytes(data)
    with pytest.raises(InputError):
        read_motion(tmp_path / "a.csv")


def test_nan_is_a_gap_and_mentioned(tmp_path: Path) -> None:
    found = read_motion(put(tmp_path, "time_s,jaw\n0,NaN\n0.1,1\n0.2,nan\n"))
    assert np.isnan(found.values[:, 0]).tolist() == [True, False, True]
    assert [f.code for f in found.findings] == ["motion-nan"]


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    for line in captured(lines=3).lines:
        write_line(tmp_path, line)
    return tmp_path


def test_a_folder(folder: Path) -> None:
    found = read_dataset(folder)
    assert found.controls == CONTROLS
    assert [line.id for line in found.lines] == ["line000", "line001", "line002"]
    assert found.findings == ()
    expected = captured(lines=3).lines[1]
    assert found.lines[1].track.ipa() == expected.track.ipa()
    np.testing.assert_allclose(found.lines[1].values, expected.values, atol=1e-6)


def no_audio(folder: Path) -> None:
    (folder / "line001.wav").unlink()


def no_motion(folder: Path) -> None:
    (folder / "line001.csv").unlink()


def no_text(folder: Path) -> None:
    (folder / "line001.txt").unlink()
    (folder / "line001.TextGrid").unlink()


def two_recordings(folder: Path) -> None:
    (folder / "line001.flac").write_bytes((folder / "line001.wav").read_bytes())


def broken_motion(folder: Path) -> None:
    (folder / "line001.csv").write_text("time_s,lip_gap\n1,0\n0,0\n", encoding="utf-8")


def broken_audio(folder: Path) -> None:
    (folder / "line001.wav").write_bytes(b"RIFF")


def broken_timings(folder: Path) -> None:
    (folder / "line001.TextGrid").write_text("File type", encoding="utf-8")


def motion_elsewhere(folder: Path) -> None:
    rows = "time_s,lip_gap\n100,0\n101,0.5\n"
    (folder / "line001.csv").write_text(rows, encoding="utf-8")


@pytest.mark.parametrize(
    ("harm", "code"),
    [
        (no_audio, "dataset-no-audio"),
        (no_motion, "dataset-no-motion"),
        (no_text, "dataset-no-text"),
        (two_recordings, "line-duplicate"),
        (broken_motion, "motion-time-order"),
        (broken_audio, "audio"),
        (broken_timings, "timings"),
        (motion_elsewhere, "motion-outside"),
    ],
)
def test_one_bad_line_is_reported_and_left_out(
    folder: Path, harm: Callable[[Path], None], code: str
) -> None:
    whole = read_dataset(folder)
    harm(folder)
    found = read_dataset(folder)
    assert [line.id for line in found.lines] == ["line000", "line002"]
    mine = [finding for finding in found.findings if finding.line == "line001"]
    assert any(finding.code.startswith(code) for finding in mine)
    assert all(finding.severity >= Severity.WARNING and finding.action for finding in mine)
    for path in folder.glob("line001.*"):
        path.unlink()
    write_line(folder, captured_line(1))
    assert read_dataset(folder).findings == whole.findings == ()


def test_a_control_missing_in_some_lines(folder: Path) -> None:
    line = captured_line(1)
    rows = (folder / "line001.csv").read_text(encoding="utf-8").replace("lip_width", "lip_wdith")
    (folder / "line001.csv").write_text(rows, encoding="utf-8")
    found = read_dataset(folder)
    assert found.controls == (*CONTROLS, "lip_wdith")
    partial = [f.message for f in found.findings if f.code == "dataset-control-partial"]
    assert len(partial) == 2
    assert "'lip_width' is missing in 1 of 3 lines" in partial
    assert np.isnan(found.lines[1].values[:, 1]).all()
    assert len(found.lines[1].times_s) == len(line.times_s)
    kept = read_dataset(folder, controls=["lip_[gw]*h", "jaw*"])
    assert kept.controls == ("lip_width", "jaw_drop", "lip_wdith")[: len(kept.controls)]


def test_still_controls_are_left_out(tmp_path: Path) -> None:
    line = captured_line(0)
    write_line(tmp_path, line)
    text = (tmp_path / "line000.csv").read_text(encoding="utf-8").splitlines()
    rows = [text[0] + ",brow", *(row + ",0.5" for row in text[1:])]
    (tmp_path / "line000.csv").write_text("\n".join(rows) + "\n", encoding="utf-8")
    found = read_dataset(tmp_path)
    assert found.controls == CONTROLS
    assert [f.code for f in found.findings] == ["dataset-control-still"]


def test_motion_longer_than_the_recording(tmp_path: Path) -> None:
    line = captured_line(0)
    write_line(tmp_path, line)
    with (tmp_path / "line000.csv").open("a", encoding="utf-8") as stream:
        stream.write("9.0,0.1,0.1,0.1\n")
    found = read_dataset(tmp_path)
    assert [f.code for f in found.findings] == ["motion-overhang"]
    assert found.lines[0].times_s[-1] <= line.track.duration_s


@pytest.mark.parametrize("harm", [no_audio, no_text, broken_motion, motion_elsewhere])
def test_a_folder_without_a_usable_line_is_refused(
    tmp_path: Path, harm: Callable[[Path], None]
) -> None:
    write_line(tmp_path, captured_line(1))
    harm(tmp_path)
    with pytest.raises(InputError) as caught:
        read_dataset(tmp_path)
    assert caught.value.action


def test_folders_that_are_none(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="no such folder"):
        animeme.read_dataset(tmp_path / "nowhere")
    with pytest.raises(InputError, match="no captured motion"):
        animeme.read_dataset(tmp_path)


def test_folds_and_holdout_depend_on_ids_alone() -> None:
    data = captured(lines=20)
    shuffled = data.subset(data.lines[::-1])
    fitted, judged = holdout(data, 0.2)
    assert len(judged.lines) == 4
    other = holdout(shuffled, 0.2)[1]
    assert {line.id for line in other.lines} == {line.id for line in judged.lines}
    assert not {line.id for line in fitted.lines} & {line.id for line in judged.lines}
    parts = folds(data, 5)
    assert sorted(index for part in parts for index in part) == list(range(20))


def test_real_lines(shared: Path, tmp_path: Path) -> None:
    """Aligned, because they have no TextGrid."""
    source = shared / "data" / "grid-s1" / "lines"
    for name in ("bbaf2n", "bbaf3s"):
        for suffix in (".flac", ".txt", ".csv"):
            (tmp_path / f"{name}{suffix}").symlink_to(source / f"{name}{suffix}")
    found = read_dataset(tmp_path)
    assert len(found.lines) == 2
    assert found.controls[0] == "lip_gap"
    assert found.lines[0].track.words


def test_motion_round_trip(tmp_path: Path) -> None:
    line = captured_line(4)
    line.values[3:6, 1] = np.nan
    write_motion(tmp_path / "a.csv", line)
    found = read_motion(tmp_path / "a.csv")
    np.testing.assert_allclose(found.values, line.values, atol=1e-6)
