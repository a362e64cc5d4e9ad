"""Review pages in Firefox: they play in time, show the head, keep and hand out marks."""

from __future__ import annotations

import csv
import json
import shutil
from collections.abc import Iterator
from itertools import pairwise
from pathlib import Path

import jsonschema
import pytest

import animeme
import animeme_schemas
from animeme.findings import RunReport
from animeme_stages.review import html
from conftest import SAMPLE
from support.browser import inside_mouth
from support.firefox import Firefox, Step, firefox
from test_review_browser import boat
from test_review_pages import NASTY

pytestmark = pytest.mark.slow
TIME = (
    "document.querySelector('.player .time').innerText.split(' ')[0].split(':')"
    ".reduce((minutes, seconds) => minutes * 60 + +seconds, 0)"
)
HEAD: Step = ("wait", "!!document.querySelector(\".stage[data-ready='1']\")")
STOPPED: Step = ("wait", "document.querySelector('.play').getAttribute('aria-label') === 'Play'")
MARKS = "document.querySelector('.exporters .quiet').textContent"
REMARK = "document.querySelector('.player .remark').textContent"
# Where the picture is, where the sound is, as often as the page may change.
FOLLOW = f"""globalThis.followed = [];
setInterval(() => followed.push([{TIME}, heard.currentTime, heard.paused]), 15); true"""


@pytest.fixture(scope="module")
def browser() -> Iterator[Firefox]:
    """Firefox with a display and sound."""
    if html.head_script() is None:
        pytest.skip("the bundle of the 3D view is not built: python hatch_build.py")
    with firefox() as started:
        yield started


@pytest.fixture(scope="module")
def pages(sample_run: tuple[RunReport, Path], tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The line `boat`, with a page for each character."""
    folder = tmp_path_factory.mktemp("firefox")
    animeme.review(sample_run[1], folder, lines=["en/boat"])
    return folder


def sought(at_s: float) -> Step:
    """Go to a time by the slider."""
    slider = "const s = document.querySelector('.player input[type=range]')"
    return (
        "look",
        "sought",
        f"{{ {slider}; s.value = {at_s}; s.dispatchEvent(new Event('input')); }}",
    )


def test_a_line_is_found_plays_in_time_and_moves_the_head(
    browser: Firefox, pages: Path, tmp_path: Path
) -> None:
    got = browser.walk(
        [
            ("open", (pages / "index.html").as_uri()),
            ("press", "/"),
            ("type", "blue boat ada"),
            ("look", "found", "document.querySelector('.filters').innerText"),
            ("click", ".body a"),
            HEAD,
            ("press", "ArrowRight"),
            ("press", "ArrowRight"),
            ("look", "stepped", TIME),
            ("look", "follow", FOLLOW),
            ("press", " "),
            ("wait", f"{TIME} > 0.9"),
            ("press", " "),
            ("look", "paused", f"[{TIME}, heard.paused]"),
            ("press", " "),
            STOPPED,
            ("look", "ended", TIME),
            ("look", "followed", "followed"),
            ("look", "remark", REMARK),
            ("click", "::-p-text(Mouth)"),
            sought(1.38),
            ("picture", "open", "canvas.head"),
            sought(2.04),
            ("picture", "shut", "canvas.head"),
        ],
        tmp_path,
    )
    assert "1 of 36 lines" in got["found"]
    assert got["stepped"] == pytest.approx(2 / 30, abs=0.006)
    assert 0.9 < got["paused"][0] < 2.0
    assert got["paused"][1] is True
    assert got["ended"] == pytest.approx(2.7, abs=0.06)
    assert got["remark"] == ""
    shown, heard, silent = zip(*got["followed"], strict=True)
    assert all(later >= earlier for earlier, later in pairwise(shown))
    assert max(a - b for a, b, c in zip(shown, heard, silent, strict=True) if not c) < 0.13
    assert heard[-1] > 2.4
    assert inside_mouth(got.picture("shut")) < 0.25 * inside_mouth(got.picture("open"))
    got.require_quiet()


def test_without_a_sound_output_it_says_so_and_runs_on(
    browser: Firefox, pages: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("PULSE_SERVER", f"unix:{tmp_path / 'none'}")
    got = browser.walk(
        [
            ("open", boat(pages).as_uri()),
            ("press", " "),
            ("wait", f"{TIME} > 0.4"),
            ("look", "remark", REMARK),
            STOPPED,
            ("look", "ended", TIME),
        ],
        tmp_path,
    )
    assert got["remark"].startswith(
        "The recording is not heard: this browser found no sound output"
    )
    assert got["ended"] == pytest.approx(2.7, abs=0.06)


def test_marks_are_exported_and_kept_for_their_page_alone(
    browser: Firefox, pages: Path, tmp_path: Path
) -> None:
    note = 'late, "blue" says Zoë'
    got = browser.walk(
        [
            ("open", boat(pages).as_uri()),
            ("press", "f"),
            ("press", "m"),
            ("type", note),
            ("look", "marks", MARKS),
            ("click", "::-p-text(Export JSON)"),
            ("click", "::-p-text(Export CSV)"),
            ("open", (pages / "index.html").as_uri()),
            ("look", "list", MARKS),
            ("open", boat(pages).as_uri()),
            ("look", "again", MARKS),
        ],
        tmp_path,
    )
    document = json.loads((tmp_path / "marks.json").read_text(encoding="utf-8"))
    jsonschema.validate(document, animeme_schemas.load("marks"))
    assert [mark["note"] for mark in document["marks"]] == [note]
    with (tmp_path / "marks.csv").open(encoding="utf-8", newline="") as file:
        assert list(csv.reader(file))[1:] == [["en/boat", "ada", "fix", note]]
    alone = " on this page — Firefox keeps those of each page alone"
    assert (got["marks"], got["again"]) == (f"0 good, 1 to fix{alone}",) * 2
    assert got["list"] == f"no marks yet{alone}"
    got.require_quiet()


def test_one_file_plays_and_keeps_the_marks_of_all_lines(
    browser: Firefox, sample_run: tuple[RunReport, Path], tmp_path: Path
) -> None:
    animeme.review(sample_run[1], tmp_path / "out", single_file=True)
    page = (tmp_path / "out" / "index.html").as_uri()
    got = browser.walk(
        [
            ("open", f"{page}#ada/en/moon"),
            HEAD,
            ("press", " "),
            ("wait", "heard.currentTime > 0.3"),
            ("look", "playing", f"[{TIME}, {REMARK}]"),
            ("press", "g"),
            ("press", "j"),
            ("wait", "document.querySelector('h1').textContent.includes('en/think')"),
            HEAD,
            ("press", "f"),
            ("open", page),
            ("look", "marks", MARKS),
        ],
        tmp_path,
    )
    assert got["playing"][0] > 0.15
    assert "not heard" not in got["playing"][1]
    assert got["marks"] == "1 good, 1 to fix"
    got.require_quiet()


def test_text_of_others_is_shown_and_runs_nothing(
    browser: Firefox, sample_run: tuple[RunReport, Path], tmp_path: Path
) -> None:
    dialogue = tmp_path / "dialogue"
    shutil.copytree(SAMPLE / "dialogue", dialogue)
    (dialogue / "en" / "boat.txt").write_text(NASTY, encoding="utf-8")
    animeme.review(sample_run[1], tmp_path / "out", lines=["en/boat"], dialogue=dialogue)
    # What the policy is for: a script that got in all the same does not run, and sends nothing.
    smuggled = """{ const s = document.createElement('script'); s.text = 'document.title = "owned"';
        document.body.append(s); document.body.insertAdjacentHTML('beforeend',
        '<img src="http://127.0.0.1:9/x" onerror="document.title=`owned`">'); }"""
    got = browser.walk(
        [
            ("open", boat(tmp_path / "out").as_uri()),
            HEAD,
            ("look", "said", "document.querySelector('.transcript').innerText"),
            ("look", "title", "document.title"),
            ("look", "smuggled", smuggled),
            ("press", "ArrowRight"),
            ("look", "after", "document.title"),
        ],
        tmp_path,
    )
    assert got["said"].split() == NASTY.split()
    assert got["title"] == got["after"] != "owned"
    assert len([text for text in got.complaints if "Content-Security-Policy" in text]) >= 3
    assert [url for url in got.requests if url.startswith("http")] == []
