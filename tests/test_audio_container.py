"""Sound of films: read with the extra, refused clearly without it."""

from __future__ import annotations

import sys
from fractions import Fraction
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import soundfile

from animeme.dialogue import find_lines
from animeme.errors import InputError
from animeme_stages.ingest.audio import SPEECH_RATE_HZ, read_speech
from animeme_stages.ingest.audio_container import _from_zero
from conftest import SAMPLE

RECORDING = SAMPLE / "dialogue" / "en" / "moon.wav"


@pytest.fixture
def av() -> Any:
    return pytest.importorskip("av", reason="the extra 'video' is not installed")


def film(av: Any, path: Path, form: str, *, picture: bool = False, sound: bool = True) -> Path:
    """A film with the sample's line as its sound; the index comes first, as for streaming."""
    samples, rate_hz = soundfile.read(RECORDING, dtype="float32")
    with av.open(str(path), "w", format=form, options={"movflags": "+faststart"}) as out:
        streams = []
        if picture:
            view = out.add_stream("mpeg4", rate=25)
            view.width = view.height = 64
            streams.append((view, av.VideoFrame.from_ndarray(np.zeros((64, 64, 3), np.uint8))))
        if sound:
            track = out.add_stream("aac", rate=rate_hz, layout="mono")
            frame = av.AudioFrame.from_ndarray(samples[None], format="fltp", layout="mono")
            frame.sample_rate, frame.pts, frame.time_base = rate_hz, 0, Fraction(1, rate_hz)
            streams.append((track, frame))
        for stream, frame in streams:
            out.mux(stream.encode(frame))
        for stream, _ in streams:
            out.mux(stream.encode(None))
    return path


def code_of(path: Path) -> str:
    with pytest.raises(InputError) as caught:
        read_speech(path)
    assert caught.value.action
    return caught.value.code


@pytest.mark.parametrize(
    ("name", "form", "picture"),
    [
        ("a.m4a", "ipod", False),
        ("a.mp4", "mp4", True),
        ("a.mov", "mov", True),
        ("a.wav", "mp4", False),
    ],
)
def test_the_sound_of_a_film_is_in_its_place(
    av: Any, name: str, form: str, picture: bool, tmp_path: Path
) -> None:
    found = read_speech(film(av, tmp_path / name, form, picture=picture))
    wanted, _ = soundfile.read(RECORDING)
    assert found.rate_hz == SPEECH_RATE_HZ
    assert found.duration_s == pytest.approx(len(wanted) / SPEECH_RATE_HZ, abs=0.001)
    assert found.findings == ()
    length = min(len(wanted), len(found.samples))
    same = np.correlate(found.samples[:length].astype(float), wanted[:length], "full")
    assert abs(int(np.argmax(same)) - (length - 1)) <= 1  # no lead-in of the encoder's


def test_a_film_cut_anywhere_never_passes(av: Any, tmp_path: Path) -> None:
    data = film(av, tmp_path / "a.mp4", "mp4").read_bytes()
    codes = set()
    for cut in range(0, len(data) - 1, len(data) // 40):
        (tmp_path / "cut.mp4").write_bytes(data[:cut])
        codes.add(code_of(tmp_path / "cut.mp4"))
    assert codes <= {"audio-empty", "audio-unreadable", "audio-truncated"}


def test_a_silent_film_has_no_sound(av: Any, tmp_path: Path) -> None:
    path = film(av, tmp_path / "a.mp4", "mp4", picture=True, sound=False)
    assert code_of(path) == "audio-empty"


def test_any_damage_is_refused_or_read(av: Any, tmp_path: Path) -> None:
    data = film(av, tmp_path / "a.mp4", "mp4").read_bytes()
    chance = np.random.default_rng(5)
    refused = 0
    for _ in range(40):
        damaged = np.frombuffer(data, np.uint8).copy()
        where = chance.integers(0, len(damaged), chance.choice((1, 5, 50)))
        damaged[where] = chance.integers(0, 256, len(where))
        (tmp_path / "b.mp4").write_bytes(damaged.tobytes())
        try:
            read_speech(tmp_path / "b.mp4")
        except InputError:
            refused += 1
    assert refused


def test_a_late_start_is_filled_and_a_lead_in_is_cut() -> None:
    samples = np.arange(1, 5, dtype=np.float32)[:, None]
    assert _from_zero(samples, 2)[:, 0].tolist() == [0, 0, 1, 2, 3, 4]
    assert _from_zero(samples, -3)[:, 0].tolist() == [4]
    assert _from_zero(samples, 0)[:, 0].tolist() == [1, 2, 3, 4]


def test_without_the_extra_its_name_is_said(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(sys.modules, "av", None)
    path = tmp_path / "a.mp4"
    path.write_bytes(b"\0\0\0\x1cftypisom" + bytes(100))
    with pytest.raises(InputError) as caught:
        read_speech(path)
    assert (caught.value.code, caught.value.place) == ("extra-missing", "extra 'video'")
    assert "a.mp4" in caught.value.problem
    assert "animeme[video]" in caught.value.action


def test_a_film_beside_a_recording_is_no_second_recording(tmp_path: Path) -> None:
    (tmp_path / "en").mkdir()
    for name in ("a.mov", "a.wav", "a.txt", "b.MP4", "b.txt", "c.m4a", "c.mov"):
        (tmp_path / "en" / name).write_bytes(b"x")
    a, b, c = find_lines(tmp_path, ())
    assert (a.audio.name, b.audio.name, a.findings, b.findings) == ("a.wav", "b.MP4", (), ())
    assert [finding.code for finding in c.findings] == ["line-duplicate"]
