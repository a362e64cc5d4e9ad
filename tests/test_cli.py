"""The command line, from outside: what goes where, and what people and programs are told."""

from __future__ import annotations

import contextlib
import importlib.metadata
import json
import os
import pty
import shutil
import subprocess
import tomllib
from collections.abc import Callable
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any

import jsonschema
import pytest
import soundfile

import animeme_schemas
from animeme.cli import _COMMANDS
from support.jobs import (
    CONSOLE,
    SAMPLE,
    Ran,
    SmallJob,
    animeme,
    console,
    digests,
    run_inline,
    small_job,
)

Capture = pytest.CaptureFixture[str]
WELCOME = SAMPLE / "dialogue" / "en" / "welcome"
# What `run --json` says beyond the report.
EFFORT = {"output", "wall_s", "cpu_s"}


def validate(kind: str, document: dict[str, Any]) -> None:
    """Assert that a document keeps to its schema."""
    jsonschema.Draft202012Validator(animeme_schemas.load(kind)).validate(document)


@pytest.fixture
def wide(monkeypatch: pytest.MonkeyPatch) -> None:
    """A terminal so wide that no table breaks its lines."""
    monkeypatch.setenv("COLUMNS", "300")


# --- help ---------------------------------------------------------------------------------------


@pytest.mark.parametrize("flag", ["-h", "--help"])
@pytest.mark.parametrize("command", sorted(_COMMANDS))
def test_every_command_explains_itself_with_an_example(
    command: str, flag: str, capsys: Capture
) -> None:
    ran = animeme(capsys, command, flag)
    assert ran.code == 0
    assert f"Usage: animeme {command}" in ran.out
    assert f"Example: animeme {command} " in " ".join(ran.out.split())
    assert "--json" in ran.out
    assert ran.err == ""


def test_help_lists_every_command_and_exit_code(capsys: Capture) -> None:
    ran = animeme(capsys, "--help")
    assert ran.code == 0
    for command in _COMMANDS:
        assert f"\n  {command} " in ran.out
    assert "Exit codes: 0 all well; 1 done, but" in " ".join(ran.out.split())


def test_without_a_command_help_is_shown(capsys: Capture) -> None:
    ran = animeme(capsys)
    ran.says()
    assert ran.code == 2
    assert "Usage: animeme" in ran.out + ran.err
    assert "Commands:" in ran.out + ran.err


def test_version_is_the_distributions(capsys: Capture) -> None:
    ran = animeme(capsys, "--version")
    assert (ran.code, ran.out.strip()) == (0, f"animeme, version {version('animeme')}")


def test_a_traceback_is_shown_only_to_who_asks(tmp_path: Path, capsys: Capture) -> None:
    missing = tmp_path / "missing.toml"
    animeme(capsys, "run", missing).says("no such job file")
    ran = animeme(capsys, "--debug", "run", missing)
    assert ran.code == 2
    assert "Traceback" in ran.err


# --- run ----------------------------------------------------------------------------------------


def job_of_two(folder: Path) -> SmallJob:
    """Both characters in both formats, three languages, two lines in one of them."""
    job = small_job(folder, "en/boat", "en/five", "de/boat", "es/boat")
    job.asset("crab.usdc")
    job.sections["characters.crab"]["asset"] = ["crab.glb", "crab.usdc"]
    job.sections["characters.ada"] = {
        "asset": [job.asset(f"ada.{s}").name for s in ("glb", "usdc")]
    }
    job.write()
    return job


@pytest.fixture(scope="session")
def two(tmp_path_factory: pytest.TempPathFactory) -> SmallJob:
    return job_of_two(tmp_path_factory.mktemp("two") / "job")


@pytest.fixture(scope="session")
def ran_in_two(two: SmallJob) -> Ran:
    """The job of two, run as a nightly job would: its own process, two workers, JSON."""
    return console("run", two.file, "--workers", 2, "--json")


def test_run_prints_one_json_document_and_nothing_else(ran_in_two: Ran, two: SmallJob) -> None:
    assert ran_in_two.code == 0
    document = json.loads(ran_in_two.out)
    assert document["output"] == str(two.output)
    assert document["wall_s"] > 0
    assert document["cpu_s"] > 0
    report = {key: value for key, value in document.items() if key not in EFFORT}
    validate("report", report)
    assert report == two.report()


def test_run_tells_people_on_stderr(ran_in_two: Ran, two: SmallJob) -> None:
    ran_in_two.says("lines: 4/4", "assets: 12/12", "| en | crab | 2 | 2 | 0 | 0 |")
    ran_in_two.says("de/crab.usdc", f"Everything is in {two.output}")
    assert (two.output / "summary.md").read_text(encoding="utf-8") in ran_in_two.err


def test_run_writes_what_its_help_promises(ran_in_two: Ran, two: SmallJob) -> None:
    assert ran_in_two.code == 0
    delivered = [f"{who}.usda" for who in ("ada", "crab")] + [
        f"{language}/{who}.{suffix}"
        for language in ("de", "en", "es")
        for who in ("ada", "crab")
        for suffix in ("glb", "usdc")
    ]
    assert two.report()["outputs"] == sorted(delivered)
    alignments = [
        f"alignments/{line}.json" for line in ("de/boat", "en/boat", "en/five", "es/boat")
    ]
    reports = ["report.json", "run.jsonl", "summary.md"]
    assert sorted(digests(two.output)) == sorted([*delivered, *alignments, *reports])
    assert two.animations("en/ada.glb") == two.animations("en/ada.usdc") == {"boat", "five"}


def test_documents_of_a_run_keep_to_their_schemas(ran_in_two: Ran, two: SmallJob) -> None:
    assert ran_in_two.code == 0
    validate("report", two.report())
    validate("job", tomllib.loads(two.file.read_text(encoding="utf-8")))
    for path in two.output.glob("alignments/*/*.json"):
        validate("alignment", json.loads(path.read_text(encoding="utf-8")))


@pytest.mark.parametrize(
    "options",
    [
        pytest.param(("--workers", "1"), id="one-worker"),
        pytest.param(("--executor", "inline"), id="inline"),
    ],
)
def test_every_executor_writes_the_same_bytes(
    options: tuple[str, ...], ran_in_two: Ran, two: SmallJob, tmp_path: Path, capsys: Capture
) -> None:
    # As deep as the other output, and in the same folder, so that relative paths agree.
    output = two.folder / options[-1]
    try:
        ran = animeme(capsys, "run", two.file, "--output", output, *options)
        assert ran.code == ran_in_two.code == 0
        first, second = digests(two.output), digests(output)
    finally:
        shutil.rmtree(output, ignore_errors=True)
    del first["run.jsonl"], second["run.jsonl"]
    assert second == first


def test_a_second_run_over_the_first_writes_the_same_bytes(tmp_path: Path, capsys: Capture) -> None:
    job = small_job(tmp_path / "job", "en/boat", "de/boat")
    assert run_inline(capsys, job).code == 0
    first = digests(job.output)
    assert run_inline(capsys, job).code == 0
    second = digests(job.output)
    del first["run.jsonl"], second["run.jsonl"]
    assert second == first


def test_a_line_to_review_fails_the_run_only_where_asked(tmp_path: Path, capsys: Capture) -> None:
    job = small_job(tmp_path / "job", "en/boat", "en/moon")
    text = (SAMPLE / "dialogue/en/moon.txt").read_text(encoding="utf-8")
    (job.dialogue / "en/moon.txt").write_text(f"Rhinoceros {text}", encoding="utf-8")
    plain = run_inline(capsys, job)
    assert plain.code == 0
    assert job.statuses() == {"en/boat": "ok", "en/moon": "review"}
    plain.says("en/moon", "may differ", "'rhinoceros'", "Listen to the line")
    assert job.animations() == {"boat", "moon"}

    strict = run_inline(capsys, job, "--fail-on", "warning")
    assert strict.code == 1
    assert job.report()["exit_code"] == 1
    assert job.statuses() == {"en/boat": "ok", "en/moon": "review"}

    job.line("en/moon", like="en/moon")
    assert run_inline(capsys, job, "--fail-on", "warning").code == 0


def test_output_on_the_command_line_goes_before_the_jobs(tmp_path: Path, capsys: Capture) -> None:
    job = small_job(tmp_path / "job")
    elsewhere = tmp_path / "else where"
    assert run_inline(capsys, job, "--output", elsewhere).code == 0
    assert (elsewhere / "en" / "crab.glb").is_file()
    assert not job.output.exists()


def test_per_line_layout_writes_a_file_per_line(tmp_path: Path, capsys: Capture) -> None:
    job = small_job(tmp_path / "job", "en/boat", "en/five")
    job.line("en/scene 1/take.2", like="en/moon")
    job.asset("crab.usdc")
    job.sections["characters.crab"] |= {"layout": "per-line", "asset": ["crab.glb", "crab.usdc"]}
    assert run_inline(capsys, job).code == 0
    lines = ("boat", "five", "scene 1/take.2")
    expected = sorted(f"en/crab/{line}.{suffix}" for line in lines for suffix in ("glb", "usdc"))
    assert job.report()["outputs"] == expected
    assert all((job.output / path).is_file() for path in expected)
    for line in lines:
        assert len(job.animations(f"en/crab/{line}.glb")) == 1
        (entry,) = [e for e in job.report()["lines"] if e["line"] == f"en/{line}"]
        assert entry["outputs"] == [f"en/crab/{line}.{suffix}" for suffix in ("glb", "usdc")]


def test_a_line_in_a_characters_folder_is_spoken_by_nobody_else(
    tmp_path: Path, capsys: Capture
) -> None:
    job = small_job(tmp_path / "job", "en/boat")
    job.line("en/twin/five", like="en/five")
    shutil.copy(job.folder / "crab.glb", job.folder / "twin.glb")
    job.sections["characters.twin"] = {"asset": "twin.glb", "rig": "crab.rig.toml"}
    assert run_inline(capsys, job).code == 0
    assert job.animations("en/crab.glb") == {"boat"}
    assert job.animations("en/twin.glb") == {"boat", "five"}


def test_names_and_texts_may_be_in_any_script(tmp_path: Path) -> None:
    job = small_job(tmp_path / "größe 日本", "en/boat")
    job.line("en/Schöne Grüße 🎬", like="en/five")
    text = "“Five” 🐟 little fishes — it’s… said!\n"
    (job.dialogue / "en/Schöne Grüße 🎬.txt").write_text(text, encoding="utf-8")
    original = (SAMPLE / "dialogue/en/five.txt").read_text(encoding="utf-8")
    (job.dialogue / "en/moon 月.txt").write_text(f"“{original.strip()}” 🎬", encoding="utf-8")
    shutil.copy(SAMPLE / "dialogue/en/five.wav", job.dialogue / "en/moon 月.wav")
    ran = console("run", job.write(), "--workers", 1, "--json")
    ran.says("größe 日本")
    assert ran.code in (0, 1)
    assert job.statuses()["en/moon 月"] == "ok"
    assert {"boat", "moon 月"} <= job.animations()
    assert json.loads(ran.out)["lines"][-1]["line"] == "en/moon 月"
    job.assert_tidy()


def test_json_reaches_a_pipe_of_any_encoding(tmp_path: Path) -> None:
    job = small_job(tmp_path / "日本")
    env = {"PYTHONIOENCODING": "latin-1", "PYTHONUTF8": "0"}
    ran = console("run", job.write(), "--workers", 1, "--json", env=env)
    ran.says("Everything is in")
    assert ran.code == 0
    assert json.loads(ran.out)["output"] == str(job.output)


def test_a_terminal_gets_a_progress_bar(tmp_path: Path) -> None:
    job = small_job(tmp_path / "job")
    ours, terminal = pty.openpty()
    command = [str(CONSOLE), "run", str(job.write()), "--executor", "inline"]
    with subprocess.Popen(command, stdin=terminal, stdout=terminal, stderr=terminal) as process:
        os.close(terminal)
        shown = b""
        with open(ours, "rb", buffering=0) as stream, contextlib.suppress(OSError):
            while part := stream.read(4096):  # fails where the other end is closed
                shown += part
    text = shown.decode("utf-8")
    assert process.returncode == 0
    assert "Traceback" not in text
    assert "1/1" in text
    assert "Everything is in" in text


# --- align --------------------------------------------------------------------------------------


def _as_file() -> str:
    return f"{WELCOME}.txt"


def _as_words() -> str:
    return Path(f"{WELCOME}.txt").read_text(encoding="utf-8")


@pytest.mark.parametrize("text", [_as_file, _as_words])
def test_align_takes_a_file_or_the_words(text: Callable[[], str], capsys: Capture) -> None:
    ran = animeme(capsys, "align", f"{WELCOME}.wav", text(), "--json")
    assert ran.code == 0
    assert ran.err == ""
    document = json.loads(ran.out)
    validate("alignment", document)
    assert [word["text"] for word in document["words"]][:2] == ["welcome", "back"]
    assert document["language"] == "en"
    assert document["phones"][0]["start_s"] == 0.0
    assert document["phones"][-1]["end_s"] == document["duration_s"]
    assert document["duration_s"] == pytest.approx(soundfile.info(f"{WELCOME}.wav").duration)


@pytest.mark.usefixtures("wide")
def test_align_shows_people_a_table(capsys: Capture) -> None:
    ran = animeme(capsys, "align", f"{WELCOME}.wav", f"{WELCOME}.txt")
    assert ran.code == 0
    for cell in ("start", "end", "word", "phones", "welcome", "back"):
        assert cell in ran.out


def test_align_speaks_german(capsys: Capture) -> None:
    line = SAMPLE / "dialogue" / "de" / "moon"
    ran = animeme(capsys, "align", f"{line}.wav", f"{line}.txt", "--language", "de-AT", "--json")
    assert ran.code == 0
    document = json.loads(ran.out)
    validate("alignment", document)
    assert (document["language"], document["inventory"]) == ("de-AT", "ipa")


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        pytest.param(("no.wav", "hello"), ("no.wav", "no such recording"), id="no-audio"),
        pytest.param((f"{WELCOME}.wav", "no.txt"), ("no.txt", "transcript-missing"), id="no-text"),
        pytest.param((f"{WELCOME}.wav", ""), ("no word", "transcript-empty"), id="empty"),
        pytest.param((f"{WELCOME}.txt", "hello"), ("cannot be decoded", "WAV"), id="text"),
        pytest.param(
            (f"{WELCOME}.wav", "hello", "--language", "tlh"), ("'tlh'", "ar, cs, de"), id="language"
        ),
        pytest.param(
            (f"{WELCOME}.wav", "hello", "--aligner", "sphinx"),
            ("'sphinx'", "pocketsphinx"),
            id="aligner",
        ),
    ],
)
def test_align_says_what_it_cannot_use(
    arguments: tuple[str, ...], words: tuple[str, ...], capsys: Capture
) -> None:
    ran = animeme(capsys, "align", *arguments, "--json")
    ran.says(*words)
    assert (ran.code, ran.out) == (2, "")


# --- rig ----------------------------------------------------------------------------------------


@pytest.mark.parametrize("suffix", ["glb", "usdc"])
def test_rig_knows_ada(suffix: str, capsys: Capture) -> None:
    ran = animeme(capsys, "rig", SAMPLE / f"ada.{suffix}", "--json")
    assert ran.code == 0
    document = json.loads(ran.out)
    assert document["profile"] == "arkit"
    assert document["coverage"] == 1.0
    assert document["missing"] == []
    assert document["format"] == {"glb": "gltf", "usdc": "usd"}[suffix]
    assert set(document["mapped"].values()) <= set(document["shapes"])


@pytest.mark.usefixtures("wide")
def test_rig_shows_people_a_table(capsys: Capture) -> None:
    ran = animeme(capsys, "rig", SAMPLE / "ada.glb")
    assert ran.code == 0
    for cell in ("profile arkit", "coverage 100%", "jawOpen"):
        assert cell in ran.out


def test_rig_does_not_know_the_crab_and_says_how_to_go_on(capsys: Capture) -> None:
    ran = animeme(capsys, "rig", SAMPLE / "crab.glb", "--json")
    ran.says("crab.glb", "8 shapes", "no known rig family", "--draft", "rig-unknown")
    assert ran.code == 2
    document = json.loads(ran.out)
    assert (document["profile"], document["coverage"], document["mapped"]) == (None, 0.0, {})
    assert "MawGape" in document["shapes"]


def test_rig_takes_a_profile_of_ones_own(capsys: Capture) -> None:
    profile = SAMPLE / "crab.rig.toml"
    ran = animeme(capsys, "rig", SAMPLE / "crab.glb", "--rig", profile, "--json")
    assert ran.code == 0
    document = json.loads(ran.out)
    assert (document["profile"], document["coverage"]) == ("crab", 1.0)


@pytest.mark.parametrize(
    ("rig", "words"),
    [
        ("arkti", ("'arkti'", "Did you mean 'arkit'?")),
        ("no.rig.toml", ("no.rig.toml", "no such file")),
        ("arkit", ("crab.glb", "'arkit'", "another profile")),
    ],
)
def test_rig_says_why_a_profile_cannot_be_used(
    rig: str, words: tuple[str, ...], capsys: Capture
) -> None:
    ran = animeme(capsys, "rig", SAMPLE / "crab.glb", "--rig", rig)
    ran.says(*words)
    assert (ran.code, ran.out) == (2, "")


def test_a_drafted_rig_can_be_used_and_is_never_overwritten(
    tmp_path: Path, capsys: Capture
) -> None:
    draft = tmp_path / "größe.rig.toml"
    ran = animeme(capsys, "rig", SAMPLE / "crab.glb", "--draft", draft)
    ran.says(str(draft), "check every line")
    assert ran.code == 0
    validate("rig", tomllib.loads(draft.read_text(encoding="utf-8")))
    assert [path.name for path in tmp_path.iterdir()] == [draft.name]

    read = animeme(capsys, "rig", SAMPLE / "crab.glb", "--rig", draft, "--json")
    assert read.code == 0
    assert json.loads(read.out)["profile"] == "größe"

    draft.write_text("mine")
    again = animeme(capsys, "rig", SAMPLE / "crab.glb", "--draft", draft)
    again.says(str(draft), "is there already", "Choose another name", "output-exists")
    assert again.code == 2
    assert draft.read_text() == "mine"


@pytest.mark.parametrize("name", ["crab.json", "crab"])
def test_a_draft_is_refused_where_it_could_not_be_read_back(
    name: str, tmp_path: Path, capsys: Capture
) -> None:
    ran = animeme(capsys, "rig", SAMPLE / "crab.glb", "--draft", tmp_path / name)
    if ran.code == 0:
        read = animeme(capsys, "rig", SAMPLE / "crab.glb", "--rig", tmp_path / name)
        assert read.code == 0, read.err
        return
    ran.says(name, ".toml")
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("asset", ["no.glb", "no.usdc", "no.fbx", "speech.py"])
def test_rig_says_which_asset_it_cannot_read(asset: str, capsys: Capture) -> None:
    ran = animeme(capsys, "rig", SAMPLE / asset)
    ran.says(asset)
    assert (ran.code, ran.out) == (2, "")


# --- doctor -------------------------------------------------------------------------------------


def _without(missing: str) -> Callable[[str], str]:
    def installed(name: str) -> str:
        if name == missing:
            raise PackageNotFoundError(name)
        return importlib.metadata.version(name)

    return installed


def test_doctor_lists_every_extra_and_plugin(capsys: Capture) -> None:
    ran = animeme(capsys, "doctor", "--json")
    assert ran.code == 0
    found = json.loads(ran.out)
    assert found["animeme"] == version("animeme")
    extras = importlib.metadata.metadata("animeme").get_all("Provides-Extra")
    assert {extra["extra"] for extra in found["extras"]} == set(extras or ())
    assert all(extra["adds"] for extra in found["extras"])
    assert {plugin["problem"] for plugin in found["plugins"]} == {""}
    assert all(found["core"].values())


@pytest.mark.usefixtures("wide")
def test_doctor_says_what_a_missing_extra_adds_and_how_to_get_it(
    capsys: Capture, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("animeme.cli.doctor.version", _without("espeakng-loader"))
    found = json.loads(animeme(capsys, "doctor", "--json").out)
    extras = {extra["extra"]: extra for extra in found["extras"]}
    for name in ("espeak", "all"):
        assert extras[name]["installed"] is False
        assert extras[name]["lacking"] == ["espeakng-loader"]

    ran = animeme(capsys, "doctor")
    assert ran.code == 0
    (row,) = [line for line in ran.out.splitlines() if "all but English" in line]
    assert "no" in row.split()
    assert "pip install 'animeme[espeak]'" in row


@pytest.mark.usefixtures("wide")
def test_doctor_says_which_core_package_is_missing(
    capsys: Capture, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("animeme.cli.doctor.version", _without("soxr"))
    assert "soxr MISSING" in animeme(capsys, "doctor").out


# --- schema -------------------------------------------------------------------------------------

KINDS = [f"{kind}/{number}" for kind, number in animeme_schemas.kinds()]


def test_schema_lists_the_kinds(capsys: Capture) -> None:
    names = [f"animeme.{kind}" for kind in KINDS]
    assert animeme(capsys, "schema").out.split() == names
    assert json.loads(animeme(capsys, "schema", "--json").out) == names
    assert {"animeme.job/1", "animeme.report/1", "animeme.rig/1"} <= set(names)


@pytest.mark.parametrize("prefix", ["", "animeme."])
@pytest.mark.parametrize("kind", KINDS)
def test_schema_prints_a_sound_schema_of_each_kind(kind: str, prefix: str, capsys: Capture) -> None:
    ran = animeme(capsys, "schema", prefix + kind)
    assert ran.code == 0
    schema = json.loads(ran.out)
    jsonschema.Draft202012Validator.check_schema(schema)
    assert schema["$id"] == f"animeme.{kind}"
    name, _, number = kind.partition("/")
    assert schema == animeme_schemas.load(name, int(number))


@pytest.mark.parametrize("kind", ["jobs", "job/99", "job/x", "job/²", "", "../job"])
def test_schema_refuses_a_kind_it_does_not_know(kind: str, capsys: Capture) -> None:
    ran = animeme(capsys, "schema", kind)
    ran.says(f"'{kind}'", "Known:", "job", "report", "rig")
    assert (ran.code, ran.out) == (2, "")
