"""`animeme voice`: what is learned of a speaker, and what it does to the lines that follow."""

from __future__ import annotations

import io
import json
import random
import shutil
import zipfile
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

import animeme
from animeme.dialogue import Line, voice_of
from animeme.errors import InputError
from animeme.voices import VoicesReport
from animeme_stages.align.acoustic.adaptation import Observations, adapted
from animeme_stages.align.acoustic.model import acoustic_model
from conftest import SAMPLE
from support.jobs import animeme as command
from support.jobs import run_inline, small_job

Capture = pytest.CaptureFixture[str]
LINES = ("boat", "count", "five", "moon", "think", "welcome")


def fill(folder: Path, language: str, times: int) -> Path:
    """All sample lines of a language, several times."""
    folder.mkdir(parents=True)
    for turn in range(times):
        for name in LINES:
            for suffix in (".wav", ".txt"):
                source = SAMPLE / "dialogue" / language / f"{name}{suffix}"
                shutil.copy(source, folder / f"{name}{turn}{suffix}")
    return folder


@pytest.fixture(scope="module")
def voices(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A voice of English and one of Spanish."""
    root = tmp_path_factory.mktemp("voices")
    fill(root / "dialogue" / "en", "en", 2)
    fill(root / "dialogue" / "es", "es", 2)
    report = animeme.learn_voices(root / "dialogue", output=root / "voices")
    assert {voice.language: voice.learned.lines for voice in report.voices if voice.learned} == {
        "en": 12,
        "es": 12,
    }
    return root / "voices"


def test_its_own_lines_are_surer(voices: Path) -> None:
    folder = SAMPLE / "dialogue" / "en"
    for name in LINES:
        text = (folder / f"{name}.txt").read_text(encoding="utf-8")
        plain = animeme.align(folder / f"{name}.wav", text)
        own = animeme.align(folder / f"{name}.wav", text, voice=voices / "en.voice")
        assert not own.findings
        pairs = zip(plain.track.words, own.track.words, strict=True)
        assert max(abs(a.start_s - b.start_s) for a, b in pairs) < 0.1
        assert own.score is not None
        assert own.score > 0.5


@pytest.mark.slow
def test_same_lines_same_bytes_whatever_the_workers(voices: Path, tmp_path: Path) -> None:
    fill(tmp_path / "dialogue" / "en", "en", 2)
    for name, chosen in (("inline", "inline"), ("local", "local")):
        animeme.learn_voices(
            tmp_path / "dialogue",
            output=tmp_path / name,
            executor="local" if chosen == "local" else "inline",
            workers=2,
        )
    first = (voices / "en.voice").read_bytes()
    assert (tmp_path / "inline" / "en.voice").read_bytes() == first
    assert (tmp_path / "local" / "en.voice").read_bytes() == first


def test_a_command_says_what_it_learned_from(tmp_path: Path, capsys: Capture) -> None:
    folder = fill(tmp_path / "lines", "en", 2)
    (folder / "boat0.txt").write_text("Nobody has ever said anything like this", encoding="utf-8")
    (folder / "moon0.wav").write_bytes(b"RIFF")
    ran = command(capsys, "voice", folder, "-o", tmp_path / "v", "--executor", "inline", "--json")
    assert ran.code == 0
    (voice,) = json.loads(ran.out)["voices"]
    assert (voice["lines"], voice["refused"], voice["written"]) == (10, 1, True)
    assert voice["output"].endswith("en.voice")
    assert "10 lines" in ran.err
    assert "1 in doubt" in ran.err
    line = (folder / "five0.wav", folder / "five0.txt")
    assert command(capsys, "align", *line, "--voices", tmp_path / "v").code == 0


def test_too_little_teaches_nothing(tmp_path: Path, capsys: Capture) -> None:
    folder = fill(tmp_path / "lines", "en", 1)
    arguments = ("voice", folder, "-o", tmp_path / "v", "--executor", "inline")
    ran = command(capsys, *arguments)
    assert ran.code == 0
    assert "voice-too-little" in ran.out
    assert not (tmp_path / "v").exists()
    assert command(capsys, *arguments, "--fail-on", "warning").code == 1


def test_nothing_says_where_to(tmp_path: Path, capsys: Capture) -> None:
    folder = fill(tmp_path / "lines", "en", 1)
    ran = command(capsys, "voice", folder)
    assert ran.code == 2
    assert "output-missing" in ran.err


def _truncated(data: bytes) -> bytes:
    return data[: len(data) // 2]


def _with_entry(name: str, value: object) -> Callable[[bytes], bytes]:
    def change(data: bytes) -> bytes:
        with np.load(io.BytesIO(data)) as archive:
            arrays = {key: archive[key] for key in archive.files}
        arrays[name] = np.array(value)
        stream = io.BytesIO()
        np.savez(stream, **arrays)
        return stream.getvalue()

    return change


def _array() -> bytes:
    stream = io.BytesIO()
    np.save(stream, np.zeros(3))
    return stream.getvalue()


def _without_weights(data: bytes) -> bytes:
    stream = io.BytesIO()
    with zipfile.ZipFile(io.BytesIO(data)) as old, zipfile.ZipFile(stream, "w") as new:
        for name in old.namelist():
            if name != "log_weights_1.npy":
                new.writestr(name, old.read(name))
    return stream.getvalue()


DAMAGES: dict[str, Callable[[bytes], bytes]] = {
    "truncated": _truncated,
    "empty": lambda _: b"",
    "an array": lambda _: _array(),
    "text": lambda _: b"not a voice",
    "of the future": _with_entry("format", "animeme.voice/2"),
    "of another model": _with_entry("base", "0" * 64),
    "of another family": _with_entry("family", "klingon"),
    "with too few means": _with_entry("means_0", np.zeros((2, 2, 13), np.float16)),
    "with a variance of 0": _with_entry("variances_0", np.zeros((42, 128, 13), np.float16)),
    "with a state too many": _with_entry("senones", np.array([10**6])),
    "with an object": _with_entry("usual", [{"a": 1}]),
    "with a part lost": _without_weights,
}


@pytest.mark.parametrize("damage", DAMAGES)
def test_a_broken_voice_is_refused(voices: Path, tmp_path: Path, damage: str) -> None:
    path = tmp_path / "bad.voice"
    path.write_bytes(DAMAGES[damage]((voices / "en.voice").read_bytes()))
    audio = SAMPLE / "dialogue" / "en" / "boat.wav"
    with pytest.raises(InputError) as caught:
        animeme.align(audio, "Mama bought a boat", voice=path)
    assert caught.value.code == "voice-unusable"
    assert caught.value.place == str(path)
    shutil.copy(voices / "en.voice", path)
    assert animeme.align(audio, "Mama bought a big blue boat for Bob", voice=path).score


def test_a_voice_of_other_sounds_is_refused(voices: Path) -> None:
    audio = SAMPLE / "dialogue" / "en" / "boat.wav"
    with pytest.raises(InputError, match="other sounds"):
        animeme.align(audio, "Mama bought a boat", voice=voices / "es.voice")


def test_whose_voice_a_line_has(tmp_path: Path) -> None:
    for name in ("en.voice", "en/ada.voice"):
        (tmp_path / name).parent.mkdir(exist_ok=True)
        (tmp_path / name).touch()

    def of(language: str, character: str) -> Path | None:
        return voice_of(tmp_path, Line("x", language, character, "x.wav", "x.txt"))

    assert of("en", "") == tmp_path / "en.voice"
    assert of("en", "ada") == tmp_path / "en" / "ada.voice"
    assert of("en", "bob") is None
    assert of("de", "") is None
    single = tmp_path / "en.voice"
    line = Line("x", "de", "bob", "x.wav", "x.txt")
    assert voice_of(single, line) == single
    assert voice_of(None, line) is None


def test_a_job_uses_its_voices(tmp_path: Path, capsys: Capture) -> None:
    job = small_job(tmp_path / "job", "en/boat", "en/five")
    job.sections["align"] = {"voices": "voices"}
    assert run_inline(capsys, job).code == 0
    assert [finding["code"] for finding in job.report()["findings"]] == ["voices-missing"]
    voices = job.folder / "voices"
    voices.mkdir()
    assert run_inline(capsys, job).code == 0
    assert not job.report()["findings"]
    (voices / "en.voice").write_bytes(b"no voice")
    assert run_inline(capsys, job).code == 1
    for line in ("en/boat", "en/five"):
        assert "voice-unusable" in {finding["code"] for finding in job.findings(line)}


@pytest.mark.slow
def test_a_job_says_where_its_voices_are(tmp_path: Path, capsys: Capture) -> None:
    job = small_job(tmp_path / "job")
    fill(job.dialogue / "en" / "crab", "en", 2)
    job.sections["align"] = {"voices": "voices"}
    ran = command(capsys, "voice", job.write(), "--executor", "inline")
    assert ran.code == 0
    assert (job.folder / "voices" / "en" / "crab.voice").is_file()
    assert run_inline(capsys, job).code == 0
    assert set(job.statuses().values()) == {"ok"}


def test_an_aligner_that_learns_nothing_says_so(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    class Plain:
        def languages(self) -> frozenset[str]:
            return frozenset({"en"})

    monkeypatch.setattr("animeme.registry.aligner", lambda _: Plain())
    with pytest.raises(InputError) as caught:
        animeme.learn_voices(fill(tmp_path / "en", "en", 1), output=tmp_path / "v")
    assert caught.value.code == "voice-unsupported"


def test_what_was_seen_counts_beside_what_was_known() -> None:
    model = acoustic_model()
    seen = Observations.none(model)
    same = adapted(model, seen).of(model)
    for old, new in zip(model.projections, same.projections, strict=True):
        assert np.allclose(old, new, rtol=5e-3, atol=1e-3)  # half precision
    # 30 frames at 2 in one density; the model's mean counts as 10 (Gauvain & Lee 1994).
    width = model.projections[0].shape[2] // 2
    variance = -0.5 / model.projections[0][3, 7, width:]
    mean = model.projections[0][3, 7, :width] * variance
    seen.counts[0][3, 7] = 30
    seen.sums[0][3, 7] = 60
    seen.squares[0][3, 7] = 120
    found = adapted(model, seen)
    expected = (10 * mean + 60) / 40
    assert np.allclose(found.means[0][3, 7], expected, rtol=1e-3, atol=1e-3)
    spread = 30 * (2 - expected) ** 2
    wide = np.maximum((50 * variance + spread) / 80, 0.3 * variance)
    assert np.allclose(found.variances[0][3, 7], wide, rtol=2e-3)


@pytest.mark.slow
def test_a_voice_finds_wrong_words(shared: Path, tmp_path: Path) -> None:
    corpus = sorted((shared / "data" / "grid-s1" / "lines").glob("*.flac"))
    texts = [audio.with_suffix(".txt").read_text(encoding="utf-8").split() for audio in corpus]
    for audio in corpus[::6]:
        for file in (audio, audio.with_suffix(".txt")):
            (tmp_path / "lines").mkdir(exist_ok=True)
            shutil.copy(file, tmp_path / "lines")
    report: VoicesReport = animeme.learn_voices(tmp_path / "lines", output=tmp_path / "v")
    assert report.exit_code == 0
    voice = tmp_path / "v" / "en.voice"
    chance = random.Random(1)
    vocabulary = sorted({word for text in texts for word in text})
    found = {"right": 0, "wrong": 0}
    judged = range(1, 200, 5)
    for at in judged:
        words = list(texts[at])
        place = chance.randrange(len(words))
        words[place] = chance.choice([word for word in vocabulary if word != words[place]])
        for kind, said in (("right", texts[at]), ("wrong", words)):
            try:
                found[kind] += bool(animeme.align(corpus[at], " ".join(said), voice=voice).findings)
            except InputError:
                found[kind] += 1
    assert found["right"] <= 0.05 * len(judged)
    assert found["wrong"] >= 0.9 * len(judged)
