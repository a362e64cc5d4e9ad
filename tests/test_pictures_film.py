"""Films of a line: their length, their streams, and which moments a strip shows."""

from __future__ import annotations

import shutil
import sys
from pathlib import Path

import numpy as np
import pytest
import soundfile

from animeme import registry
from animeme.errors import InputError
from animeme.phones import Phone, PhoneTrack, Word
from animeme_stages.pictures import encode, style
from animeme_stages.pictures.film import caption
from animeme_stages.pictures.moments import moments_of
from test_pictures_strip import CRAB, LINE, TRACK, speaking

RATE_HZ = 8000  # AAC does not know it: brought to one that it knows


@pytest.fixture(scope="module")
def crab(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return speaking(CRAB, tmp_path_factory.mktemp("crab") / "crab.glb", "MawGape")


@pytest.fixture
def voice(tmp_path: Path) -> Path:
    """A recording of 1.2 s, loud in its second half."""
    samples = 0.2 * np.sin(np.arange(round(1.2 * RATE_HZ)) * 0.3)
    samples[: len(samples) // 2] = 0.0
    soundfile.write(tmp_path / "ama.wav", samples, RATE_HZ)
    return tmp_path / "ama.wav"


def make(crab: Path, voice: Path | None, output: Path, **options: object) -> None:
    registry.stage("film")(crab, LINE, voice, TRACK, output, rate_hz=10.0, height_px=120, **options)


def check(output: Path) -> None:
    """The film is as long as the recording, in sight and sound; read by PyAV."""
    av = pytest.importorskip("av")
    with av.open(str(output)) as film:
        (video,), (audio,) = film.streams.video, film.streams.audio
        assert (video.codec_context.name, audio.codec_context.name) == ("h264", "aac")
        assert (video.width, video.height) == (120, 120)
        frames = [frame.to_ndarray(format="rgb24") for frame in film.decode(video)]
        assert len(frames) == 12
        assert film.duration / 1e6 == pytest.approx(1.2, abs=0.1)
        film.seek(0)
        sound = np.concatenate([f.to_ndarray()[0] for f in film.decode(audio)])
        seconds = len(sound) / audio.rate
        assert seconds == pytest.approx(1.2, abs=0.15)
        loud = np.abs(sound) > 0.05
        assert loud.mean() == pytest.approx(0.4, abs=0.15)
        assert np.argmax(loud) / audio.rate == pytest.approx(0.6, abs=0.05)
    mouth = [frame[:95].astype(int) for frame in frames]
    # Open in the vowels, as at rest in the bilabial between them.
    assert np.abs(mouth[3] - mouth[0]).max() > 60
    assert np.abs(mouth[6] - mouth[0]).max() < 40


def test_film_is_as_long_as_its_recording(crab: Path, voice: Path, tmp_path: Path) -> None:
    pytest.importorskip("av")
    make(crab, voice, tmp_path / "a.mp4")
    make(crab, voice, tmp_path / "b.mp4")
    check(tmp_path / "a.mp4")
    assert (tmp_path / "a.mp4").read_bytes() == (tmp_path / "b.mp4").read_bytes()


@pytest.mark.skipif(shutil.which("ffmpeg") is None, reason="no ffmpeg on PATH")
def test_program_writes_the_same_film(
    crab: Path, voice: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    with monkeypatch.context() as patch:
        patch.setitem(sys.modules, "av", None)
        make(crab, voice, tmp_path / "a.mp4")
    check(tmp_path / "a.mp4")


def test_nothing_that_writes_films(
    crab: Path, voice: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(sys.modules, "av", None)
    monkeypatch.setenv("PATH", str(tmp_path))
    with pytest.raises(InputError) as caught:
        make(crab, voice, tmp_path / "a.mp4")
    assert caught.value.code == "extra-missing"
    assert "animeme[video]" in caught.value.action
    assert not (tmp_path / "a.mp4").exists()


def test_film_without_sound(crab: Path, tmp_path: Path) -> None:
    av = pytest.importorskip("av")
    registry.stage("film")(crab, LINE, None, None, tmp_path / "a.mp4", rate_hz=5.0, height_px=120)
    with av.open(str(tmp_path / "a.mp4")) as film:
        assert not film.streams.audio
        assert film.streams.video[0].frames == 6


@pytest.mark.parametrize("name", ["film.mov", "file/film.mp4"])
def test_output_that_cannot_be(crab: Path, voice: Path, tmp_path: Path, name: str) -> None:
    (tmp_path / "file").write_text("")
    with pytest.raises(InputError) as caught:
        make(crab, voice, tmp_path / name)
    assert caught.value.code in ("output-suffix", "output-unwritable")
    assert sorted(path.name for path in tmp_path.iterdir()) == ["ama.wav", "file"]


def test_encoder_that_fails_leaves_nothing(
    crab: Path, voice: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    pytest.importorskip("av")
    monkeypatch.setattr(encode, "_VIDEO", {"preset": "no such preset"})
    with pytest.raises(InputError) as caught:
        make(crab, voice, tmp_path / "a.mp4")
    assert caught.value.code == "output-unwritable"
    assert [path.name for path in tmp_path.iterdir()] == ["ama.wav"]


@pytest.mark.parametrize(
    ("rate_hz", "fraction"), [(29.97, "30000/1001"), (30, "30"), (12.5, "25/2")]
)
def test_rates_are_those_of_film(rate_hz: float, fraction: str) -> None:
    assert str(encode._fraction(rate_hz)) == fraction


def test_caption_shows_the_word_that_is_spoken() -> None:
    spoken, silent = (np.asarray(caption(TRACK, time_s, (200, 40))) for time_s in (0.6, 0.1))
    assert (spoken[:22] < 90).any()
    assert not (silent[:22] < 90).any()
    assert (silent[22:] < 200).any()  # the time
    foreign = PhoneTrack("he", "ipa", (Phone("a", 0.0, 1.0),), (Word("שלום", 0.0, 1.0),))
    assert not (np.asarray(caption(foreign, 0.5, (200, 40)))[:22] < 90).any()


def test_moments_are_of_what_can_be_seen() -> None:
    symbols = ["sil", "HH", "AH", "L", "OW", "M", "AA", "P", "sil", "F", "AY", "V", "sil"]
    phones = tuple(Phone(s, 0.1 * k, 0.1 * (k + 1)) for k, s in enumerate(symbols))
    track = PhoneTrack("en", "arpabet", phones)
    shown = [moment.symbol for moment in moments_of(track, track.duration_s, 4)]
    assert shown == ["AH", "M", "AA", "F"]
    everything = moments_of(track, track.duration_s, 40)
    assert [moment.symbol for moment in everything] == [s for s in symbols if s != "sil"]
    # Within the closure of /p/, not its release.
    assert everything[6].time_s == pytest.approx(0.73)


def test_moments_of_silence_are_even() -> None:
    track = PhoneTrack("en", "arpabet", (Phone("sil", 0.0, 1.0),))
    assert [m.time_s for m in moments_of(track, 1.0, 2)] == [0.25, 0.75]
    assert [m.time_s for m in moments_of(None, 1.0, 2)] == [0.25, 0.75]


def test_typeface_says_what_it_lacks() -> None:
    assert style.writable("ʃʒŋˈæ Ω Ж ß")
    assert not style.writable("語")
