"""Tracked lips to controls: known weights come back, whatever the head does meanwhile."""

from __future__ import annotations

import csv
import json
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.optimize import lsq_linear
from scipy.spatial.transform import Rotation

from animeme.cli import main
from animeme.errors import InputError
from animeme_stages.crossmap.crossmap import crossmap
from animeme_stages.crossmap.head import Head, read_head
from animeme_stages.crossmap.points import CHIN, LIPS, STILL
from animeme_stages.crossmap.solve import bounded_least_squares

Floats = NDArray[np.float64]
NUMBERS = (*LIPS, *CHIN, *STILL)
SIDES = {48: -1.0, 54: 1.0, 60: -0.9, 64: 0.9}
CONTROLS = ("jawOpen", "mouthClose", "mouthPucker", "mouthStretchLeft", "mouthStretchRight")
FRAMES = 80


def face() -> Floats:
    """68 points like a face's, x to its left, y up, z forward; only those that are used differ."""
    points = np.zeros((68, 3))
    for start, stop, height, width in ((48, 55, 0.2, 0.9), (60, 65, 0.03, 0.8)):
        x = np.linspace(-width, width, stop - start)
        points[start:stop] = np.stack([x, height * (1 - x**2) - 1.5, 1.2 - 0.3 * x**2], axis=1)
    for start, stop, height, width in ((55, 60, -0.2, 0.6), (65, 68, -0.03, 0.4)):
        x = np.linspace(width, -width, stop - start)
        points[start:stop] = np.stack([x, height * (1 - x**2) - 1.5, 1.2 - 0.3 * x**2], axis=1)
    points[[36, 39, 42, 45]] = [[-1.5, 1, 0.2], [-0.5, 1, 0.4], [0.5, 1, 0.4], [1.5, 1, 0.2]]
    points[[8, 27, 30]] = [[0, -2.8, 0.5], [0, 1, 0.7], [0, -0.2, 1.6]]
    return points


def shape(name: str) -> Floats:
    points = face()
    lower = np.isin(np.arange(68), (8, *range(55, 60), *range(65, 68)))
    lips = np.isin(np.arange(68), list(LIPS))
    if name == "jawOpen":
        points[lower, 1] -= 0.9
        points[[48, 54, 60, 64], 1] -= 0.3
    elif name == "mouthClose":
        points[lower & lips, 1] += 0.9
    elif name == "mouthPucker":
        points[lips, 0] *= 0.6
        points[50:53, 1] += 0.15  # else, from the front, it were stretching undone
        points[lips, 2] += 0.4
    else:
        side = 1.0 if name.endswith("_L") else -1.0
        points[:, 0] += 0.3 * side * lips * np.clip(points[:, 0] * side, 0, None)
    return points


def write_obj(path: Path, points: Floats) -> None:
    lines = [f"v {x:.9g} {y:.9g} {z:.9g}" for x, y, z in points]
    # Two texture coordinates at one corner: readers that follow seams would split it.
    lines += ["vt 0 0", "vt 1 1", "f 1/1 2/1 3/1", "f 1/2 3/2 4/2"]
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")


@pytest.fixture(scope="module")
def head_folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("head")
    write_obj(folder / "neutral.obj", 10.0 * face())
    for name in ("jawOpen", "mouthClose", "mouthPucker", "mouthStretch_L", "mouthStretch_R"):
        write_obj(folder / f"{name}.obj", 10.0 * shape(name))
    order = {"idx_to_landmark_verts": list(range(68))}
    (folder / "vertex_indices.json").write_text(json.dumps(order), encoding="utf-8")
    return folder


@pytest.fixture(scope="module")
def head(head_folder: Path) -> Head:
    return read_head(head_folder)


def wanted() -> Floats:
    """Weights that a mouth can have: at rest for a while, then each control in turn and mixed."""
    random = np.random.default_rng(3)
    weights = random.uniform(0, 0.5, (FRAMES, len(CONTROLS)))
    weights[:, 1] = np.minimum(weights[:, 1], weights[:, 0])
    weights[:30] = 0.0
    return weights


def tracked(head: Head, weights: Floats, *, moving: bool = True, flat: bool = False) -> Floats:
    """MediaPipe-like points (F, P, 3): pixels, y down, z away from the camera."""
    shapes = head.neutral + np.einsum("fn,nlc->flc", weights, head.deltas)
    pixels = 60.0 * shapes * (1.0, -1.0, -1.0)
    if moving:
        random = np.random.default_rng(5)
        angles = (
            random.uniform(-0.2, 0.2, (len(weights), 3)) * (0, 0, 1)
            if flat
            else (random.uniform(-0.2, 0.2, (len(weights), 3)))
        )
        turns = Rotation.from_euler("xyz", angles).as_matrix()
        scale = random.uniform(0.8, 1.2, len(weights))
        shift = random.uniform(-50, 50, (len(weights), 3))
        pixels = np.einsum("f,fij,fpj->fpi", scale, turns, pixels) + shift[:, None]
    return pixels[..., :2] if flat else pixels


def mediapipe_ids() -> list[int]:
    return [*LIPS.values(), *CHIN.values(), *STILL.values()]


def write_npz(path: Path, points: Floats, **changed: object) -> Path:
    arrays = {
        "landmarks": points[None], "clip_ids": ["take"], "landmark_ids": mediapipe_ids(),
        "rate_hz": 25.0, **changed,
    }  # fmt: skip
    np.savez(path, **{name: np.asarray(a) for name, a in arrays.items() if a is not None})
    return path


def run(landmarks: Path, head_folder: Path, output: Path, **given: object) -> object:
    settings = {
        "lines": None, "rate_hz": None, "keys": "none", "symmetric": False, "depth": 0.25,
        "ridge": 1e-6, **given,
    }  # fmt: skip
    return crossmap(landmarks, head_folder, output, **settings)  # type: ignore[arg-type]


def read_csv(path: Path) -> tuple[list[str], Floats]:
    rows = list(csv.reader(path.read_text(encoding="utf-8").splitlines()))
    return rows[0], np.array([[float(c) if c else np.nan for c in row] for row in rows[1:]])


@pytest.mark.parametrize("moving", [False, True])
@pytest.mark.parametrize("flat", [False, True])
def test_known_weights_come_back(
    head: Head, head_folder: Path, tmp_path: Path, moving: bool, flat: bool
) -> None:
    points = tracked(head, wanted(), moving=moving, flat=flat)
    found = run(write_npz(tmp_path / "l.npz", points), head_folder, tmp_path / "out")
    header, table = read_csv(tmp_path / "out" / "take.csv")
    assert header == ["time_s", *CONTROLS]
    np.testing.assert_allclose(table[:, 0], np.arange(FRAMES) / 25, atol=1e-6)
    np.testing.assert_allclose(table[:, 1:], wanted(), atol=0.01)
    assert found.residual < 0.002  # type: ignore[attr-defined]


def test_openface_csv_gives_the_same(head: Head, head_folder: Path, tmp_path: Path) -> None:
    points = tracked(head, wanted())
    header = ["frame", "timestamp"] + [f"{axis}_{n}" for axis in "XYZ" for n in NUMBERS]
    rows = [
        ", ".join(str(c) for c in (k, k / 25, *frame.T.ravel())) for k, frame in enumerate(points)
    ]
    (tmp_path / "a.csv").write_text("\n".join([", ".join(header), *rows]), encoding="utf-8")
    run(tmp_path / "a.csv", head_folder, tmp_path / "out")
    _, table = read_csv(tmp_path / "out" / "a.csv")
    np.testing.assert_allclose(table[:, 1:], wanted(), atol=0.01)


def test_key_shapes_by_hand_carry_their_controls(
    head: Head, head_folder: Path, tmp_path: Path
) -> None:
    weights = np.zeros((FRAMES, len(CONTROLS)))
    weights[40:, 0] = np.linspace(0.05, 0.8, 40)
    write_npz(tmp_path / "l.npz", tracked(head, weights))
    keys = tmp_path / "keys.csv"
    keys.write_text("take,time_s,jawOpen,mouthPucker\ntake,3.16,0.6,0.2\n", encoding="utf-8")
    found = run(tmp_path / "l.npz", head_folder, tmp_path / "out", keys=str(keys))
    _, table = read_csv(tmp_path / "out" / "take.csv")
    assert found.keys == 1  # type: ignore[attr-defined]
    np.testing.assert_allclose(table[:, 1], weights[:, 0] * 0.6 / 0.8, atol=0.01)
    np.testing.assert_allclose(table[:, 3], weights[:, 0] * 0.2 / 0.8, atol=0.01)


def test_found_key_shapes_stay_near(head: Head, head_folder: Path, tmp_path: Path) -> None:
    found = run(
        write_npz(tmp_path / "l.npz", tracked(head, wanted())), head_folder, tmp_path / "out",
        keys="auto",
    )  # fmt: skip
    assert found.keys >= 2  # type: ignore[attr-defined]
    _, table = read_csv(tmp_path / "out" / "take.csv")
    assert np.abs(table[:, 1] - wanted()[:, 0]).mean() < 0.1
    assert ((table[:, 1:] >= 0) & (table[:, 1:] <= 1)).all()


def test_both_sides_alike_on_request(head: Head, head_folder: Path, tmp_path: Path) -> None:
    run(
        write_npz(tmp_path / "l.npz", tracked(head, wanted())), head_folder, tmp_path / "out",
        symmetric=True,
    )  # fmt: skip
    _, table = read_csv(tmp_path / "out" / "take.csv")
    np.testing.assert_array_equal(table[:, 4], table[:, 5])
    assert np.ptp(table[:, 4]) > 0.1


def test_lost_points_are_gaps(head: Head, head_folder: Path, tmp_path: Path) -> None:
    points = tracked(head, wanted())
    points[50, 3] = np.nan
    points[70:] = np.nan
    found = run(write_npz(tmp_path / "l.npz", points), head_folder, tmp_path / "out")
    _, table = read_csv(tmp_path / "out" / "take.csv")
    assert len(table) == 70
    assert found.gaps == 1  # type: ignore[attr-defined]
    assert np.flatnonzero(np.isnan(table[:, 1:]).all(axis=1)).tolist() == [50]
    np.testing.assert_allclose(table[60, 1:], wanted()[60], atol=0.01)


def test_bounded_least_squares_against_scipy() -> None:
    random = np.random.default_rng(1)
    matrix, targets = random.normal(size=(20, 6)), random.normal(size=(15, 20))
    found = bounded_least_squares(matrix, targets, upper=0.3)
    for row, target in zip(found, targets, strict=True):
        np.testing.assert_allclose(row, lsq_linear(matrix, target, (0, 0.3)).x, atol=1e-4)


def test_recordings_are_linked(head: Head, head_folder: Path, tmp_path: Path) -> None:
    lines = tmp_path / "lines"
    lines.mkdir()
    (lines / "take.wav").write_bytes(b"RIFF")
    (lines / "take.txt").write_text("hello", encoding="utf-8")
    (lines / "take.csv").write_text("time_s,x\n", encoding="utf-8")
    landmarks = write_npz(tmp_path / "l.npz", tracked(head, wanted()))
    for _ in range(2):
        found = run(landmarks, head_folder, tmp_path / "out", lines=lines)
        assert found.findings == ()  # type: ignore[attr-defined]
    assert sorted(p.name for p in (tmp_path / "out").iterdir()) == [
        "take.csv", "take.txt", "take.wav",
    ]  # fmt: skip
    assert (tmp_path / "out" / "take.txt").read_text(encoding="utf-8") == "hello"
    with pytest.raises(InputError, match="folder of its own"):
        run(landmarks, head_folder, lines, lines=lines)
    assert (lines / "take.csv").read_text(encoding="utf-8") == "time_s,x\n"


@pytest.mark.parametrize(
    ("changed", "words"),
    [
        ({"clip_ids": None}, "no clip_ids"),
        ({"landmarks": None}, "has no landmarks"),
        ({"landmarks": np.zeros((1, 5, 3))}, "shape"),
        ({"landmark_ids": np.arange(3)}, "landmark_ids"),
        ({"landmark_ids": np.arange(200, 200 + len(NUMBERS))}, "lacks points 61, 40"),
        ({"landmark_ids": np.zeros(len(NUMBERS), int)}, "point twice"),
        ({"clip_ids": ["../x"]}, "called '../x'"),
        ({"clip_ids": np.array([None])}, "not a NumPy archive of numbers"),
        ({"landmarks": np.full((1, FRAMES, len(NUMBERS), 3), np.nan)}, "in no frame"),
        ({"landmarks": np.full((1, FRAMES, len(NUMBERS), 3), np.inf)}, "infinite"),
        ({"rate_hz": None}, "--motion-rate-hz"),
    ],
)
def test_bad_archives(
    head: Head, head_folder: Path, tmp_path: Path, changed: dict[str, object], words: str
) -> None:
    path = write_npz(tmp_path / "l.npz", tracked(head, wanted()), **changed)
    with pytest.raises(InputError, match=words):
        run(path, head_folder, tmp_path / "out")
    assert not (tmp_path / "out").exists()


def test_not_an_archive(head_folder: Path, tmp_path: Path) -> None:
    (tmp_path / "l.npz").write_bytes(b"PK\x03\x04 cut off")
    with pytest.raises(InputError, match="not a NumPy archive"):
        run(tmp_path / "l.npz", head_folder, tmp_path / "out")


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("", "no column of times"),
        ("time_s,x_1\n0,1\n1,2\n", "lacks column y_1"),
        ("time_s,a\n0,1\n", "no columns x_<point>"),
        ("frame,x_1,y_1\n0,1,1\n", "--motion-rate-hz"),
        ("time_s,x_1,y_1\n0,1,1\n1,1\n", "row 3 has 2 cells"),
        ("time_s,x_1,y_1\n0,1,1\n1,1,one\n", "row 3"),
        ("time_s,x_1,y_1\n0,1,1\n0,1,1\n", "do not increase"),
        ("time_s,x_1,y_1\n0,1,1\n1,1,1\n", "lacks points 48"),
    ],
)
def test_bad_csv(head_folder: Path, tmp_path: Path, text: str, words: str) -> None:
    (tmp_path / "a.csv").write_text(text, encoding="utf-8")
    with pytest.raises(InputError, match=words):
        run(tmp_path / "a.csv", head_folder, tmp_path / "out")


def test_bad_heads(head: Head, head_folder: Path, tmp_path: Path) -> None:
    landmarks = write_npz(tmp_path / "l.npz", tracked(head, wanted()))
    broken = tmp_path / "head"
    broken.mkdir()
    with pytest.raises(InputError, match="0 neutral faces"):
        run(landmarks, broken, tmp_path / "out")
    write_obj(broken / "neutral.obj", face())
    write_obj(broken / "jawOpen.obj", face()[:60])
    with pytest.raises(InputError, match="no such file"):
        run(landmarks, broken, tmp_path / "out")
    indices = broken / "vertex_indices.json"
    for listed, words in (([1, 2], "68 vertices"), (list(range(60, 128)), "names vertex 127")):
        indices.write_text(json.dumps(listed), encoding="utf-8")
        with pytest.raises(InputError, match=words):
            run(landmarks, broken, tmp_path / "out")
    indices.write_text(json.dumps(list(range(68))), encoding="utf-8")
    with pytest.raises(InputError, match="has 60 vertices"):
        run(landmarks, broken, tmp_path / "out")


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("take,time_s\n", "no rows"),
        ("take,time_s,brow\ntake,1,0.5\n", "no control brow"),
        ("take,time_s,jawOpen\ntake,1,1.5\n", "beyond 0 to 1"),
        ("take,time_s\nother,1\n", "no usable frame"),
    ],
)
def test_bad_keys(head: Head, head_folder: Path, tmp_path: Path, text: str, words: str) -> None:
    landmarks = write_npz(tmp_path / "l.npz", tracked(head, wanted()))
    (tmp_path / "keys.csv").write_text(text, encoding="utf-8")
    with pytest.raises(InputError, match=words):
        run(landmarks, head_folder, tmp_path / "out", keys=str(tmp_path / "keys.csv"))


def test_one_bad_file_of_a_folder_stops_nothing(
    head: Head, head_folder: Path, tmp_path: Path
) -> None:
    takes = tmp_path / "takes"
    takes.mkdir()
    header = ["time_s"] + [f"{axis}_{n}" for n in NUMBERS for axis in "xyz"]
    rows = [
        ",".join(str(c) for c in (k / 25, *f.ravel()))
        for k, f in enumerate(tracked(head, wanted()))
    ]
    (takes / "good.csv").write_text("\n".join([",".join(header), *rows]), encoding="utf-8")
    (takes / "bad.csv").write_text("nothing\n", encoding="utf-8")
    found = run(takes, head_folder, tmp_path / "out")
    assert [f.code for f in found.findings] == ["landmarks-invalid"]  # type: ignore[attr-defined]
    assert [p.name for p in (tmp_path / "out").iterdir()] == ["good.csv"]


def test_command(
    head: Head, head_folder: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    landmarks = write_npz(tmp_path / "l.npz", tracked(head, wanted()))
    arguments = ["--character", str(head_folder), "--output", str(tmp_path / "out")]
    with pytest.raises(SystemExit) as ended:
        main(["crossmap", str(landmarks), *arguments, "--keys", "none", "--json"])
    assert ended.value.code == 0
    said = json.loads(capsys.readouterr().out)
    assert said["takes"] == 1
    assert 0 <= said["residual"] < 0.05
    with pytest.raises(SystemExit) as ended:
        main(["crossmap", str(tmp_path / "none.npz"), *arguments])
    assert ended.value.code == 2
    assert "no such file" in capsys.readouterr().err


@pytest.mark.slow
def test_real_lips_on_a_real_head(shared: Path, tmp_path: Path) -> None:
    whole = np.load(shared / "data" / "grid-s1" / "landmarks.npz")
    part = {n: whole[n][:8] if n in ("landmarks_px", "clip_ids") else whole[n] for n in whole.files}
    np.savez(tmp_path / "l.npz", **part)
    found = run(
        tmp_path / "l.npz", shared / "assets" / "ict", tmp_path / "out", ridge=0.01,
        lines=shared / "data" / "grid-s1" / "lines", symmetric=True,
    )  # fmt: skip
    assert found.residual < 0.02  # type: ignore[attr-defined]
    head = read_head(shared / "assets" / "ict")
    upper, lower = head.rows((61, 62, 63)), head.rows((67, 66, 65))
    parting = (head.deltas[:, upper, 1] - head.deltas[:, lower, 1]).mean(axis=1)
    for name in part["clip_ids"]:
        header, table = read_csv(tmp_path / "out" / f"{name}.csv")
        _, measured = read_csv(shared / "data" / "grid-s1" / "lines" / f"{name}.csv")
        assert tuple(header[1:]) == head.controls
        # The head's lips part as the corpus's own measure of them says.
        gap, count = table[:, 1:] @ parting, min(len(table), len(measured))
        assert np.corrcoef(gap[:count], measured[:count, 1])[0, 1] > 0.95
        assert (tmp_path / "out" / f"{name}.flac").is_file()
