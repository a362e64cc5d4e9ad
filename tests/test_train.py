"""`animeme train` and `animeme evaluate`, from the outside."""

from __future__ import annotations

import json
import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from click.testing import CliRunner, Result

import animeme
from animeme.cli import cli, main
from animeme.scoring import Closure, captured_recall, judge
from animeme.training import evaluate
from support.motion import CONTROLS, captured, captured_line, write_line


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    made: Path = tmp_path_factory.mktemp("takes")
    for line in captured(lines=10).lines:
        write_line(made, line)
    return made


def run(*arguments: object) -> Result:
    return CliRunner().invoke(cli, [str(argument) for argument in arguments], standalone_mode=False)


def code_of(arguments: list[object]) -> int:
    with pytest.raises(SystemExit) as caught:
        main([str(argument) for argument in arguments])
    return int(caught.value.code or 0)


def test_train_writes_a_model_that_load_model_reads(folder: Path, tmp_path: Path) -> None:
    output = tmp_path / "deep" / "hero.animeme"
    found = run("train", folder, "--model", "dam", "--output", output, "--set", "rounds=5",
                "depth=2", "--workers", 1, "--json")  # fmt: skip
    assert found.exception is None
    assert found.return_value == 0
    summary = json.loads(found.stdout)
    assert summary["lines"] == 10
    assert summary["controls"] == list(CONTROLS)
    assert summary["phones"]["sil"] == 20
    assert "ʃ" in summary["phones_lacking"]
    assert "English phones that the data lacks" in found.stderr
    model = animeme.load_model(output)
    assert model.name == "dam"
    assert model.controls == CONTROLS
    document = json.loads(output.read_text(encoding="utf-8"))
    assert document["config"]["rounds"] == 5
    assert document["config"]["depth"] == 2


@pytest.mark.parametrize(
    ("options", "said"),
    [
        (["--model", "damm"], "Did you mean 'dam'"),
        (["--set", "degre=3"], "Did you mean 'degree'"),
        (["--set", "degree"], "not key=value"),
        (["--controls", "nose*"], "no control matches nose*"),
    ],
)
def test_train_refuses_what_makes_no_sense(
    folder: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str], options: list[str], said: str
) -> None:
    output = tmp_path / "m.animeme"
    arguments = ["train", folder, "--output", output, "--workers", 1, *options]
    assert code_of(arguments) == 2
    assert said in capsys.readouterr().err
    assert not output.exists()


def test_a_bad_line_is_named_and_the_model_written(tmp_path: Path) -> None:
    folder = tmp_path / "takes"
    folder.mkdir()
    for line in captured(lines=4).lines:
        write_line(folder, line)
    (folder / "line002.csv").write_text("time_s,lip_gap\n1,0\n0,0\n", encoding="utf-8")
    output = tmp_path / "m.animeme"
    arguments = ["train", folder, "--model", "mmm", "--output", output, "--set", "steps=2"]
    found = run(*arguments, "--workers", 1)
    assert found.return_value == 1
    assert "line002: error motion-time-order" in found.stderr
    assert "3 lines" in found.stderr
    assert output.exists()
    write_line(folder, captured_line(2))
    assert run(*arguments, "--workers", 1).return_value == 0


def test_evaluate_prints_the_promised_json(folder: Path, tmp_path: Path) -> None:
    file = tmp_path / "m.animeme"
    animeme.save_model(animeme.train(captured(lines=6), "mmm", {"steps": "3"}), file)
    names = ["cohen-massaro", "dam:modes=none,degree=0", str(file)]
    options = ["--model", names[0], "--model", *names[1:]]
    found = run("evaluate", folder, *options, "--holdout", 0.3, "--workers", 1, "--json",
                "--plot", tmp_path / "compared")  # fmt: skip
    assert found.exception is None
    assert found.return_value == 0
    document = json.loads(found.stdout)
    assert list(document) == ["models"]
    assert list(document["models"]) == names
    for name, score in document["models"].items():
        assert list(score) == ["rmse", "closure_recall", "train_s", "synthesis_us_per_phone"]
        assert list(score["rmse"]) == list(CONTROLS)
        assert all(0 < value < 0.2 for value in score["rmse"].values())
        assert 0 <= score["closure_recall"] <= 1
        assert (score["train_s"] is None) == (name == str(file))
        assert score["synthesis_us_per_phone"] > 0
    assert "Fitted to 7 lines, judged by 3" in found.stderr
    assert (tmp_path / "compared.png").read_bytes().startswith(b"\x89PNG")
    page = (tmp_path / "compared.html").read_text(encoding="utf-8")
    assert "<svg" in page
    assert all(name in page for name in names[:2])
    assert not re.search(r'(src|href)="(?!#)', page)  # nothing is fetched


def test_plots_repeat_byte_for_byte(folder: Path, tmp_path: Path) -> None:
    for name in ("a", "b"):
        run("evaluate", folder, "--model", "bigram", "--workers", 1, "--plot", tmp_path / name)
    assert (tmp_path / "a.png").read_bytes() == (tmp_path / "b.png").read_bytes()
    assert (tmp_path / "a.html").read_bytes() == (tmp_path / "b.html").read_bytes()


@pytest.mark.parametrize(
    ("options", "said"),
    [
        (["--model", "bigram", "--closure", "lips"], "control<=value"),
        (["--model", "bigram:speed"], "key=value"),
        (["--model", "missing.animeme"], "no such file"),
        (["--model", "cohen-massaro:c=0"], "c must be"),
    ],
)
def test_evaluate_refuses_what_makes_no_sense(
    folder: Path, capsys: pytest.CaptureFixture[str], options: list[str], said: str
) -> None:
    assert code_of(["evaluate", folder, "--workers", 1, *options]) == 2
    assert said in capsys.readouterr().err


def test_a_model_of_other_controls_is_refused(folder: Path, tmp_path: Path) -> None:
    data = captured(lines=3)
    other = type(data)(("a", "b", "c"), data.lines)
    animeme.save_model(animeme.train(other, "bigram"), tmp_path / "m.animeme")
    found = run("evaluate", folder, "--model", tmp_path / "m.animeme", "--workers", 1)
    assert isinstance(found.exception, animeme.InputError)
    assert found.exception.code == "model-controls"


def test_errors_and_closures_by_hand() -> None:
    """A model that is off by a constant, and closes late, scores as worked out by hand."""

    class Off:
        name = "off"
        controls = CONTROLS

        def synthesize(self, track: Any, *, rate_hz: float) -> Any:
            line = next(item for item in data.lines if item.track is track)
            values = np.nan_to_num(line.values) + np.array([0.1, 0.0, -0.2])
            return animeme.curves.CurveSet(line.times_s, CONTROLS, values)

    import animeme.curves

    data = captured(lines=5)
    data.lines[0].values[:, 2] = np.nan
    score, _ = judge(Off(), data)  # type: ignore[arg-type]
    assert score.rmse["lip_gap"] == pytest.approx(0.1)
    assert score.rmse["lip_width"] == pytest.approx(0.0, abs=1e-12)
    assert score.rmse["jaw_drop"] == pytest.approx(0.2)
    assert score.closure_recall == 0.0
    assert judge(Off(), data, Closure("lip_gap", 0.13))[0].closure_recall == pytest.approx(  # type: ignore[arg-type]
        captured_recall(data, Closure("lip_gap", 0.03)) or 0.0
    )
    assert judge(Off(), data, Closure("nose", 0.1))[0].closure_recall is None  # type: ignore[arg-type]


def test_the_same_lines_are_held_out_for_every_model() -> None:
    data = captured(lines=10)
    found = evaluate(data, ["bigram", "mmm:steps=1"], held_out=0.3)
    assert len(found.lines) == 3
    assert found.fitted_lines == 7
    assert [len(curves) for curves in found.curves.values()] == [3, 3]


@pytest.mark.slow
def test_real_motion(shared: Path, tmp_path: Path) -> None:
    """On 60 real lines: trees beat one mode, every model beats the mean, bilabials close."""
    folder = tmp_path / "takes"
    folder.mkdir()
    source = shared / "data" / "grid-s1" / "lines"
    for audio in sorted(source.glob("*.flac"))[:120]:
        for suffix in (".flac", ".txt", ".csv"):
            (folder / f"{audio.stem}{suffix}").symlink_to(audio.with_suffix(suffix))
    data = animeme.read_dataset(folder)
    names = ["dam", "dam:modes=none,degree=0,contacts=no", "mmm", "bigram", "cohen-massaro"]
    scores = evaluate(data, names).scores
    spread = np.concatenate([line.values for line in data.lines]).std(axis=0)
    for score in scores.values():
        assert all((score.rmse[c] or 9) < s for c, s in zip(data.controls, spread, strict=True))
    for control in ("lip_gap", "lip_width", "jaw_drop", "lower_lip"):
        assert (scores[names[0]].rmse[control] or 9) < (scores[names[1]].rmse[control] or 0)
    assert scores["dam"].closure_recall == 1.0


def test_public_functions_are_functions() -> None:
    """Whatever was imported before: a module of the same name would take its place."""
    assert callable(animeme.evaluate)
    assert callable(animeme.train)
    assert callable(animeme.read_dataset)
