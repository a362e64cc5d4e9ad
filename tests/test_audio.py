"""Recordings: what can be heard is read, everything else is refused with its reason."""

from __future__ import annotations

import struct
from importlib.util import find_spec
from pathlib import Path

import numpy as np
import pytest
import soundfile
from hypothesis import given, settings
from hypothesis import strategies as st

from animeme.errors import InputError
from animeme.findings import Severity
from animeme_stages.ingest.audio import SPEECH_RATE_HZ, read_speech

ODD = Path(__file__).parents[2] / "shared" / "data" / "odd-audio"

# What each file is, judged from its bytes: the length in seconds where there is something to hear,
# else why there is not. The "reaper" ones hold nothing but zeros.
ODD_FILES: dict[str, float | str] = {
    "16-bit-8kHz-noBext-mono.wav": 6.0,
    "16bit-16kHz-2markers-mono.wav": 8.6874,
    "16bit-16kHz-markers-mono.wav": 7.6874,
    "16bit-8kHz-1c-reaper-region.wav": "audio-silent",
    "16bit-8kHz-1c-reaper-utf8cue-issue13.wav": "audio-silent",
    "16bit-8kHz-1c-reaper-utf8cue.wav": "audio-silent",
    "16bit-8khz-bext-mono.wav": 14.7144,
    "16bit-9khz-1c-1region-reaper.wav": "audio-silent",
    "27bit-8kHz-noBext-mono.wav": 6.0,
    "32bit-48kHz-noBext-mono.wav": 1.0,
    "32bitIEEE-16kHz-bext-mono.wav": 1.7143,
    "4-bit-imaadpcm-8kHz-noBext-mono-reaper.wav": 7.6537,
    "4bit-imaadpcm-8kHz-noBext-mono-encoded.wav": 5.9337,
    "4bit-imaadpcm-8kHz-noBext-mono.wav": 6.6281,
    "8bit-16kHz-bext-mono.wav": 13.7143,
    "8bit-alaw-8kHz-noBext-mono-encoded.wav": 6.0,
    "8bit-mulaw-8kHz-noBext-mono-encoded.wav": 6.0,
    "Audacity-16bit.wav": 3.9366,
    "LICENSE.aeneas": "audio-unreadable",
    "LICENSE.wavefile": "audio-unreadable",
    "M1F1-int12WE-AFsp-NEW-TAGS.wav": 2.9366,
    "M1F1-int12WE-AFsp.wav": 2.9366,
    "RIFX-16bit-mono.wav": 6.0,
    "ima22m.wav": 6.6416,
    "mono.empty.wav": "audio-empty",
    "mono.invalid.wav": "audio-unreadable",  # ends within its "fmt " chunk
    "mono.zero.wav": "audio-empty",
    "p001.aiff": 8.9950,
    "p001.mp3": 9.0133,  # with the encoder's padding
    "p001.mp4": 8.9950 if find_spec("av") else "extra-missing",
    "p001.ogg": 8.9950,
    "test-1234Hz-le-1ch-10S-20bit-extra.wav": "audio-too-short",
    "test-44100Hz-2ch-32bit-float-le.wav": "audio-too-short",
    "test-44100Hz-le-1ch-4bytes-early-eof-no-data.wav": "audio-unreadable",
    "test-44100Hz-le-1ch-4bytes-incomplete-chunk.wav": "audio-unreadable",
    "test-44100Hz-le-1ch-4bytes.wav": 0.1,
    "test-8000Hz-be-3ch-5S-24bit.wav": "audio-too-short",
    "test-8000Hz-le-2ch-1byteu.wav": 0.1,
    "test-8000Hz-le-3ch-5S-24bit-rf64.wav": "audio-too-short",
    "test-8000Hz-le-3ch-5S-36bit.wav": "audio-unreadable",  # libsndfile has no 36-bit samples
    "test-8000Hz-le-3ch-5S-53bit.wav": "audio-unreadable",
    "test-8000Hz-le-4ch-9S-12bit.wav": "audio-too-short",
    "test-cue-reaper.wav": "audio-silent",
}


@pytest.mark.skipif(not ODD.is_dir(), reason="../shared/data/odd-audio is not here")
def test_the_table_has_every_odd_file() -> None:
    assert sorted(path.name for path in ODD.iterdir()) == sorted(ODD_FILES)


@pytest.mark.skipif(not ODD.is_dir(), reason="../shared/data/odd-audio is not here")
@pytest.mark.parametrize("name", ODD_FILES)
def test_an_odd_file_is_read_or_refused_with_its_reason(name: str) -> None:
    expected = ODD_FILES[name]
    if isinstance(expected, str):
        require_refused(ODD / name, expected)
        return
    speech = read_speech(ODD / name)
    assert speech.source == ODD / name
    assert speech.rate_hz == SPEECH_RATE_HZ
    assert speech.duration_s == pytest.approx(expected, abs=1e-4)
    assert speech.samples.dtype == np.int16
    assert len(speech.samples) == pytest.approx(expected * SPEECH_RATE_HZ, abs=2)
    assert np.abs(speech.samples.astype(int)).max() > 1000


@pytest.mark.skipif(not ODD.is_dir(), reason="../shared/data/odd-audio is not here")
def test_one_recording_sounds_the_same_in_every_encoding() -> None:
    names = ("16-bit-8kHz-noBext-mono.wav", "RIFX-16bit-mono.wav", "27bit-8kHz-noBext-mono.wav")
    first, *others = (read_speech(ODD / name).samples for name in names)
    for other in others:
        assert np.abs(first.astype(int) - other).max() <= 1


def require_refused(path: Path, code: str) -> InputError:
    with pytest.raises(InputError) as caught:
        read_speech(path)
    assert caught.value.code == code
    assert caught.value.place == ("extra 'video'" if code == "extra-missing" else str(path))
    assert caught.value.action
    return caught.value


# Small files made here


def tone(duration_s: float = 0.25, rate_hz: int = 16_000, level: float = 0.5) -> np.ndarray:
    return level * np.sin(2 * np.pi * 440 * np.arange(round(duration_s * rate_hz)) / rate_hz)


def wav(
    samples: np.ndarray, *, promised: int | None = None, after: bytes = b"", before: bytes = b""
) -> bytes:
    """A 16-bit mono WAV at 16 kHz; `promised` is what its data chunk says it holds."""
    data = np.round(samples * 32767).astype("<i2").tobytes()
    form = struct.pack("<4sIHHIIHH", b"fmt ", 16, 1, 1, 16_000, 32_000, 2, 16)
    size = len(data) if promised is None else promised
    body = b"WAVE" + form + before + struct.pack("<4sI", b"data", size) + data + after
    return struct.pack("<4sI", b"RIFF", len(body)) + body


def test_a_missing_file_is_named(tmp_path: Path) -> None:
    require_refused(tmp_path / "none.wav", "audio-missing")
    require_refused(tmp_path, "audio-missing")


@pytest.mark.parametrize("loudest", [0, 1, 2])
def test_the_loudest_channel_is_used_and_said(loudest: int, tmp_path: Path) -> None:
    channels = np.stack([tone(level=0.1), tone(level=0.0), tone(level=0.2)], axis=1)
    channels[:, loudest] = tone(level=0.8)
    path = tmp_path / "three.wav"
    soundfile.write(path, channels, 16_000)
    speech = read_speech(path)
    np.testing.assert_allclose(speech.samples / 32768, tone(level=0.8), atol=1e-4)
    (finding,) = (f for f in speech.findings if f.code != "audio-no-speech")  # it is a tone
    assert finding.severity == Severity.INFO
    assert finding.code == "audio-channels"
    assert f"channel {loudest + 1}" in finding.message


def test_a_voice_beside_a_silent_channel_is_heard(tmp_path: Path) -> None:
    path = tmp_path / "right.wav"
    soundfile.write(path, np.stack([np.zeros(4000), tone()], axis=1), 16_000)
    assert read_speech(path).samples.any()


@pytest.mark.parametrize("rate_hz", [8_000, 11_025, 16_000, 22_050, 44_100, 48_000, 96_000])
def test_resampling_keeps_the_duration_and_the_tone(rate_hz: int, tmp_path: Path) -> None:
    path = tmp_path / "tone.wav"
    soundfile.write(path, tone(0.5, rate_hz), rate_hz)
    speech = read_speech(path)
    assert speech.duration_s == pytest.approx(0.5, abs=1e-4)
    assert len(speech.samples) == pytest.approx(8000, abs=2)
    spectrum = np.abs(np.fft.rfft(speech.samples[:8000]))
    assert np.argmax(spectrum) == 220  # bins of 2 Hz
    # A tone is no speech, at any rate.
    assert [finding.code for finding in speech.findings] == ["audio-no-speech"]


@pytest.mark.parametrize("bad", [np.nan, np.inf, -np.inf])
def test_samples_that_are_not_numbers_are_refused(bad: float, tmp_path: Path) -> None:
    samples = tone()
    samples[7] = bad
    path = tmp_path / "bad.wav"
    soundfile.write(path, samples, 16_000, subtype="FLOAT")
    assert "not numbers" in require_refused(path, "audio-unreadable").problem


@pytest.mark.parametrize("level", [1.0, 4.0, 1e6, 1e30])
def test_loud_samples_are_clipped_and_do_not_wrap_around(level: float, tmp_path: Path) -> None:
    path = tmp_path / "loud.wav"
    soundfile.write(path, np.stack([tone(level=level)] * 2, axis=1), 16_000, subtype="FLOAT")
    samples = read_speech(path).samples
    assert samples.max() == 32767
    assert samples.min() in (-32767, -32768)
    loud = np.abs(tone(level=level)) > 0.01 * level
    assert (np.sign(samples[loud]) == np.sign(tone(level=level)[loud])).all()


def test_full_scale_integers_stay_as_they_are(tmp_path: Path) -> None:
    samples = np.tile(np.array([32767, -32768, 0, 1, -1], np.int16), 1000)
    path = tmp_path / "full.wav"
    soundfile.write(path, samples, 16_000)
    np.testing.assert_array_equal(read_speech(path).samples, samples)


@pytest.mark.parametrize(
    ("level", "silent"), [(0.0, True), (0.0005, True), (0.002, False), (0.5, False)]
)
def test_silence_is_what_stays_below_60_dbfs(level: float, silent: bool, tmp_path: Path) -> None:
    path = tmp_path / "quiet.wav"
    soundfile.write(path, tone(level=level), 16_000, subtype="PCM_24")
    if silent:
        require_refused(path, "audio-silent")
    else:
        assert read_speech(path).duration_s == 0.25


def test_a_tenth_of_a_second_is_the_shortest(tmp_path: Path) -> None:
    path = tmp_path / "short.wav"
    soundfile.write(path, tone()[:1599], 16_000)
    require_refused(path, "audio-too-short")
    soundfile.write(path, tone()[:1600], 16_000)
    assert read_speech(path).duration_s == 0.1


# Headers that lie


@pytest.mark.parametrize("promised", [0, 0xFFFFFFFF])
def test_a_streamed_wav_that_promises_nothing_is_read_whole(promised: int, tmp_path: Path) -> None:
    path = tmp_path / "stream.wav"
    path.write_bytes(wav(tone(), promised=promised))
    assert read_speech(path).duration_s == 0.25


def test_chunks_around_the_sound_do_not_matter(tmp_path: Path) -> None:
    path = tmp_path / "chunks.wav"
    odd = b"note" + struct.pack("<I", 3) + b"abc\0"
    path.write_bytes(wav(tone(), before=odd, after=odd + b"LIST" + struct.pack("<I", 0)))
    assert read_speech(path).duration_s == 0.25


@pytest.mark.parametrize("missing", [1, 2, 3, 1000, 7990])
def test_a_wav_that_was_cut_says_so(missing: int, tmp_path: Path) -> None:
    path = tmp_path / "cut.wav"
    path.write_bytes(wav(tone())[:-missing])
    assert "cut off" in require_refused(path, "audio-truncated").problem


SMALL = wav(tone(0.11))


@given(st.integers(0, len(SMALL) - 1))
@settings(deadline=None, derandomize=True, max_examples=120)
def test_a_wav_cut_anywhere_never_passes(tmp_path_factory: pytest.TempPathFactory, at: int) -> None:
    path = tmp_path_factory.getbasetemp() / "anywhere.wav"
    path.write_bytes(SMALL[:at])
    with pytest.raises(InputError):
        read_speech(path)


@pytest.mark.parametrize("at", range(60))
def test_a_wav_cut_within_its_headers_never_passes(at: int, tmp_path: Path) -> None:
    path = tmp_path / "header.wav"
    path.write_bytes(SMALL[:at])
    with pytest.raises(InputError):
        read_speech(path)


@pytest.mark.parametrize("share", [0.2, 0.5, 0.9])
@pytest.mark.parametrize(
    ("suffix", "form", "subtype"),
    [
        (".flac", "FLAC", "PCM_16"),
        (".aiff", "AIFF", "PCM_16"),
        (".wav", "RF64", "PCM_16"),
        (".wav", "WAVEX", "PCM_24"),
        (".wav", "WAV", "IMA_ADPCM"),
        (".ogg", "OGG", "VORBIS"),
    ],
)
def test_a_recording_cut_in_the_middle_never_passes(
    suffix: str, form: str, subtype: str, share: float, tmp_path: Path
) -> None:
    path = tmp_path / f"cut{suffix}"
    noise = np.random.default_rng(0).uniform(-0.5, 0.5, 32_000)
    soundfile.write(path, noise, 16_000, format=form, subtype=subtype)
    assert read_speech(path).duration_s == pytest.approx(2.0, abs=0.1)
    data = path.read_bytes()
    path.write_bytes(data[: round(len(data) * share)])
    with pytest.raises(InputError):
        read_speech(path)


@given(
    st.binary(max_size=200), st.sampled_from((b"", SMALL[:36], b"fLaC", b"OggS", b"FORM", b"ID3"))
)
@settings(deadline=None, derandomize=True, max_examples=120)
def test_any_bytes_are_refused_properly(
    tmp_path_factory: pytest.TempPathFactory, data: bytes, head: bytes
) -> None:
    path = tmp_path_factory.getbasetemp() / "any.wav"
    path.write_bytes(head + data)
    with pytest.raises(InputError):
        read_speech(path)


@pytest.mark.parametrize("name", ["näme 😀.wav", "line\nbreak.wav", "100%s {}.wav"])
def test_any_file_name_can_be_read_and_refused(name: str, tmp_path: Path) -> None:
    path = tmp_path / name
    path.write_bytes(wav(tone()))
    assert read_speech(path).duration_s == 0.25
    path.write_bytes(b"nonsense")
    require_refused(path, "audio-unreadable")
