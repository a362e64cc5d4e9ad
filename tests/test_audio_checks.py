"""What can be heard of a recording before anything is aligned: faults, channels, no speech."""

from __future__ import annotations

from functools import cache
from pathlib import Path

import numpy as np
import pytest
import soundfile
import soxr

from animeme.contracts import Speech
from animeme.errors import InputError
from animeme.findings import Severity
from animeme.phones import SILENCE, Phone, PhoneTrack, contiguous
from animeme_stages.align.rate import FASTEST_HZ, SLOWEST_HZ, rate_doubt, speaking_rate
from animeme_stages.ingest.audio import read_speech
from animeme_stages.ingest.audio_speech import _BLOCK, _HOP, measure
from conftest import LANGUAGES, SAMPLE
from support.sounds import RATE_HZ, SOUNDS

LINES = ("boat", "count", "five", "moon", "think", "welcome")


@cache
def voice(line: str = "moon", language: str = "en") -> np.ndarray:
    samples, rate_hz = soundfile.read(SAMPLE / "dialogue" / language / f"{line}.wav")
    assert rate_hz == RATE_HZ
    return samples


def put(path: Path, *channels: np.ndarray, rate_hz: int = RATE_HZ, subtype: str = "PCM_16") -> Path:
    length = min(map(len, channels))
    soundfile.write(path, np.stack([c[:length] for c in channels], axis=1), rate_hz, subtype)
    return path


def codes(speech: Speech) -> dict[str, Severity]:
    return {finding.code: finding.severity for finding in speech.findings}


def is_from(speech: Speech, channel: np.ndarray) -> bool:
    heard = speech.samples.astype(float)
    wanted = channel[: len(heard)]
    return bool(np.corrcoef(heard[: len(wanted)], wanted)[0, 1] > 0.99)


# No false alarm


@pytest.mark.parametrize("language", LANGUAGES)
@pytest.mark.parametrize("line", LINES)
def test_a_sound_line_is_not_remarked_on(language: str, line: str, tmp_path: Path) -> None:
    assert read_speech(SAMPLE / "dialogue" / language / f"{line}.wav").findings == ()
    at_full_scale = voice(line, language) / np.abs(voice(line, language)).max()
    assert read_speech(put(tmp_path / "a.wav", at_full_scale)).findings == ()


@pytest.mark.parametrize("folder", ["grid-s1/lines", "prompts/vo"])
def test_real_lines_are_not_remarked_on(folder: str, shared: Path) -> None:
    files = sorted((shared / "data" / folder).rglob("*.flac"))
    assert len(files) >= 300
    assert {path.name: codes(read_speech(path)) for path in files[::7]} == {
        path.name: {} for path in files[::7]
    }


@pytest.mark.slow
@pytest.mark.parametrize("folder", ["grid-s1/lines", "prompts/vo"])
def test_no_real_line_is_remarked_on(folder: str, shared: Path) -> None:
    files = sorted((shared / "data" / folder).rglob("*.flac"))
    assert [path.name for path in files if read_speech(path).findings] == []


# No speech


@pytest.mark.parametrize("name", SOUNDS)
def test_what_is_no_speech_is_flagged(name: str, tmp_path: Path) -> None:
    speech = read_speech(put(tmp_path / "a.wav", SOUNDS[name]()))
    assert codes(speech) == {"audio-no-speech": Severity.WARNING}


@pytest.mark.parametrize("name", ["white noise", "traffic"])
@pytest.mark.parametrize("snr_db", [40, 20, 10])
def test_a_voice_in_noise_is_still_one(name: str, snr_db: int, tmp_path: Path) -> None:
    line = np.concatenate([voice(line) for line in LINES])[: 3 * RATE_HZ]
    noise = SOUNDS[name]()[: len(line)]
    noise = noise * line.std() / noise.std() * 10 ** (-snr_db / 20)
    speech = read_speech(put(tmp_path / "a.wav", 0.5 * (line + noise)))
    assert "audio-no-speech" not in codes(speech)


def test_direct_current_is_silence(tmp_path: Path) -> None:
    with pytest.raises(InputError) as caught:
        read_speech(put(tmp_path / "a.wav", np.full(RATE_HZ, 0.5)))
    assert caught.value.code == "audio-silent"


def test_long_and_short_recordings_are_measured_alike() -> None:
    """In blocks, so that memory does not grow; their borders leave no mark."""
    once = np.resize(voice(), 2 * RATE_HZ).astype(np.float32)
    long = np.tile(once, 1 + _BLOCK * _HOP * 3 // len(once))
    short, whole = measure(once), measure(long)
    assert whole.sound_s == pytest.approx(short.sound_s * len(long) / len(once), rel=0.02)
    assert whole.swing_db == pytest.approx(short.swing_db, rel=0.03)
    assert abs(whole.steady - short.steady) < 0.01


# Faults


@pytest.mark.parametrize(
    ("gain", "after", "severity"),
    [
        (1.0, 1.0, None),
        (1.3, 1.0, Severity.INFO),
        (4.0, 1.0, Severity.WARNING),
        (4.0, 0.5, Severity.WARNING),
        (4.0, 0.05, Severity.WARNING),
    ],
)
def test_clipping_is_told_from_a_peak_at_full_scale(
    gain: float, after: float, severity: Severity | None, tmp_path: Path
) -> None:
    loud = voice() / np.abs(voice()).max() * gain
    found = codes(read_speech(put(tmp_path / "a.wav", np.clip(loud, -1, 1) * after)))
    assert found == ({"audio-clipped": severity} if severity is not None else {})


@pytest.mark.parametrize("subtype", ["PCM_U8", "ULAW", "ALAW", "IMA_ADPCM"])
def test_coarse_samples_are_not_clipping(subtype: str, tmp_path: Path) -> None:
    speech = read_speech(put(tmp_path / "a.wav", voice() / np.abs(voice()).max(), subtype=subtype))
    assert codes(speech) == {}
    loud = np.clip(voice() / np.abs(voice()).max() * 8, -1, 1)
    assert "audio-clipped" in codes(read_speech(put(tmp_path / "b.wav", loud, subtype="PCM_U8")))


def test_sound_beyond_full_scale_is_turned_down_and_not_clipped(tmp_path: Path) -> None:
    path = put(tmp_path / "a.wav", voice() / np.abs(voice()).max() * 8, subtype="FLOAT")
    speech = read_speech(path)
    assert codes(speech) == {"audio-over-scale": Severity.INFO}
    assert "18 dB" in speech.findings[0].message
    assert is_from(speech, voice())
    assert np.abs(speech.samples.astype(int)).max() in (32767, 32768)


def test_an_offset_is_taken_away_and_said(tmp_path: Path) -> None:
    speech = read_speech(put(tmp_path / "a.wav", voice() * 0.5 + 0.1))
    assert codes(speech) == {"audio-dc-offset": Severity.INFO}
    assert "10%" in speech.findings[0].message
    assert abs(speech.samples.mean()) < 100
    assert codes(read_speech(put(tmp_path / "b.wav", voice() * 0.5 + 0.001))) == {}


@pytest.mark.parametrize(("peak_db", "quiet"), [(-6, False), (-20, False), (-45, True)])
def test_hardly_audible_lines_are_flagged(peak_db: int, quiet: bool, tmp_path: Path) -> None:
    soft = voice() / np.abs(voice()).max() * 10 ** (peak_db / 20)
    found = codes(read_speech(put(tmp_path / "a.wav", soft, subtype="PCM_24")))
    assert found == ({"audio-quiet": Severity.WARNING} if quiet else {})


@pytest.mark.parametrize("rate_hz", [8_000, 11_025, 16_000, 22_050, 44_100, 48_000])
def test_telephone_sound_is_flagged_at_any_rate(rate_hz: int, tmp_path: Path) -> None:
    telephone = soxr.resample(voice(), RATE_HZ, 8_000)
    path = put(tmp_path / "a.wav", soxr.resample(telephone, 8_000, rate_hz), rate_hz=rate_hz)
    assert codes(read_speech(path)) == {"audio-narrowband": Severity.WARNING}
    path = put(tmp_path / "b.wav", soxr.resample(voice(), RATE_HZ, rate_hz), rate_hz=rate_hz)
    assert ("audio-narrowband" in codes(read_speech(path))) == (rate_hz < 16_000)


# Channels


@pytest.mark.parametrize("place", [0, 1, 2])
def test_the_voice_is_found_beside_dead_channels(place: int, tmp_path: Path) -> None:
    channels = [np.zeros_like(voice()), np.random.default_rng(0).normal(0, 1e-4, len(voice()))]
    channels.insert(place, voice())
    speech = read_speech(put(tmp_path / "a.wav", *channels))
    assert codes(speech) == {"audio-channels": Severity.INFO}
    assert f"channel {place + 1}, the only one with sound" in speech.findings[0].message
    assert is_from(speech, voice())


@pytest.mark.parametrize("gain", [1.0, 0.5])
def test_dual_mono_and_mirrored_channels_are_told_apart(gain: float, tmp_path: Path) -> None:
    same = read_speech(put(tmp_path / "a.wav", voice(), voice() * gain))
    assert codes(same) == {"audio-channels": Severity.INFO}
    assert "the same as the others" in same.findings[0].message
    mirrored = read_speech(put(tmp_path / "b.wav", voice(), -voice() * gain))
    assert codes(mirrored) == {"audio-phase": Severity.INFO}
    assert "cancel" in mirrored.findings[0].message
    assert is_from(same, voice())
    assert is_from(mirrored, voice())


@pytest.mark.parametrize("rate_hz", [16_000, 48_000])
def test_stereo_of_one_voice_is_one_voice(rate_hz: int, tmp_path: Path) -> None:
    left = soxr.resample(voice(), RATE_HZ, rate_hz)
    noise = np.random.default_rng(0).normal(0, 0.01, (2, len(left)))
    right = np.roll(left, round(0.003 * rate_hz)) * 0.7 + noise[1]
    speech = read_speech(put(tmp_path / "a.wav", left + noise[0], right, rate_hz=rate_hz))
    assert codes(speech) == {"audio-channels": Severity.INFO}
    assert "channel 1, the loudest" in speech.findings[0].message


@pytest.mark.parametrize("leak", [0.0, 0.1])
def test_two_voices_are_never_mixed(leak: float, tmp_path: Path) -> None:
    other = np.resize(voice("think", "de"), len(voice())) * 0.7
    channels = (voice() + leak * other, other + leak * voice())
    speech = read_speech(put(tmp_path / "a.wav", *channels))
    assert codes(speech) == {"audio-voices": Severity.WARNING}
    assert "channels 1 and 2" in speech.findings[0].message
    assert is_from(speech, channels[0])


@pytest.mark.parametrize("name", SOUNDS)
@pytest.mark.parametrize("place", [0, 1])
def test_the_voice_is_found_beside_louder_noise_or_music(
    name: str, place: int, tmp_path: Path
) -> None:
    line = np.resize(voice(), RATE_HZ * 3) / np.abs(voice()).max() * 0.5
    channels = [SOUNDS[name]()]
    channels.insert(place, line)
    speech = read_speech(put(tmp_path / "a.wav", *channels))
    assert codes(speech) == {"audio-channels": Severity.INFO}
    assert f"channel {place + 1}, the o" in speech.findings[0].message
    assert is_from(speech, line)


# How fast


def track(rate_hz: float, count: int) -> PhoneTrack:
    phones = [Phone("a", 1 + i / rate_hz, 1 + (i + 1) / rate_hz) for i in range(count)]
    return PhoneTrack("en", "ipa", contiguous(phones, 3 + count / rate_hz))


@pytest.mark.parametrize(
    ("rate_hz", "doubtful"),
    [
        (SLOWEST_HZ * 0.9, True),
        (SLOWEST_HZ * 1.1, False),
        (12.0, False),
        (FASTEST_HZ * 0.9, False),
        (FASTEST_HZ * 1.1, True),
        (33.0, True),
    ],
)
def test_nobody_speaks_that_fast_or_slow(rate_hz: float, doubtful: bool) -> None:
    assert speaking_rate(track(rate_hz, 40)) == pytest.approx(rate_hz)  # pauses do not count
    found = list(rate_doubt(track(rate_hz, 40)))
    assert [(f.code, f.severity) for f in found] == [("align-rate", Severity.WARNING)] * doubtful
    assert list(rate_doubt(track(rate_hz, 5))) == []  # a shout may last


def test_a_rate_just_too_fast_is_not_called_usual() -> None:
    (doubt,) = rate_doubt(track(FASTEST_HZ + 0.3, 40))
    assert "at 19.3 sounds a second; people speak 5 to 19" in doubt.message


def test_a_track_of_silence_has_no_rate() -> None:
    silent = PhoneTrack("en", "ipa", (Phone(SILENCE, 0.0, 1.0),))
    assert speaking_rate(silent) == 0.0
    assert list(rate_doubt(silent)) == []
