"""Transcripts that espeak-ng speaks: their words, their times, their bytes, and jobs with them."""

from __future__ import annotations

import hashlib
import json
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
import soundfile

import animeme
from animeme import registry
from animeme.cli import main
from animeme.contracts import Spoken
from animeme.errors import InputError
from animeme.phones import ARPABET_TO_IPA, SILENCE
from animeme_stages.align import espeak as espeak_module
from animeme_stages.align.aligner import PocketSphinxAligner
from animeme_stages.align.espeak import espeak
from animeme_stages.align.language import language, languages
from animeme_stages.align.text import tokens
from animeme_stages.ingest.audio import read_speech
from animeme_stages.ingest.speak import speak, write_speech
from support.jobs import SmallJob, small_job

WORDS = Path(__file__).parent / "fixtures" / "words"
PACKAGES = {"chinese": "pypinyin", "japanese": "janome"}
# Three of the aligner's frames; espeak's speech is not what its model has heard.
CLOSE_S = 0.03


@pytest.fixture(autouse=True)
def with_espeak() -> None:
    pytest.importorskip("espeakng_loader")


def digest(spoken: Spoken) -> str:
    return hashlib.sha256(spoken.samples.tobytes()).hexdigest()


def texts(spoken: Spoken) -> list[str]:
    return [word.text for word in spoken.alignment.track.words]


def pauses_s(spoken: Spoken) -> list[float]:
    """Lengths of the pauses between words."""
    phones = spoken.alignment.track.phones[1:-1]
    return [phone.duration_s for phone in phones if phone.symbol == SILENCE]


def level(spoken: Spoken, start_s: float, end_s: float) -> float:
    part = spoken.samples[round(start_s * spoken.rate_hz) : round(end_s * spoken.rate_hz)]
    return float(np.sqrt(np.mean(np.square(part.astype(np.float64)))))


def silent_share(spoken: Spoken) -> float:
    """Share of the pauses' length in which something is heard all the same."""
    track = spoken.alignment.track
    loud = level(spoken, track.words[0].start_s, track.words[-1].end_s)
    noisy = sum(
        phone.duration_s
        for phone in track.phones
        if phone.symbol == SILENCE and level(spoken, phone.start_s, phone.end_s) > loud / 10
    )
    return noisy / sum(p.duration_s for p in track.phones if p.symbol == SILENCE)


@pytest.mark.parametrize("tag", languages())
def test_every_word_of_every_language_is_spoken_within_the_sound(tag: str) -> None:
    settings = language(tag)
    if settings.reader:
        pytest.importorskip(PACKAGES[settings.reader])
    text = (WORDS / f"{tag}.txt").read_text(encoding="utf-8")
    spoken = speak(text, language=tag)
    track = spoken.alignment.track
    expected = tokens(text, settings)
    assert texts(spoken) == [token.text for token in expected]
    assert [word.source for word in track.words] == [(t.start, t.end) for t in expected]
    assert track.inventory == settings.inventory
    assert track.duration_s == spoken.speech.duration_s == len(spoken.samples) / spoken.rate_hz
    assert len(spoken.speech.samples) == pytest.approx(16_000 * track.duration_s, abs=1)
    if track.inventory == "arpabet":
        assert {p.symbol for p in track.phones} <= {*ARPABET_TO_IPA, SILENCE}
    assert track.phones[0].symbol == track.phones[-1].symbol == SILENCE
    assert silent_share(spoken) < 0.05
    assert level(spoken, track.phones[-1].start_s + 0.01, track.duration_s) < 50


def test_times_are_those_of_the_sound() -> None:
    # An independent judge: where the acoustic model hears the same words begin.
    for tag, text in (
        ("en", "The old boat crossed the river. Nobody on the other side had seen it coming."),
        ("de", "Guten Morgen, mein Name ist Anna. Das Boot fährt um zehn Uhr über den Fluss."),
    ):
        spoken = speak(text, language=tag)
        heard = PocketSphinxAligner().align(spoken.speech, text, language=tag).track
        assert [w.text for w in heard.words] == texts(spoken)
        pairs = zip(spoken.alignment.track.words, heard.words, strict=True)
        off_s = np.array([theirs.start_s - ours.start_s for ours, theirs in pairs])
        # The model hears espeak's words up to 17 ms after their events (docs/alignment.md).
        assert abs(np.median(off_s)) < CLOSE_S * 2 / 3
        assert np.median(np.abs(off_s)) < CLOSE_S


def test_the_same_text_gives_the_same_bytes_whatever_came_before() -> None:
    lines = [
        ("Hello, how are you?", "en", 160),
        ("Guten Tag, wie geht es?", "de", 160),
        ("Guten Tag, wie geht es?", "de", 220),
        ("Où est la gare?", "fr", 160),
        ("안녕하세요.", "ko", 160),
    ]

    def spoken(order: list[int]) -> list[str]:
        found = {}
        for index in order:
            text, tag, pace = lines[index]
            found[index] = digest(speak(text, language=tag, words_per_minute=pace))
            espeak().pronounce("Geschwindigkeit", "de")
        return [found[index] for index in range(len(lines))]

    first = spoken([0, 1, 2, 3, 4])
    assert len(set(first)) == len(lines)
    assert spoken([4, 2, 0, 3, 1]) == first
    assert spoken([3, 3, 1, 4, 2, 0, 0]) == first
    alone = subprocess.run(
        [
            sys.executable,
            "-c",
            "import hashlib; from animeme_stages.ingest.speak import speak\n"
            f"spoken = speak({lines[0][0]!r}, language='en')\n"
            "print(hashlib.sha256(spoken.samples.tobytes()).hexdigest())",
        ],
        capture_output=True,
        text=True,
        check=True,
    )
    assert alone.stdout.strip() == first[0]


def test_pronunciations_do_not_depend_on_what_was_spoken() -> None:
    before = espeak().pronounce("Geschwindigkeit", "de")
    speak("Hello there!", language="en")
    assert espeak().pronounce("Geschwindigkeit", "de") == before


def test_numbers_tags_and_signs() -> None:
    text = "<wave/> I have 25 dogs [laughs], and $3.\n\nDr. Smith left."
    spoken = speak(text, language="en")
    assert " ".join(texts(spoken)) == "i have twenty five dogs and three dollars doctor smith left"
    places = [text[slice(*word.source)] for word in spoken.alignment.track.words]
    assert places[2:5] == ["25", "25", "dogs"]
    assert places[6:9] == ["$3", "$3", "Dr."]
    assert len(pauses_s(spoken)) == 2
    tagged = speak("[nods] Yes<b>.</b>", language="en")
    assert digest(speak("Yes.", language="en")) == digest(tagged)


def test_signs_make_pauses() -> None:
    plain = speak("we came we saw we won", language="en")
    parted = speak("We came; we saw... We won!", language="en")
    assert pauses_s(plain) == []
    assert len(pauses_s(parted)) == 2
    assert min(pauses_s(parted)) > 0.15
    asked, said = (speak(f"You are here{sign}", language="en") for sign in "?.")
    assert digest(asked) != digest(said)


def test_words_that_espeak_joins_are_parted() -> None:
    spoken = speak("It is one of the best in the world", language="en")
    track = spoken.alignment.track
    assert texts(spoken) == ["it", "is", "one", "of", "the", "best", "in", "the", "world"]
    sounds = {
        word.text: [p.symbol for p in track.phones if word.start_s <= p.start_s < word.end_s]
        for word in track.words
    }
    assert (sounds["of"], sounds["the"], sounds["in"]) == (["AH", "V"], ["DH", "AH"], ["IH", "N"])


@pytest.mark.parametrize(
    ("tag", "word"), [("ko", "사랑"), ("en", "boat"), ("hi", "घर"), ("ru", "река"), ("zh", "银行")]
)
def test_no_word_of_a_long_text_without_signs_is_lost(tag: str, word: str) -> None:
    if tag == "zh":
        pytest.importorskip("pypinyin")
    spoken = speak(f"{word} " * 300, language=tag)
    assert texts(spoken) == [word] * 300
    lengths_s = [w.end_s - w.start_s for w in spoken.alignment.track.words]
    assert max(lengths_s) < 5 * np.median(lengths_s)


def test_a_region_has_its_voice() -> None:
    here, there = (speak("Cinco cervezas.", language=tag) for tag in ("es", "es-419"))
    assert there.alignment.track.language == "es-419"
    assert ["θ" in {p.symbol for p in s.alignment.track.phones} for s in (here, there)] == [
        True,
        False,
    ]


def test_a_faster_pace_takes_less_time() -> None:
    slow, fast = (
        speak("The boat crosses the river.", language="en", words_per_minute=pace)
        for pace in (100, 300)
    )
    assert fast.speech.duration_s < 0.6 * slow.speech.duration_s
    with pytest.raises(ValueError, match="80 to 450"):
        speak("Hello", language="en", words_per_minute=0)


def test_the_file_is_what_was_spoken(tmp_path: Path) -> None:
    path = tmp_path / "new" / "hello.wav"
    spoken = animeme.speak("Hello there.", output=path)
    info = soundfile.info(path)
    assert (info.samplerate, info.channels, info.subtype) == (22_050, 1, "PCM_16")
    assert np.array_equal(soundfile.read(path, dtype="int16")[0], spoken.samples)
    read = read_speech(path)
    assert np.array_equal(read.samples, spoken.speech.samples)
    assert read.duration_s == spoken.speech.duration_s
    before = path.read_bytes()
    write_speech(spoken, path)
    assert path.read_bytes() == before
    assert [f.name for f in path.parent.iterdir()] == ["hello.wav"]
    with pytest.raises(InputError) as caught:
        write_speech(spoken, path / "below.wav")
    assert caught.value.code == "output-unwritable"


@pytest.mark.parametrize("text", ["", "…", "<wave/>", "[laughs] !?", "🙂"])
def test_what_has_no_word_is_refused(text: str) -> None:
    with pytest.raises(InputError) as caught:
        speak(text, language="en")
    assert caught.value.code == "transcript-empty"


def test_an_unknown_language_is_refused() -> None:
    with pytest.raises(InputError) as caught:
        speak("Hello", language="tlh")
    assert caught.value.code == "language-unknown"


def without_espeak(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "espeakng_loader", None)
    espeak_module.espeak.cache_clear()


# --- the command --------------------------------------------------------------------------------


def run(*arguments: object) -> int:
    with pytest.raises(SystemExit) as caught:
        main([str(argument) for argument in arguments])
    return int(caught.value.code or 0)


def test_the_command_writes_speech_and_timings(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    text, wav, grid = (tmp_path / name for name in ("hi.txt", "hi.wav", "hi.TextGrid"))
    text.write_text("Hallo, schöne Welt.", encoding="utf-8")
    options = ("--language", "de", "--output", wav)
    assert run("speak", text, *options, "--timings", grid, "--json") == 0
    document = json.loads(capsys.readouterr().out)
    assert document["schema"] == "animeme.alignment/1"
    assert [word["text"] for word in document["words"]] == ["hallo", "schöne", "welt"]
    back = registry.stage("read-timings")(grid, read_speech(wav), language="de").track
    assert [w.text for w in back.words] == ["hallo", "schöne", "welt"]
    assert back.words[1].start_s == pytest.approx(document["words"][1]["start_s"], abs=1e-5)
    assert run("speak", "Hallo Welt", *options) == 0
    assert "2 words" in capsys.readouterr().out


def test_the_command_says_what_is_wrong(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    wav = tmp_path / "hi.wav"
    for arguments, says in (
        (("Hello", "--language", "tlh"), "language"),
        (("…",), "no word"),
        ((tmp_path / "absent.txt",), "transcript"),
        (("Hello", "--words-per-minute", "20"), "80"),
        (("Hello", "--timings", tmp_path / "hi.srt", "--format", "srt"), "Choose one of"),
    ):
        assert run("speak", *arguments, "--output", wav) == 2
        assert says in capsys.readouterr().err
        assert not wav.exists()
    assert run("speak", "Hello", "--output", wav.with_suffix(".mp3")) == 2
    assert "ends in .wav" in capsys.readouterr().err
    assert list(tmp_path.iterdir()) == []
    without_espeak(monkeypatch)
    assert run("speak", "Hello", "--output", wav) == 2
    assert "animeme[espeak]" in capsys.readouterr().err
    assert not wav.exists()


# --- jobs ---------------------------------------------------------------------------------------


def silent_job(folder: Path) -> SmallJob:
    """A job with a recorded line and one that nobody has recorded."""
    job = small_job(folder, "en/boat")
    target = job.dialogue / "en" / "new.txt"
    target.write_text("My papa bought 3 maps of the moon.", encoding="utf-8")
    return job


def test_a_line_without_recording_is_spoken_if_the_job_says_so(tmp_path: Path) -> None:
    job = silent_job(tmp_path)
    report = animeme.run(job.write())
    assert job.statuses() == {"en/boat": "ok", "en/new": "failed"}
    (finding,) = job.findings("en/new")
    assert finding["code"] == "audio-missing"
    assert "--speak" in finding["action"]
    assert not (job.output / "speech").exists()

    job.sections["dialogue"]["speak"] = True
    report = animeme.run(job.write())
    assert report.exit_code == 0
    assert job.statuses() == {"en/boat": "ok", "en/new": "ok"}
    assert [f["code"] for f in job.findings("en/new")] == ["line-synthetic"]
    assert job.findings("en/new")[0]["severity"] == "info"
    assert job.animations() == {"boat", "new"}
    files = [p.relative_to(job.output).as_posix() for p in job.output.rglob("*.wav")]
    assert files == ["speech/en/new.wav"]
    alignment = json.loads((job.output / "alignments/en/new.json").read_text(encoding="utf-8"))
    assert soundfile.info(job.output / files[0]).duration == alignment["duration_s"]
    assert [w["text"] for w in alignment["words"]][2:4] == ["bought", "three"]
    before = (job.output / files[0]).read_bytes()
    animeme.run(job.write())
    assert (job.output / files[0]).read_bytes() == before


def test_what_was_spoken_is_stale_once_it_is_recorded(tmp_path: Path) -> None:
    job = silent_job(tmp_path)
    animeme.run(job.write(), speak=True)
    job.line("en/new")
    report = animeme.run(job.write(), speak=True)
    assert [(f.code, f.place) for f in report.findings] == [("output-stale", "speech/en/new.wav")]


def test_the_run_command_speaks(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    job = silent_job(tmp_path)
    assert run("run", job.write(), "--speak", "--executor", "inline") == 0
    assert job.statuses() == {"en/boat": "ok", "en/new": "ok"}
    assert "line-synthetic" in (job.output / "summary.md").read_text(encoding="utf-8")
    job.sections["dialogue"]["speak"] = "yes"
    assert run("run", job.write()) == 2
    assert "dialogue.speak" in capsys.readouterr().err


def test_without_the_extra_each_line_says_so(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    job = silent_job(tmp_path)
    without_espeak(monkeypatch)
    animeme.run(job.write(), speak=True)
    assert job.statuses() == {"en/boat": "ok", "en/new": "failed"}
    (finding,) = job.findings("en/new")
    assert (finding["code"], "animeme[espeak]" in finding["action"]) == ("extra-missing", True)
