"""Plots of timings: `animeme align --plot`."""

from __future__ import annotations

import shutil
from pathlib import Path

import numpy as np
import pytest
import soundfile
from PIL import Image

from animeme import registry
from animeme.cli import main
from animeme.errors import InputError
from animeme.findings import Finding, Severity
from animeme.phones import Phone, PhoneTrack, Word
from animeme_stages.pictures import style
from conftest import SAMPLE

TRACK = PhoneTrack(
    "en",
    "arpabet",
    (Phone("sil", 0.0, 0.5), Phone("M", 0.5, 0.75, -6.0), Phone("AA", 0.75, 1.0, -1.0)),
    (Word("ma", 0.5, 1.0),),
)


@pytest.fixture
def voice(tmp_path: Path) -> Path:
    """One second, loud in its second half."""
    samples = np.sin(np.arange(16_000) * 0.2) * 0.5
    samples[:8_000] = 0.0
    soundfile.write(tmp_path / "ma.wav", samples, 16_000)
    return tmp_path / "ma.wav"


def plot(voice: Path, output: Path, *findings: Finding) -> np.ndarray:
    registry.stage("plot-alignment")(voice, TRACK, findings, output)
    with Image.open(output) as image:
        assert image.format == "PNG"
        assert not image.info
        return np.asarray(image.convert("RGB"))


def places(image: np.ndarray, colour: style.Rgb) -> np.ndarray:
    """Rows and columns of a colour, (N, 2)."""
    return np.argwhere((image == np.array(colour)).all(2))


def test_plot_shows_when_it_is_loud_and_how_sure_each_phone_is(voice: Path, tmp_path: Path) -> None:
    image = plot(voice, tmp_path / "ma.png")
    wave = places(image, style.SERIES[4])
    left, right = wave[:, 1].min(), wave[:, 1].max()
    per_column = np.bincount(wave[:, 1], minlength=right + 1)
    half = (left + right) // 2
    assert per_column[half + 5 : right - 2].min() > 20 > 2 > per_column[left : half - 5].max() - 1
    bars = places(image, style.SERIES[0])
    heights = np.bincount(bars[:, 1], minlength=right + 1)
    assert heights[left:half].max() == 0
    # /M/ is the least sure, /AA/ the most.
    assert 0 < heights[half + 20 : half + 200].max() < heights[right - 100 : right - 5].min()


def test_findings_are_below_in_their_colour(voice: Path, tmp_path: Path) -> None:
    plain = plot(voice, tmp_path / "a.png")
    finding = Finding(Severity.ERROR, "audio-clipped", "is clipped", place="ma.wav")
    marked = plot(voice, tmp_path / "b.png", finding)
    assert marked.shape[0] > plain.shape[0]
    assert not len(places(plain, style.ERROR))
    assert len(places(marked, style.ERROR))
    many = plot(voice, tmp_path / "c.png", *[finding] * 200)
    assert many.shape[0] < 1000


def test_same_bytes_twice(voice: Path, tmp_path: Path) -> None:
    for name in ("a.png", "b.png"):
        plot(voice, tmp_path / name)
    assert (tmp_path / "a.png").read_bytes() == (tmp_path / "b.png").read_bytes()


def test_recording_that_is_gone_leaves_nothing(tmp_path: Path) -> None:
    with pytest.raises(InputError) as caught:
        plot(tmp_path / "gone.wav", tmp_path / "a.png")
    assert caught.value.code == "audio-missing"
    assert not list(tmp_path.iterdir())


def code_of(*arguments: str) -> object:
    with pytest.raises(SystemExit) as ended:
        main(list(arguments))
    return ended.value.code


def test_command_draws_every_line(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    lines = tmp_path / "lines"
    lines.mkdir()
    for suffix in (".wav", ".txt"):
        shutil.copy(SAMPLE / "dialogue" / "en" / f"five{suffix}", lines)
    arguments = ["align", str(lines), "--executor", "inline", "--plot"]
    assert code_of(*arguments, str(tmp_path / "plots")) == 0
    assert f"'{tmp_path / 'plots'}'" in capsys.readouterr().out
    (picture,) = (tmp_path / "plots").rglob("*.png")
    assert picture.name == "five.png"
    # A picture of the user's beside a recording is not overwritten.
    (lines / "five.png").write_bytes(b"theirs")
    assert code_of(*arguments, str(lines)) == 2
    assert "output-is-input" in capsys.readouterr().err
    assert (lines / "five.png").read_bytes() == b"theirs"
