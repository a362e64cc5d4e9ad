"""`animeme align FOLDER`: every line below it, its timings and a report."""

from __future__ import annotations

import json
import os
import shutil
from pathlib import Path
from typing import Any

import jsonschema
import pytest

import animeme
import animeme_schemas
from animeme_stages.align.interchange import read_timings, write_timings
from conftest import LANGUAGES, SAMPLE
from support.jobs import Ran, console, digests
from support.jobs import animeme as command

Capture = pytest.CaptureFixture[str]
INLINE = ("--executor", "inline")
DIALOGUE = SAMPLE / "dialogue"


def add(folder: Path, id: str, like: str = "en/boat") -> Path:
    """A line of the sample in another place; gives its recording."""
    for suffix in (".wav", ".txt"):
        target = folder / f"{id}{suffix}"
        target.parent.mkdir(parents=True, exist_ok=True)
        shutil.copy(DIALOGUE / f"{like}{suffix}", target)
    return folder / f"{id}.wav"


@pytest.fixture
def lines(tmp_path: Path) -> Path:
    """A flat folder of two English lines, and one in a folder below."""
    folder = tmp_path / "lines"
    add(folder, "boat")
    add(folder, "five.v2", "en/five")
    add(folder, "act 1/moon", "en/moon")
    return folder


def align(capsys: Capture, folder: Path, *options: object) -> Ran:
    """Run the command in this process; the folder must come out of it as it was."""
    before = digests(folder)
    ran = command(capsys, "align", folder, *INLINE, *options)
    after = digests(folder)
    assert {name: after.get(name) for name in before} == before
    return ran


def report(ran: Ran) -> dict[str, Any]:
    document: dict[str, Any] = json.loads(ran.out)
    jsonschema.validate(document, animeme_schemas.load("align-report"))
    return document


def statuses(ran: Ran) -> dict[str, str]:
    return {line["id"]: line["status"] for line in report(ran)["lines"]}


def written(folder: Path) -> list[str]:
    files = (path for path in folder.rglob("*") if path.is_file())
    return sorted(path.relative_to(folder).as_posix() for path in files)


def refused(ran: Ran, *words: str) -> None:
    ran.says(*words)
    assert (ran.code, ran.out) == (2, "")


# What comes out


def test_a_flat_folder_is_english(lines: Path, tmp_path: Path, capsys: Capture) -> None:
    output = tmp_path / "timings"
    ran = align(capsys, lines, "--output", output, "--format", "textgrid", "--json")
    assert ran.code == 0
    document = report(ran)
    assert [(e["id"], e["status"], e["codes"], e["language"]) for e in document["lines"]] == [
        ("act 1/moon", "ok", [], "en"),
        ("boat", "ok", [], "en"),
        ("five.v2", "ok", [], "en"),
    ]
    assert written(output) == ["act 1/moon.TextGrid", "boat.TextGrid", "five.v2.TextGrid"]
    assert [entry["output"] for entry in document["lines"]] == written(output)
    totals = document["totals"]
    assert (totals["lines"], totals["ok"], totals["review"], totals["failed"]) == (3, 3, 0, 0)
    assert totals["audio_s"] == pytest.approx(sum(e["audio_s"] for e in document["lines"]))
    assert totals["cpu_s"] > 0
    alone = animeme.align(lines / "boat.wav", (lines / "boat.txt").read_text()).track
    found = read_timings(output / "boat.TextGrid")
    assert [(w.label, w.start_s) for w in found.words] == [(w.text, w.start_s) for w in alone.words]
    assert found.duration_s == alone.duration_s


def test_a_dialogue_folder_has_its_languages(tmp_path: Path, capsys: Capture) -> None:
    folder = tmp_path / "vo"
    for tag in LANGUAGES:
        add(folder, f"{tag}/count", f"{tag}/count")
    add(folder, "en-GB/ada/count", "en/count")
    (folder / "notes").mkdir()
    (folder / "notes" / "read me.md").touch()
    ran = align(capsys, folder, "--output", tmp_path / "out", "--format", "alignment", "--json")
    keys = [f"{tag}/count" for tag in LANGUAGES]
    expected = sorted([*keys, "en-GB/ada/count"])
    assert statuses(ran) == dict.fromkeys(expected, "ok")
    assert written(tmp_path / "out") == [f"{key}.json" for key in expected]
    assert [entry["language"] for entry in report(ran)["lines"]] == ["de", "en-GB", "en", "es"]
    assert json.loads((tmp_path / "out/es/count.json").read_text())["language"] == "es"


def test_a_given_language_is_that_of_the_whole_folder(tmp_path: Path, capsys: Capture) -> None:
    folder = tmp_path / "lines"
    add(folder, "zahl", "de/count")
    add(folder, "en/zahl", "de/count")
    ran = align(capsys, folder, "--language", "de-AT", "--json")
    assert [(e["id"], e["language"]) for e in report(ran)["lines"]] == [
        ("en/zahl", "de-AT"),
        ("zahl", "de-AT"),
    ]
    assert set(statuses(ran).values()) == {"ok"}


@pytest.mark.parametrize(
    ("format", "suffix"),
    [("ctm", ".ctm"), ("phone-ctm", ".ctm"), ("rhubarb-tsv", ".tsv"), ("alignment", ".json")],
)
def test_every_format_that_is_written(
    format: str, suffix: str, lines: Path, tmp_path: Path, capsys: Capture
) -> None:
    align(capsys, lines, "--output", tmp_path / "out", "--format", format)
    names = [f"{id}{suffix}" for id in ("act 1/moon", "boat", "five.v2")]
    assert written(tmp_path / "out") == names
    for name in names:
        assert read_timings(tmp_path / "out" / name).end_s > 1.0


def test_processes_find_what_one_finds(lines: Path, tmp_path: Path) -> None:
    there = animeme.align_folder(lines, output=tmp_path / "one").to_document()
    ran = console("align", lines, "--workers", "2", "--output", tmp_path / "two", "--json")
    back = report(ran)
    assert back["totals"].pop("cpu_s") > there["totals"].pop("cpu_s") > 0
    assert back == there
    assert digests(tmp_path / "one") == digests(tmp_path / "two")


def test_without_an_output_nothing_is_written(lines: Path, capsys: Capture) -> None:
    before = digests(lines)
    ran = align(capsys, lines)
    assert "3 ok, 0 review, 0 failed" in ran.out
    assert "Nothing was written" in ran.out
    assert digests(lines) == before


# Bad lines


def test_a_bad_line_is_named_and_stops_nothing(
    lines: Path, tmp_path: Path, capsys: Capture
) -> None:
    output = tmp_path / "out"
    (lines / "boat.txt").unlink()
    ran = align(capsys, lines, "--output", output)
    assert ran.code == 1
    assert "failed  boat" in ran.out
    assert "transcript-missing" in ran.out
    assert "Write what is said" in ran.out
    assert "2 ok, 0 review, 1 failed" in ran.out
    assert f"Timings of 2 lines are in '{output}'" in ran.out
    assert written(output) == ["act 1/moon.TextGrid", "five.v2.TextGrid"]
    entry = report(align(capsys, lines, "--output", output, "--json"))["lines"][1]
    assert (entry["codes"], entry["score"], entry["output"]) == (["transcript-missing"], None, None)
    add(lines, "boat")
    assert align(capsys, lines, "--output", output).code == 0
    assert "boat.TextGrid" in written(output)


def test_a_doubtful_line_is_written_and_fails_only_on_demand(
    lines: Path, tmp_path: Path, capsys: Capture
) -> None:
    track = animeme.align(lines / "boat.wav", (lines / "boat.txt").read_text()).track
    cut = [line for line in range(len(track.words)) if line < 3]
    ctm = "".join(
        f"boat 1 {track.words[i].start_s} {track.words[i].end_s - track.words[i].start_s} "
        f"{track.words[i].text}\n"
        for i in (*cut, 5)
    )
    (lines / "boat.ctm").write_text(ctm, encoding="utf-8")
    options = ("--output", tmp_path / "out", "--json")
    ran = align(capsys, lines, *options)
    assert (ran.code, statuses(ran)["boat"]) == (0, "review")
    entry = report(ran)["lines"][1]
    assert entry["codes"][-2:] == ["timings-text-differs", "timings-used"]
    assert entry["output"] == "boat.TextGrid"
    assert align(capsys, lines, *options, "--fail-on", "warning").code == 1


def test_what_is_left_of_an_earlier_run_is_told(
    lines: Path, tmp_path: Path, capsys: Capture
) -> None:
    output = tmp_path / "out"
    align(capsys, lines, "--output", output)
    (lines / "boat.txt").write_bytes(b"")
    entry = report(align(capsys, lines, "--output", output, "--json"))["lines"][1]
    assert entry["codes"] == ["transcript-empty", "output-stale"]


STUDIO = """
import os
from animeme_stages.align.aligner import PocketSphinxAligner

class Deadly(PocketSphinxAligner):
    name = "deadly"

    def align(self, speech, text, **named):
        if speech.source.stem == "boat":
            os._exit(7)
        if speech.source.stem == "moon":
            print("a plug-in talks")
            raise LookupError("the studio's server is away")
        return super().align(speech, text, **named)
"""


def test_a_line_that_kills_its_worker_costs_that_line(lines: Path, tmp_path: Path) -> None:
    info = tmp_path / "site" / "fake_studio-1.0.dist-info"
    info.mkdir(parents=True)
    (info / "METADATA").write_text("Metadata-Version: 2.1\nName: fake-studio\nVersion: 1.0\n")
    (info / "entry_points.txt").write_text("[animeme.aligners]\ndeadly = fake_studio:Deadly\n")
    (tmp_path / "site" / "fake_studio.py").write_text(STUDIO)
    paths = [str(tmp_path / "site"), os.environ.get("PYTHONPATH", "")]
    ran = console(
        *("align", lines, "--aligner", "deadly", "--output", tmp_path / "out", "--json"),
        env={"PYTHONPATH": os.pathsep.join(filter(None, paths))},
    )
    assert ran.code == 3
    found = {entry["id"]: (entry["status"], entry["codes"]) for entry in report(ran)["lines"]}
    assert found == {
        "act 1/moon": ("failed", ["worker-error"]),
        "boat": ("failed", ["worker-crash"]),
        "five.v2": ("ok", []),
    }
    assert written(tmp_path / "out") == ["five.v2.TextGrid"]
    assert "exit code 7" in ran.out


# Nothing of the user's is overwritten


def test_timings_beside_a_recording_are_used_and_never_overwritten(
    lines: Path, capsys: Capture
) -> None:
    track = animeme.align(lines / "boat.wav", (lines / "boat.txt").read_text()).track
    write_timings(track, lines / "boat.TextGrid", "textgrid")
    refused(align(capsys, lines, "--output", lines), "boat.TextGrid", "output-is-input", "another")
    ran = align(capsys, lines, "--output", lines / "out", "--json")
    assert report(ran)["lines"][1]["codes"] == ["timings-used"]


def test_a_stranger_in_the_folder_is_not_overwritten(lines: Path, capsys: Capture) -> None:
    (lines / "boat.json").write_text('{"take": 3}')
    options = ("--output", lines, "--format", "alignment")
    refused(align(capsys, lines, *options), "boat.json", "overwritten")
    (lines / "boat.json").unlink()
    assert align(capsys, lines, *options).code == 0
    assert (lines / "boat.json").is_file()


def test_an_output_folder_among_the_lines_is_not_read(lines: Path, capsys: Capture) -> None:
    output = lines / "en"  # also not as the folder of a language
    for _ in range(2):
        ran = align(capsys, lines, "--output", output, "--json")
        assert statuses(ran) == dict.fromkeys(["act 1/moon", "boat", "five.v2"], "ok")
        assert written(output) == ["act 1/moon.TextGrid", "boat.TextGrid", "five.v2.TextGrid"]


# What cannot be used


@pytest.mark.parametrize(
    ("ids", "words"),
    [
        ([], ("no recording", "transcript")),
        (["boat", "de/boat"], ("'de'", "lines beside it", "--language")),
        (["de/boat", "extras/boat"], ("'de'", "not 'extras'", "--language")),
        (["vo/de/boat", "vo/en/boat"], ("'vo/de'", "directly below", "one folder at a time")),
    ],
)
def test_folders_that_leave_open_what_is_meant(
    ids: list[str], words: tuple[str, ...], tmp_path: Path, capsys: Capture
) -> None:
    folder = tmp_path / "lines"
    folder.mkdir()
    for id in ids:
        add(folder, id)
    refused(align(capsys, folder, "--output", tmp_path / "out"), str(folder), *words)
    assert not (tmp_path / "out").exists()
    if ids:
        assert set(statuses(align(capsys, folder, "--language", "en", "--json")).values()) == {"ok"}


@pytest.mark.parametrize(
    ("options", "words"),
    [
        (("--language", "tlh"), ("'tlh'", "Known languages", "en")),
        (("--format", "srt"), ("'srt'", "Choose one of", "textgrid")),
        (("--lexicon", "none.lex"), ("none.lex", "lexicon")),
        (("--aligner", "pocketsfinx"), ("Did you mean 'pocketsphinx'?",)),
        (("--workers", "0"), ("--workers",)),
        (("Hello",), ("leave out TEXT",)),
    ],
)
def test_options_that_cannot_be_used(
    options: tuple[str, ...], words: tuple[str, ...], lines: Path, tmp_path: Path, capsys: Capture
) -> None:
    ran = command(capsys, "align", lines, *options, "--output", tmp_path / "out")
    refused(ran, *words)
    assert not (tmp_path / "out").exists()


def test_an_output_that_is_a_file(lines: Path, tmp_path: Path, capsys: Capture) -> None:
    (tmp_path / "out").touch()
    for output in (tmp_path / "out", tmp_path / "out" / "deep"):
        refused(align(capsys, lines, "--output", output), "is a file", "Choose another output")


def test_a_single_recording_still_needs_its_text(lines: Path, capsys: Capture) -> None:
    refused(command(capsys, "align", lines / "boat.wav"), "TEXT")
    refused(command(capsys, "align", lines / "none"), "no such recording or folder")


def test_a_single_recordings_format_is_checked_even_if_nothing_is_written(
    lines: Path, capsys: Capture
) -> None:
    ran = command(capsys, "align", lines / "boat.wav", lines / "boat.txt", "--format", "srt")
    refused(ran, "'srt'", "Choose one of")


def test_a_doubt_about_a_single_recording_counts_on_demand(lines: Path, capsys: Capture) -> None:
    words = ["align", lines / "boat.wav", "Mama bought a big blue boat for Bob. She bought it"]
    kinds = {command(capsys, *words, *more).code for more in ([], ["--fail-on", "error"])}
    assert kinds == {0}
    assert command(capsys, *words, "--fail-on", "warning").code == 1
    assert command(capsys, *words[:2], lines / "boat.txt", "--fail-on", "info").code == 0


def test_arguments_of_the_library_are_checked(lines: Path) -> None:
    with pytest.raises(ValueError, match="executor"):
        animeme.align_folder(lines, executor="farm")  # type: ignore[arg-type]
    with pytest.raises(ValueError, match="severity"):
        animeme.align_folder(lines, fail_on="never")


# Real lines


def test_real_lines_beside_their_captured_motion(
    shared: Path, tmp_path: Path, capsys: Capture
) -> None:
    folder = tmp_path / "grid"
    folder.mkdir()
    for path in sorted((shared / "data" / "grid-s1" / "lines").iterdir())[:60]:
        shutil.copy(path, folder)
    ran = align(capsys, folder, "--output", tmp_path / "out", "--json")
    assert ran.code == 0
    document = report(ran)
    assert document["totals"]["lines"] == document["totals"]["ok"] == 20
    assert len(written(tmp_path / "out")) == 20
    times = json.loads((shared / "data" / "grid-s1" / "word_times.json").read_text())
    for entry in document["lines"]:
        said = [label for *_, label in times[entry["id"]] if label not in ("sil", "sp")]
        found = read_timings(tmp_path / "out" / entry["output"])
        assert [word.label for word in found.words] == said


def test_an_empty_language_is_not_english(capsys: pytest.CaptureFixture[str]) -> None:
    ran = command(capsys, "align", DIALOGUE / "en" / "boat.wav", "hello", "--language", "")
    assert ran.code == 2
    ran.says("is not a language")
