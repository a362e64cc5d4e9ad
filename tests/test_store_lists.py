"""Runs of listed lines, and of learned voices: what a changed cell, row or voice does again."""

from __future__ import annotations

import shutil
from pathlib import Path

import pytest

from conftest import SAMPLE
from support.jobs import Capture, SmallJob, animeme, run_inline, small_job
from support.stores import EVERY_STEP, made, rehearsed, results, written

TEXTS = {
    line: (SAMPLE / "dialogue" / f"{line}.txt").read_text(encoding="utf-8").strip()
    for line in ("en/boat", "de/boat")
}


def sheet(job: SmallJob, texts: dict[str, str], *, notes: str = "", first: str = "") -> None:
    """Write the job's list, a column of it for people alone, with another row in front."""
    rows = ["id;language;text;notes", *([first] if first else [])]
    for line, text in texts.items():
        language, _, name = line.partition("/")
        rows.append(f"{name};{language};{text};{notes}")
    (job.folder / "lines.csv").write_text("\n".join(rows) + "\n", encoding="utf-8")


@pytest.fixture
def listed(tmp_path: Path, capsys: Capture) -> SmallJob:
    """Two lines whose texts are in a sheet, run once."""
    job = small_job(tmp_path / "job", *TEXTS)
    for line in TEXTS:
        (job.dialogue / f"{line}.txt").unlink()
    job.sections["dialogue"] |= {"manifest": "lines.csv"}
    sheet(job, TEXTS)
    assert run_inline(capsys, job).code == 0
    assert made(job) == dict.fromkeys(TEXTS, EVERY_STEP)
    return job


def test_a_cell_of_a_sheet_does_its_line_again(listed: SmallJob, capsys: Capture) -> None:
    before = results(listed)
    sheet(listed, {**TEXTS, "en/boat": TEXTS["en/boat"].replace("boat", "coat")})
    assert {entry["line"]: entry["causes"] for entry in rehearsed(capsys, listed)["lines"]} == {
        "en/boat": ["text"]
    }
    run_inline(capsys, listed)
    assert {line: bool(steps) for line, steps in made(listed).items()} == {
        "en/boat": True,
        "de/boat": False,
    }
    assert written(listed) == {"en/crab.glb"}
    sheet(listed, TEXTS)
    assert run_inline(capsys, listed).code == 0
    assert results(listed) == before


def test_rows_may_move_and_other_columns_change(listed: SmallJob, capsys: Capture) -> None:
    before = results(listed)
    sheet(listed, dict(reversed(TEXTS.items())), notes="louder!")
    assert not rehearsed(capsys, listed)["lines"]
    assert run_inline(capsys, listed).code == 0
    assert made(listed) == {key: set() for key in TEXTS}
    assert results(listed) == before


def test_a_new_row_is_the_only_line_done(listed: SmallJob, capsys: Capture) -> None:
    listed.line("en/moon", like="en/moon").with_suffix(".txt").unlink()
    text = (SAMPLE / "dialogue" / "en" / "moon.txt").read_text(encoding="utf-8").strip()
    sheet(listed, TEXTS, first=f"moon;en;{text};")
    assert run_inline(capsys, listed).code == 0
    assert made(listed) == {**{key: set() for key in TEXTS}, "en/moon": EVERY_STEP}
    assert written(listed) == {"en/crab.glb"}


@pytest.mark.slow
def test_a_learned_voice_does_its_lines_again(tmp_path: Path, capsys: Capture) -> None:
    job = small_job(tmp_path / "job", *TEXTS)
    for turn in range(2):
        for source in sorted((SAMPLE / "dialogue" / "en").glob("*.wav")):
            for suffix in (".wav", ".txt"):
                target = job.dialogue / "en" / f"{source.stem}{turn}{suffix}"
                shutil.copy(source.with_suffix(suffix), target)
    job.sections["align"] = {"voices": "voices"}
    assert run_inline(capsys, job).code == 0
    german = {line for line in made(job) if line.startswith("de/")}

    def learn() -> None:
        ran = animeme(capsys, "voice", job.write(), "--executor", "inline", "--language", "en")
        assert ran.code == 0, ran.err

    learn()
    causes = {entry["line"]: entry["causes"] for entry in rehearsed(capsys, job)["lines"]}
    assert causes == {key: ["voice"] for key in made(job).keys() - german}
    assert run_inline(capsys, job).code == 0
    assert {line for line, steps in made(job).items() if "align" in steps} == causes.keys()
    learn()  # the same lines teach the same
    assert run_inline(capsys, job).code == 0
    assert not any(made(job).values())
