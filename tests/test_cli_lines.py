"""``animeme lines``, and jobs whose lines are listed."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from animeme import registry
from animeme.cli.lines import lines_of
from support.bad_input import expect_refused
from support.jobs import SAMPLE, Capture, SmallJob, animeme, run_inline, small_job

BOAT = (SAMPLE / "dialogue" / "en" / "boat.txt").read_text(encoding="utf-8").strip()
FIVE = (SAMPLE / "dialogue" / "en" / "five.txt").read_text(encoding="utf-8").strip()


@pytest.fixture
def listed(tmp_path: Path) -> SmallJob:
    """A job whose texts are in a sheet, beside recordings without transcripts."""
    job = small_job(tmp_path / "job", "en/boat", "en/five")
    for path in job.dialogue.rglob("*.txt"):
        path.unlink()
    job.sections["dialogue"]["manifest"] = "lines.csv"
    sheet(job, f'boat,English,Crab,"{BOAT}"', f'five,EN,crab,"{FIVE}"')
    return job


def sheet(job: SmallJob, *rows: str) -> None:
    text = "\n".join(["ID,Language,Speaker,Text", *rows, ""])
    (job.folder / "lines.csv").write_text(text, encoding="utf-8")


def test_a_job_takes_its_texts_from_a_sheet(listed: SmallJob, capsys: Capture) -> None:
    ran = run_inline(capsys, listed)
    assert ran.code == 0, ran.err
    assert listed.statuses() == {"en/crab/boat": "ok", "en/crab/five": "ok"}
    assert listed.animations() == {"boat", "five"}
    assert listed.report()["findings"] == []
    words = json.loads((listed.output / "alignments/en/crab/boat.json").read_text())["words"]
    assert words[0]["text"] in BOAT.lower()


def test_a_bad_row_stops_nothing(listed: SmallJob, capsys: Capture) -> None:
    sheet(
        listed, f'boat,English,Crab,"{BOAT}"', "five,EN,Crab,", "../x,EN,Crab,a", "y,Zzzz,Crab,a",
        "gone,EN,Crab,Gone.",
    )  # fmt: skip
    ran = run_inline(capsys, listed)
    assert ran.code == 1
    assert listed.statuses() == {
        "en/crab/boat": "ok",
        "en/crab/five": "failed",
        "en/crab/gone": "failed",
    }
    (empty,) = listed.findings("en/crab/five")
    assert empty["code"] == "transcript-empty"
    assert empty["place"].endswith("lines.csv:3")
    (gone,) = listed.findings("en/crab/gone")
    assert gone["code"] == "audio-missing"
    general = {finding["code"]: finding["place"] for finding in listed.report()["findings"]}
    assert general["manifest-row-unusable"].endswith("lines.csv:4")
    assert general["language-unknown"].endswith("lines.csv:5")
    assert listed.animations() == {"boat"}


def test_a_sheet_that_cannot_be_used_stops_the_run(listed: SmallJob, capsys: Capture) -> None:
    (listed.folder / "lines.csv").write_text("a,b\n1,2\n")
    expect_refused(listed, run_inline(capsys, listed), "dialogue.manifest", "[dialogue.columns]")
    (listed.folder / "lines.csv").unlink()
    expect_refused(listed, run_inline(capsys, listed), "there is no file 'lines.csv'")
    del listed.sections["dialogue"]["manifest"], listed.sections["dialogue"]["root"]
    expect_refused(listed, run_inline(capsys, listed), "dialogue.root", "or a `manifest`")


def test_surveys_read_the_sheet(listed: SmallJob, capsys: Capture) -> None:
    ran = animeme(capsys, "lexicon", listed.write(), "--json")
    assert json.loads(ran.out)["words"] == len(BOAT.split()) + len(FIVE.split())
    cover = registry.stage("cover-bigrams")(lines_of(listed.file), "facefx", None)
    assert (cover.lines, cover.findings) == (2, ())


def test_lines_lists_what_a_run_would_find(listed: SmallJob, capsys: Capture) -> None:
    assert animeme(capsys, "lines", listed.write()).code == 0
    sheet(listed, "boat,en,Crab,Hi.", "gone,en,Crab,Gone.")
    before = listed.sources()
    ran = animeme(capsys, "lines", listed.file, "--json")
    assert ran.code == 1
    ran.says("recording-surplus", "five.wav")
    document = json.loads(ran.out)
    boat, gone = document["lines"]
    assert (boat["line"], boat["text"], boat["audio_found"]) == ("en/crab/boat", "Hi.", True)
    assert [finding["code"] for finding in gone["findings"]] == ["audio-missing"]
    assert [finding["code"] for finding in document["findings"]] == ["recording-surplus"]
    assert listed.sources() == before
    assert not listed.output.exists()


def test_lines_writes_a_manifest_that_lists_the_same(listed: SmallJob, capsys: Capture) -> None:
    target = listed.folder / "all.json"
    first = animeme(capsys, "lines", listed.write(), "--output", target, "--json")
    again = animeme(capsys, "lines", target, "--json")
    keys = ("line", "text", "audio_found")
    told = [[{k: line[k] for k in keys} for line in json.loads(ran.out)["lines"]]
            for ran in (first, again)]  # fmt: skip
    assert told[0] == told[1]
    animeme(capsys, "lines", listed.file, "--output", target).says("is there already")


def test_lines_of_a_folder_and_of_a_sheet(listed: SmallJob, capsys: Capture, wide: None) -> None:
    ran = animeme(capsys, "lines", listed.dialogue)
    assert ran.code == 1
    assert "transcript-missing" in ran.out
    ran = animeme(capsys, "lines", listed.folder / "lines.csv", "--root", listed.dialogue)
    assert ran.code == 0
    assert "2 lines (en 2), 0 with remarks" in ran.out
    assert animeme(capsys, "lines", listed.folder / "none.csv").code == 2
    animeme(capsys, "lines", listed.write(), "--language", "en").says("[dialogue]")
